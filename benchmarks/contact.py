"""Contacts of few bodies: what a step costs beside one without contact, and what its solver leaves.

`python -m benchmarks.contact --device cuda:0`
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation

SCENES = Path(__file__).resolve().parent.parent / "scenes"
TOUCHING, APART = "cell_delivery", "teleop_small"
"""Two robots that squeeze a cell, and the same bodies apart."""
WORLDS = {"cpu": (1,), "cuda": (1, 1_024, 16_384, 131_072)}
"""Worlds of which a step is timed."""
STEPS = {"cpu": 2_000, "cuda": 100}
"""Steps of one measurement."""
COMPARED = 64
"""Worlds whose steps are compared in both precisions."""


def step_time(name: str, worlds: int, device: wp.Device, steps: int, rounds: int) -> tuple[Quartiles, float]:
    """Time of a step [s], and the length of the step [s]."""
    sim = Simulation(Scene.load(SCENES / f"{name}.usda"), worlds=worlds, seed=3, device=device, threads=1)
    sim.step(steps)
    found = [elapsed(partial(sim.step, steps), device).on(device) / steps for _ in range(rounds)]
    return Quartiles.of(found), sim.time_step


def residuals(device: wp.Device, worlds: int, steps: int) -> np.ndarray:
    """(steps, worlds, bodies) distances [µm] of the places after a step in float32 from those in float64.

    Each step starts from equal places, with the same noise.
    """
    scene = Scene.load(SCENES / f"{TOUCHING}.usda")
    single, double = (
        Simulation(scene, worlds=worlds, seed=3, device=device, precision=p) for p in ("float32", "float64")
    )
    apart = []
    for _ in range(steps):
        for mine, other in zip(
            (double.state.position, double.state.orientation), (single.state.position, single.state.orientation),
            strict=True,
        ):  # fmt: skip
            mine.assign(other.numpy().astype(float))
        single.step(1)
        double.step(1)
        way = single.state.position.numpy().astype(float) - double.state.position.numpy()
        apart.append(np.linalg.norm(way, axis=-1))
    return np.array(apart)


def measure(
    device: str = "cpu",
    *,
    worlds: Sequence[int] = (),
    steps: int | None = None,
    compared: int = COMPARED,
    rounds: int = 7,
) -> Section:
    """Both tables."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    steps = steps or STEPS[kind]
    rows, data = [], {}
    for count in worlds or WORLDS[kind]:
        for name in (APART, TOUCHING):
            took, length = step_time(name, count, place, steps, rounds)
            rows.append((f"`{name}`", f"{count:,}", took.times(1e6).text(), f"{count * length / took.median:.3g}"))
            data[f"{name} {count}"] = vars(took)
    left = residuals(place, compared, 50)
    tables = [
        Table(
            title="One step, on one core or one GPU",
            head=("scene", "worlds", "time [µs]", "worlds × real time"),
            rows=rows,
        ),
        Table(
            title=f"Places after a step of `{TOUCHING}` in float32, from those in float64 [µm]",
            head=("mean", "99 %", "largest"),
            rows=[tuple(f"{x:.1e}" for x in (left.mean(), np.quantile(left, 0.99), left.max()))],
            note=f"{compared} worlds, 50 steps, each from equal places with the same noise.",
        ),
    ]
    data["residual"] = {"mean": float(left.mean()), "largest": float(left.max())}
    return Section(name="contact", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(
        measure,
        "Steps of a world whose bodies touch.",
        rounds=7,
        worlds={"type": positive, "nargs": "+", "default": (), "help": "worlds of which a step is timed"},
    )
