"""Studies: a capture map, what a study costs over bare steps, trials that have ended, shards and Ray, deliveries.

`python -m benchmarks.study --ray` runs the same blocks on two Ray nodes of this machine as well, and
`--device cuda:0 --devices cuda:0 cuda:1` a map on several devices.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command
from benchmarks.study_setup import setup_table
from benchmarks.worlds import first_of
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from otwarp.studies import Study, delivered, grid, run_study, trapped, trials, values
from otwarp.studies.rows import origin_of, parameter_rows, start_rows

SCENES = Path(__file__).parent.parent / "scenes"
FULL = (64, 1_024)
"""Points along each of the two dimensions of the capture map that a page is about, and trials of each point."""
MAP = {"cpu": (16, 64), "cuda": FULL}
"""The same of the map that is run."""
HELD = {"cpu": 4_096, "cuda": 1_048_576}
"""Trials that all go on to the end, beside as many worlds that are stepped and nothing else."""
SHORT = {"cpu": 4_096, "cuda": 1_048_576}
"""Trials that end early."""
DELIVERIES = {"cpu": 16, "cuda": 100_000}
"""Trials of the delivery."""
WIDE = (64, 2_048)
"""Points along each dimension and trials of each in the map that several devices share."""
SHARED = (16, 256)
"""Points and trials of each in the study that is shared out: four blocks."""


def capture_map(points: int, each: int, until: float = 1.0) -> Study:
    """P(held for 1 s, or another time) of a bead in a tabulated trap, over power and start."""
    axes = {
        "trap_power": grid(0.1, 5.0, points, unit="mW", spacing="log"),
        "start.x:/World/bead": grid(0.2, 2.2, points, unit="µm"),
    }
    return Study(SCENES / "table_trap.usda", axes=axes, observables=[trapped(until=until)], stop=trials(each), seed=7)


def at_one_point(power: float, start: float, count: int) -> Study:
    """So many trials of one point of the map."""
    axes = {"trap_power": values([power], unit="mW"), "start.x:/World/bead": values([start], unit="µm")}
    return Study(
        SCENES / "table_trap.usda",
        axes=axes,
        observables=[trapped(until=1.0)],
        stop=trials(count),
        seed=7,
        time_step=capture_map(2, 1).runner.time_step,
    )


def run_anew(study: Study, device: wp.Device) -> None:
    """All of a study, with its store."""
    with tempfile.TemporaryDirectory() as folder:
        run_study(study, Path(folder) / "out", devices=[str(device)])


def computed(study: Study, device: wp.Device) -> None:
    """The one block of a study, on one thread."""
    study.compute([0], device=str(device), threads=1)


def bare(study: Study, device: wp.Device) -> Callable[[], None]:
    """Steps of the same worlds to the horizon: no ends, no looks, no store; what is timed are the steps alone."""
    runner, n = study.runner, study.stop.at_most * study.design.points
    scene = study.design.scene
    origin = origin_of(scene, study.options)
    at = study.design.at(np.repeat(np.arange(study.design.points), study.stop.at_most))
    rows = parameter_rows(origin, at, n)
    sim = Simulation(scene, worlds=n, seed=7, device=device, threads=1, parameters=rows,
                     time_step=runner.time_step, allow_large_step=True)  # fmt: skip
    start = start_rows(origin, at, n)["position"]

    def steps() -> None:
        """From the start to the horizon."""
        sim.set_state(position=start)
        sim.step(runner.steps)

    return steps


def timed(work: Callable[[], None], device: wp.Device) -> Callable[[], float]:
    """A measurement of what one call costs the device."""
    return lambda: elapsed(work, device).on(device)


def map_rows(device: wp.Device, kind: str) -> tuple[list[tuple[str, ...]], dict[str, Any]]:
    """The capture map: as large as it is run, and on a CPU as large as it is wanted, scaled up."""
    points, each = MAP[kind]
    study = capture_map(points, each)
    run_anew(capture_map(2, 1), device)  # compiles
    taken = timed(partial(run_anew, study, device), device)()
    count, full = points**2 * each, FULL[0] ** 2 * FULL[1]
    per_trial = f"{1e3 * taken / count:.3g}"
    rows = [(f"{points} × {points} points × {each:,} trials, run", f"{taken:.3g}", per_trial)]
    if count < full:
        title = f"{FULL[0]} × {FULL[0]} points × {FULL[1]:,} trials, scaled up by trials, not run"
        rows.append((title, f"{taken * full / count:.3g}", per_trial))
    return rows, {"seconds": taken, "trials": count, "steps": study.runner.steps}


def over_bare_steps(device: wp.Device, kind: str, rounds: int) -> Quartiles:
    """Time of a whole study whose trials all go on to the end, over that of the steps alone."""
    study = at_one_point(5.0, 0.2, HELD[kind])
    found = study.compute([0], device=str(device), threads=1)[0]
    if not np.all(found["end"] == 0):
        raise ValueError("a trial that was to be held was lost")
    steps = bare(study, device)
    whole = partial(computed, study, device)
    steps()
    return interleaved({"": (timed(whole, device), timed(steps, device))}, rounds)[""].ratio()


def map_over_bare_steps(device: wp.Device, kind: str, rounds: int) -> dict[str, Any]:
    """The capture map with its store, over the steps of all its trials to the horizon, and the share that it needs."""
    study = capture_map(*MAP[kind])
    found = study.compute(range(len(study.blocks())), device=str(device), threads=1)
    needed = float(np.mean(np.minimum(np.concatenate([f["end_time"].ravel() for f in found]), study.horizon)))
    steps = bare(study, device)
    steps()
    ratio = interleaved({"": (timed(partial(run_anew, study, device), device), timed(steps, device))}, rounds)[""]
    return {"needed": needed / study.horizon, "time": vars(ratio.ratio())}


def compaction(device: wp.Device, kind: str, rounds: int) -> dict[str, Any]:
    """Trials that end early: the steps that are needed of all, and the time that they take of all."""
    study = at_one_point(0.1, 2.45, SHORT[kind])
    time_of = study.compute([0], device=str(device), threads=1)[0]["end_time"]
    needed = float(np.mean(np.minimum(time_of, 1.0)))
    steps = bare(study, device)
    whole = partial(computed, study, device)
    steps()
    ratio = interleaved({"": (timed(whole, device), timed(steps, device))}, rounds)[""].ratio()
    return {"needed": needed, "time": vars(ratio), "efficiency": needed / ratio.median}


FILE = """
scene = "{scene}"
seed = 7
[[axis]]
name = "trap_power"
grid = {{ from = 0.1, to = 5, count = {points}, spacing = "log" }}
unit = "mW"
[[axis]]
name = "start.x:/World/bead"
grid = {{ from = 0.2, to = 2.2, count = {points} }}
unit = "µm"
[[observable]]
kind = "trapped"
until = "0.5 s"
[stop]
trials = {each}
"""


def shared_out(rounds: int) -> dict[str, Quartiles]:
    """Wall time of the same study by one process, by two shards side by side, and by two Ray nodes of this host [s]."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            points, each = SHARED
            (folder / "shared.toml").write_text(FILE.format(scene=SCENES / "table_trap.usda", points=points, each=each))
            for _ in range(2):
                cluster.add_node(num_cpus=1)
            ways = {
                "one process": [[]],
                "two shards": [["--shard", "1/2"], ["--shard", "2/2"]],
                "two Ray nodes": [["--engine", "ray", "--address", str(cluster.address)]],
            }
            found: dict[str, list[float]] = {name: [] for name in ways}
            for n in range(rounds):
                for name, processes in ways.items():
                    found[name].append(_wall(folder, f"{name}_{n}".replace(" ", "_"), processes))
    finally:
        cluster.shutdown()
    return {name: Quartiles.of(samples) for name, samples in found.items()}


def _wall(folder: Path, out: str, processes: list[list[str]]) -> float:
    """Time from the first command to the end of the last one [s]."""
    line = [sys.executable, "-m", "otwarp", "study", "run", "shared.toml", "--device", "cpu", "--out", out]
    begun = time.perf_counter()
    running = [subprocess.Popen([*line, *more], cwd=folder, stdout=subprocess.DEVNULL) for more in processes]
    if any([child.wait() for child in running]):
        raise InputError(f"{' '.join(line)} failed")
    return time.perf_counter() - begun


def delivery(device: wp.Device, kind: str) -> dict[str, float]:
    """Trials of the shipped cell delivery: how many were delivered, and what they took [s]."""
    scene = Scene.load(SCENES / "cell_delivery.usda")
    until = scene.settings.duration

    def study(count: int) -> Study:
        """So many trials."""
        return Study(scene, observables=[delivered(until=until)], stop=trials(count), seed=7)

    study(1).compute([0], device=str(device), threads=1)  # compiles
    made, found = study(DELIVERIES[kind]), {}
    taken = elapsed(lambda: found.update(made.compute([0], device=str(device), threads=1)[0]), device).on(device)
    return {
        "trials": DELIVERIES[kind],
        "simulated": until,
        "delivered": float(np.sum(found["end"] == 1)),
        "seconds": taken,
    }


def same_bits(study: Study, places: Sequence[Sequence[str]]) -> list[bool]:
    """Of each set of devices, whether it stores the results of the first one, bit for bit."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for n, devices in enumerate(places):
            table = run_study(study, Path(folder) / str(n), devices=list(devices)).read()
            found.append({name: np.asarray(array.values) for name, array in table.variables.items()})
    return [_bits(one) == _bits(found[0]) for one in found]


def _bits(arrays: dict[str, np.ndarray]) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    """Arrays by their names, as what they are in memory."""
    return {name: (a.dtype.str, a.shape, a.tobytes()) for name, a in arrays.items()}


def over_devices(devices: Sequence[str], rounds: int) -> Quartiles:
    """How much faster a map is on these devices than on the first; stores written."""

    def map_on(some: Sequence[str]) -> Callable[[], float]:
        """Wall time of the whole map [s]."""

        def wall() -> float:
            begun = time.perf_counter()
            with tempfile.TemporaryDirectory() as folder:
                run_study(capture_map(*WIDE), Path(folder) / "out", devices=list(some))
            return time.perf_counter() - begun

        return wall

    one, several = map_on(devices[:1]), map_on(devices)
    several()
    return interleaved({"": (one, several)}, rounds)[""].ratio()


def measure(
    device: str = "cpu", *, setup: bool = False, ray: bool = False, devices: Sequence[str] = (), rounds: int = 3
) -> Section:
    """All tables, or of the set-up alone; shards and Ray nodes on request, and on a CPU alone; `devices` that share a
    map if there are any.
    """
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    machine = Machine.look(place)
    set_up = setup_table(capture_map(*FULL, until=capture_map(*FULL).runner.time_step), place, rounds)
    if setup:
        return Section(name="study", kind=kind, machine=machine, tables=[set_up], asked="--setup")
    rows, found = map_rows(place, kind)
    over, ended, sent = over_bare_steps(place, kind, rounds), compaction(place, kind, rounds), delivery(place, kind)
    whole = map_over_bare_steps(place, kind, rounds)
    clock = "; processor time" if kind == "cpu" else ""
    tables = [
        Table(
            title="Capture map: a bead in a tabulated trap for 1 s",
            head=("map", "time [s]", "ms per trial"),
            rows=rows,
            note=f"{found['steps']:,} steps a trial; kernels compiled before, the store written{clock}.",
        ),
        bare_table(over, ended, whole, kind),
        set_up,
        Table(
            title="The shipped cell delivery",
            head=("trials", "simulated time of each [s]", "delivered", "time [s]", "10⁵ trials, by these [h]"),
            rows=[
                (
                    f"{sent['trials']:,}",
                    f"{sent['simulated']:g}",
                    f"{sent['delivered']:.0f}",
                    f"{sent['seconds']:.3g}",
                    f"{sent['seconds'] / sent['trials'] * 1e5 / 3600:.3g}",
                )
            ],
        ),
    ]
    data: dict[str, Any] = {
        "map": found, "over_bare_steps": vars(over), "compaction": ended, "map_over_bare_steps": whole, "delivery": sent
    }  # fmt: skip
    if ray:
        walls = shared_out(rounds)
        tables.append(walls_table(walls))
        data["shared_out"] = {name: vars(wall) for name, wall in walls.items()}
    asked = "--ray" if ray else ""
    if devices:
        asked = f"--devices {' '.join(devices)}"
        places = first_of(devices)
        alike = same_bits(capture_map(*WIDE), [devices[:1], *places])[1:]
        faster = {len(some): over_devices(some, rounds) for some in places}
        title = f"A map of {WIDE[0]} × {WIDE[0]} points × {WIDE[1]:,} trials on several devices, over one"
        rows = [
            (str(n), f.text(".4g"), "yes" if a else "**no**") for (n, f), a in zip(faster.items(), alike, strict=True)
        ]
        head = ("devices", "times as fast", "results those of one, bit for bit")
        tables.append(Table(title=title, head=head, rows=rows, note="One process."))
        data["devices"] = {str(n): vars(found) for n, found in faster.items()}
        data["same_bits"] = dict(zip(map(str, faster), alike, strict=True))
    return Section(name="study", kind=kind, machine=machine, tables=tables, data=data, asked=asked)


def bare_table(over: Quartiles, ended: dict[str, Any], whole: dict[str, Any], kind: str) -> Table:
    """Studies over bare steps: of trials that are held, of such that end early, and of the map."""
    points, each = MAP[kind]
    rows = [(f"{HELD[kind]:,} that are held to the end", "1", over.text(), f"{1.0 / over.median:.3g}")]
    for what, found in ((f"{SHORT[kind]:,} that end early", ended), (f"{points**2 * each:,} of the map", whole)):
        time_of = Quartiles(**found["time"])
        needed = found["needed"]
        rows.append((what, f"{needed:.3g}", time_of.text(), f"{needed / time_of.median:.3g}"))
    return Table(
        title="A study over the bare steps of as many worlds",
        head=("trials", "steps needed of all", "time over bare steps", "needed over taken"),
        rows=rows,
        note="Bare steps go on to the end whatever happens, as a study would in which trials that ended stepped on. "
        "The map begins with nothing and ends with its store written; the others are computed and not kept.",
    )


def walls_table(walls: dict[str, Quartiles]) -> Table:
    """Ways to share a study out."""
    one = walls["one process"].median
    return Table(
        title="The same study shared out on this machine, start and imports included",
        head=("way", "wall time [s]", "over one process"),
        rows=[(name, wall.text(), f"{wall.median / one:.3g}") for name, wall in walls.items()],
    )


if __name__ == "__main__":
    command(
        measure,
        "Studies: a capture map, what a study costs over bare steps, shards and Ray, deliveries.",
        rounds=3,
        setup={"action": "store_true", "help": "only what setting up a million trials takes the host"},
        ray={"action": "store_true", "help": "share a study out over shards and two Ray nodes as well"},
        devices={"nargs": "+", "default": (), "help": "devices that share a map: cuda:0 cuda:1 …"},
    )
