"""Cell delivery: trajectories, contact force and robot–trap distance of scripted runs, beside the paper's trials."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.record.figure import draw
from otwarp.record.read import Run, read_run
from otwarp.record.run import record_run
from otwarp.reproduce.drawing import FAINT, INK, OURS, PAPER, drawn, letter, write_csv
from otwarp.reproduce.item import Comparison, Figure, Request, Result, Table, Value, shown
from otwarp.reproduce.measures import mean_of_trials, share
from otwarp.ros.contract import ContractConfig
from otwarp.scene import Scene

FORCES = {"with haptics": (2.57, 3.18), "without": (5.39, 6.78)}
DISTANCES = {"with haptics": (0.02, 0.026), "without": (0.04, 0.058)}
"""Mean and spread of contact force [pN] and robot–trap distance [scene units] of the paper's trials."""
SUCCESSES = {"with haptics": (8, 10), "without": (3, 10)}

DEFINITION = """The scene `cell_delivery.usda`: two five-element robots squeeze a cell between their dishes and carry
it past pillars and moving cubes; its six traps follow an authored path, no person is in it, and runs differ in their
thermal noise alone. Contact force is the magnitude of the net contact force on a robot [pN], distance that between a
trap and the sphere it holds, as `otwarp run` has them (largest of a robot's traps); both are taken over all frames of
a run and both robots, and given as mean ± standard deviation over time like the paper's. The standard error is that
over runs. A trial is a success when the cell is delivered, no trap having lost its sphere and no robot its cell."""

DIFFERENCE = """The paper's trials are steered by people for one and a half to two and a half minutes, with approach,
search and mistakes in them; the authored path takes 13 s and has none. So ours has the smaller spread, and its mean
is that of the preload, 2.2 pN, with which the traps of this scene squeeze the cell: a number of the scene, so that
its being close to 2.57 pN is no evidence. What it shows is that such a delivery is possible within the warning lines,
and what the figures look like. What people add is the matter of the item on the user study."""

INCOMPARABLE = (
    "Trajectories: the paper's are shown and not published as data; the layout of its scene is known from pictures "
    "alone.",
    "Distances of the paper are in scene units of 15 to 35 µm; ours are in µm, and in scene units at 25 µm for "
    "comparison.",
    "Whether the paper's force is on a robot, on both or on the cell is not stated.",
)


@dataclass(frozen=True, eq=False)
class Trials:
    """Time series of recorded runs.

    Attributes:
        time: (n) [s].
        force: (n, W, robots) contact force [pN].
        distance: (n, W, robots) [µm].
    """

    time: np.ndarray
    force: np.ndarray
    distance: np.ndarray


def run(request: Request) -> Result:
    """Run the delivery many times, read what was recorded, draw."""
    scene = request.scene("cell_delivery")
    worlds, folder = request.choose(32, 256), request.work / "run"
    shutil.rmtree(folder, ignore_errors=True)
    last = [-1]

    def progress(time: float, _: float) -> None:
        if int(time) > last[0]:
            last[0] = int(time)
            request.say(f"{time:.0f} of {scene.settings.duration:.0f} s simulated, {worlds} trials")

    summary = record_run(scene, folder, worlds=worlds, seed=request.seed, device=request.device, progress=progress)
    trials, first = _trials(folder, worlds)
    draw(folder, out=request.folder / "delivery.png")
    _write(request.folder, trials, first)
    done = _delivered(summary)
    line, far = _warning_lines(scene)
    _draw(request.folder / "delivery_forces.png", trials, line, far)
    return Result(
        comparisons=_comparisons(trials, done, worlds, line),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"scene": "cell_delivery.usda, as authored", "trials": str(worlds), "seed": str(request.seed),
                  "time step": f"{shown(summary['time_step_s'])} s"},
        tables=(_table(trials),),
        figures=(Figure(file="delivery.png", caption="A simulated delivery, as `otwarp run` draws it: path with "
                                                     "obstacles and "
                        "contact forces; contact force and robot–trap distance over time with their warning lines."),
                 Figure(file="delivery_forces.png", caption="All simulated trials: (a) contact force and (b) "
                                                            "robot–trap "
                        "distance, mean and the range of 90 % of the trials, beside mean ± spread of the paper's "
                        "trials.")),
        files={"delivery.csv": "means over trials, over time", "path.csv": "path of robots and cell in the first "
                                                                           "trial"},
        numbers={"outcomes": summary["task"]["counts"], "trap_distance": summary["trap_distance"],
                 "contact_force": summary["contact_force"], "cell_load": summary.get("cell_load")},
    )  # fmt: skip


def _warning_lines(scene: Scene) -> tuple[float, float]:
    """Contact force [pN] and robot–trap distance [µm] of which the scene warns."""
    goal = scene.goal
    assert goal is not None, "the delivery has one"
    return min(body.warning_force for body in scene.bodies if body.prim in goal.robots), goal.distance_warning


def _delivered(summary: Mapping[str, Any]) -> int:
    return int(summary["task"]["counts"].get("delivered", 0))


def _trials(folder: Path, worlds: int) -> tuple[Trials, Run]:
    """What was recorded, and the first run."""
    force, distance, first = [], [], None
    for world in range(worlds):
        one = read_run(folder / "run.nc", world)
        first = first or one
        force.append(np.linalg.norm(one.force[:, one.robots], axis=-1))
        distance.append(one.distance)
    assert first is not None
    return Trials(first.time, np.stack(force, 1), np.stack(distance, 1)), first


def _comparisons(trials: Trials, done: int, worlds: int, line: float) -> tuple[Comparison, ...]:
    unit = ContractConfig().scene_unit
    force, distance = (_pooled(values) for values in (trials.force, trials.distance))
    rate, interval = share(done, worlds)
    rows = []
    for group in FORCES:
        paired = group == "with haptics"
        nobody = Value(text="see the user study")
        rows += [
            Comparison(what=f"contact force, {group}", unit="pN", grade="S", key=paired,
                       paper=Value(number=FORCES[group][0], spread=FORCES[group][1]), ours=force if paired else nobody,
                       remark="scripted: nobody steers" if paired else ""),
            Comparison(what=f"robot–trap distance, {group}", unit="scene units", grade="S", key=paired,
                       paper=Value(number=DISTANCES[group][0], spread=DISTANCES[group][1]),
                       ours=_scaled(distance, 1.0 / unit) if paired else nobody,
                       remark=f"at {unit:g} µm per unit: {distance.said()} µm" if paired else ""),
            Comparison(what=f"success, {group}", grade="S", paper=Value(number=SUCCESSES[group][0] / 10,
                       text=f"{SUCCESSES[group][0]} of 10"), ours=Value(number=rate, interval=interval,
                       text=f"{done} of {worlds}") if paired else nobody, remark="scripted" if paired else ""),
        ]  # fmt: skip
    over = float(np.mean(trials.force > line))
    rows.append(Comparison(what="time above the warning line of 10 pN", unit="%", ours=Value(number=100.0 * over)))
    rows.append(Comparison(what="length of a trial", unit="s", grade="I", paper=Value(text="≈ 140 with, ≈ 97 without"),
                           ours=Value(number=float(trials.time[-1])), remark="authored speed, 19 µm/s"))  # fmt: skip
    return tuple(rows)


def _pooled(values: np.ndarray) -> Value:
    """Mean ± spread over time and robots of all trials, with the standard error over trials."""
    _, error = mean_of_trials(np.nanmean(values, axis=(0, 2)))
    return Value(number=float(np.nanmean(values)), spread=float(np.nanstd(values)), error=error)


def _scaled(value: Value, by: float) -> Value:
    assert value.number is not None and value.spread is not None and value.error is not None
    return Value(number=value.number * by, spread=value.spread * by, error=value.error * by)


def _table(trials: Trials) -> Table:
    rows = []
    for name, values in (("contact force [pN]", trials.force), ("robot–trap distance [µm]", trials.distance)):
        for robot in range(values.shape[2]):
            one = values[:, :, robot]
            cells = [
                shown(float(v)) for v in (np.nanmean(one), np.nanstd(one), np.nanpercentile(one, 95), np.nanmax(one))
            ]
            rows.append((f"{name}, robot {robot + 1}", *cells))
    return Table(title="By robot, all trials", head=("", "mean", "spread over time", "95th percentile", "largest"),
                 rows=tuple(rows))  # fmt: skip


def _write(folder: Path, trials: Trials, first: Run) -> None:
    columns = {"time_s": trials.time}
    for name, values in (("contact_force_pn", trials.force), ("trap_distance_um", trials.distance)):
        for robot in range(values.shape[2]):
            columns |= {f"{name}_robot{robot + 1}_mean": np.nanmean(values[:, :, robot], axis=1),
                        f"{name}_robot{robot + 1}_first_trial": values[:, 0, robot]}  # fmt: skip
    write_csv(folder / "delivery.csv", columns)
    path = {"time_s": first.time}
    for column, name in enumerate(first.names):
        path |= {f"{name}_{axis}_um": first.position[:, column, n] for n, axis in enumerate("xyz")}
    write_csv(folder / "path.csv", path)


def _draw(path: Path, trials: Trials, line: float, far: float) -> None:
    unit = ContractConfig().scene_unit
    panels = (
        ("a", trials.force, "contact force (pN)", FORCES["with haptics"], 1.0, line),
        ("b", trials.distance, "robot–trap distance (µm)", DISTANCES["with haptics"], unit, far),
    )
    with drawn(path, panels=(1, 2)) as (row,):
        for axes, (which, values, label, (mean, spread), scale, end) in zip(row, panels, strict=True):
            flat = np.nanmean(values, axis=2)
            low, high = np.nanpercentile(flat, [5, 95], axis=1)
            axes.axhspan(max(0.0, scale * (mean - spread)), scale * (mean + spread), color=PAPER, alpha=0.13, lw=0)
            axes.axhline(scale * mean, color=PAPER, lw=1.0, ls=(0, (4, 2)), label="paper, with haptics: mean ± spread")
            axes.fill_between(trials.time, low, high, color=OURS, alpha=0.25, lw=0)
            axes.plot(trials.time, np.nanmean(flat, axis=1), color=OURS, label=f"simulated, {flat.shape[1]} trials")
            axes.axhline(end, color=INK, lw=0.8)
            axes.text(trials.time[-1], end, "warning line of the scene", ha="right", va="bottom", size=7.5, color=FAINT)
            axes.set(xlabel="time (s)", ylabel=label, ylim=(0.0, 1.25 * end), xlim=(0.0, trials.time[-1]))
            axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.76))
            letter(axes, which)
