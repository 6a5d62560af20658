"""How fast the shipped scenes run: simulated seconds per second of wall time on one core, and on two."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import warp as wp

from benchmarks.report import Section, command
from benchmarks.startup import ROOT, SCENES
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation

SCALED = "cell_delivery"
"""Scene whose worlds are shared out over threads."""

SCALED_WORLDS = 64

PATIENCE = 5.0
"""Longest run of an animated scene, in units of the wall time of other samples."""


def load(name: str) -> Scene:
    """A shipped scene."""
    return Scene.load(ROOT / "scenes" / f"{name}.usda")


def measure_scene(name: str, device: wp.Device, *, rounds: int, seconds: float) -> dict[str, Any]:
    """One world of a shipped scene on one core, `rounds` times.

    A scene in which something moves is run from its start to its end, or to the `PATIENCE`-fold of `seconds` of wall
    time, each time anew; one at rest goes on for about `seconds`.
    """
    scene = load(name)
    sim = Simulation(scene, device=device, threads=1)
    steps = calls_for(sim.step, device, seconds)
    moves = any(item.position.animated for item in (*scene.traps, *scene.obstacles))
    if moves:
        steps = min(round(scene.settings.duration / sim.time_step), int(PATIENCE * steps))
    runs = []
    for _ in range(rounds):
        if moves:
            sim = Simulation(scene, device=device, threads=1)
            # what only the first launch of a new simulation costs belongs to startup
            sim.step()
        runs.append(elapsed(partial(sim.step, steps), device))
    return {
        "bodies": len(scene.bodies),
        "driver": sim.model.features.driver,
        "time_step": sim.time_step,
        "steps_per_sample": steps,
        "real_time_factor": Quartiles.of([steps * sim.time_step / run.wall for run in runs]),
        "wall_ns_per_step": Quartiles.of([1e9 * run.wall / steps for run in runs]),
        "cpu_ns_per_step": Quartiles.of([1e9 * run.cpu / steps for run in runs]),
    }


def measure_threads(device: wp.Device, *, worlds: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Wall time of many worlds on one worker thread over that on two, in turns; 2 is perfect."""
    scene = load(SCALED)
    one, two = (Simulation(scene, worlds=worlds, device=device, threads=n) for n in (1, 2))
    steps = calls_for(one.step, device, seconds)
    two.step()
    pairs = interleaved(
        {
            SCALED: (
                lambda: elapsed(lambda: one.step(steps), device).wall,
                lambda: elapsed(lambda: two.step(steps), device).wall,
            )
        },
        rounds,
    )[SCALED]
    simulated = worlds * steps * one.time_step
    return {
        "worlds": worlds,
        "steps_per_sample": steps,
        "one_thread": Quartiles.of([simulated / t for t in pairs.first]),
        "two_threads": Quartiles.of([simulated / t for t in pairs.second]),
        "ratio": pairs.ratio(),
    }


def _row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    bodies = found["bodies"]
    return (
        f"`{name}`",
        str(bodies),
        found["driver"],
        f"{1e6 * found['time_step']:.4g}",
        found["real_time_factor"].text(),
        found["wall_ns_per_step"].times(1e-3).text(".4g"),
        f"{1e-3 * found['cpu_ns_per_step'].median:.4g}",
        f"{found['wall_ns_per_step'].median / bodies:.4g}",
    )


def measure(
    device: str = "cpu",
    *,
    scenes: Sequence[str] = SCENES,
    rounds: int = 7,
    seconds: float = 0.2,
    worlds: int = SCALED_WORLDS,
) -> Section:
    """All scenes, and on the CPU the scaling over two threads."""
    place = pick_device(device)
    machine = Machine.look(place)
    found = {name: measure_scene(name, place, rounds=rounds, seconds=seconds) for name in scenes}
    tables = [
        Table(
            title="One world" + (" on one core" if place.is_cpu else ""),
            head=(
                "scene",
                "bodies",
                "driver",
                "time step [µs]",
                "real-time factor",
                "wall [µs/step]",
                "CPU [µs/step]",
                "wall [ns/body-step]",
            ),
            rows=[_row(name, f) for name, f in found.items()],
        )
    ]
    data: dict[str, Any] = {"scenes": {name: _plain(f) for name, f in found.items()}}
    if place.is_cpu:
        scaled = measure_threads(place, worlds=worlds, rounds=rounds, seconds=seconds)
        tables.append(
            Table(
                title=f"{worlds} worlds of `{SCALED}`, simulated seconds (all worlds together) per second of wall time",
                head=("one thread", "two threads", "ratio, pair by pair"),
                rows=[
                    (scaled["one_thread"].text(), scaled["two_threads"].text(), scaled["ratio"].text()),
                ],
            )
        )
        data["threads"] = _plain(scaled)
    return Section(name="realtime", kind="cpu" if place.is_cpu else "cuda", machine=machine, tables=tables, data=data)


def _plain(found: dict[str, Any]) -> dict[str, Any]:
    return {key: vars(value) if isinstance(value, Quartiles) else value for key, value in found.items()}


if __name__ == "__main__":
    command(measure, "Real-time factor of the shipped scenes.", rounds=7)
