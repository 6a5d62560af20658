"""What the budget of a session makes of scenes on this machine: bodies, accuracy, speed, and how long that took."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.realtime import load
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.teleop.budget import Budget, reduce_scene
from otwarp.teleop.budget.report import SECONDS, measure_scene

CASES: tuple[tuple[str, tuple[Budget, ...]], ...] = (
    ("cell_delivery", ("auto", 0.03)),
    ("microfluidic_channel", ("auto", 0.2)),
    ("ten_thousand_cells", ("auto", 0.1)),
    ("crowd_with_trap", ("auto", 0.2)),
)
"""Scenes, and the budgets they are given."""

ROOM = 9.0
"""Cells whose centre is nearer than this to the bead of `crowd_with_trap` are taken out [µm]."""


def crowd_with_trap() -> Scene:
    """`ten_thousand_cells` with the trap and bead of `single_bead` in their middle, held at 50 µm/s."""
    crowd, single = load("ten_thousand_cells"), load("single_bead")
    middle = np.mean([b.position for b in crowd.bodies], axis=0)
    shift = middle - single.traps[0].position.values[0]
    track = dataclasses.replace(single.traps[0].position, values=single.traps[0].position.values + shift)
    bead = dataclasses.replace(
        single.bodies[0], position=tuple(float(x) for x in np.array(single.bodies[0].position) + shift)
    )
    far = [c for c in crowd.bodies if np.linalg.norm(np.array(c.position) - bead.position) > ROOM]
    trap = dataclasses.replace(single.traps[0], position=track, hand="left", speed_limit=50.0)
    return dataclasses.replace(crowd, bodies=(bead, *far), traps=(trap,))


def scene_of(name: str) -> Scene:
    """A shipped scene, or the crowd with a trap."""
    return crowd_with_trap() if name == "crowd_with_trap" else load(name)


def measure_case(name: str, budget: Budget, device: str, *, seconds: float) -> dict[str, Any]:
    """One budget for one scene, and how long finding it took."""
    scene = scene_of(name)

    def timed(scene: Scene, *, device: str | None, speed: float, rate: float) -> Any:
        return measure_scene(scene, device=device, speed=speed, rate=rate, seconds=seconds)

    begun = time.perf_counter()
    found = reduce_scene(scene, device=device, budget=budget, measure=timed)
    report = found.report.to_json()
    return {"scene": name, "took": time.perf_counter() - begun, **report}


def _row(found: dict[str, Any]) -> tuple[str, ...]:
    before, after, budget = found["before"], found["after"], found["budget"]
    frozen, left = (sum(1 if rows is None else len(rows) for rows in found[n].values()) for n in ("frozen", "left"))
    accuracy = found["accuracy"]
    return (
        f"`{found['scene']}`",
        budget if isinstance(budget, str) else f"{100.0 * budget:g} %",
        f"{100.0 * before['load']:.3g} %",
        f"{found['kept']} of {found['bodies']}",
        str(frozen),
        str(left),
        f"{1e6 * after['time_step']:.4g}",
        f"{100.0 * accuracy[1]:g} %" + (f" (was {100.0 * accuracy[0]:g} %)" if accuracy[0] != accuracy[1] else ""),
        f"{100.0 * after['load']:.3g} %",
        f"{found['speed']:g}",
        str(len(found["log"])),
        f"{found['took']:.1f}",
    )


def measure(
    device: str = "cpu",
    *,
    cases: Sequence[tuple[str, tuple[Budget, ...]]] = CASES,
    rounds: int = 1,
    seconds: float = SECONDS,
) -> Section:
    """All cases; of `rounds` repeats the last counts, so that with two the kernels are in the cache."""
    place = pick_device(device)
    machine = Machine.look(place)
    found = []
    for name, budgets in cases:
        for budget in budgets:
            for _ in range(rounds - 1):
                measure_case(name, budget, device, seconds=seconds)
            found.append(measure_case(name, budget, device, seconds=seconds))
    head = (
        "scene",
        "budget",
        "share as loaded",
        "bodies that move",
        "frozen",
        "left out",
        "time step [µs]",
        "accuracy",
        "share as run",
        "speed",
        "measured",
        "took [s]",
    )
    table = Table(
        title="What a budget leaves of a scene; `auto` is 70 % of a core",
        head=head,
        rows=[_row(one) for one in found],
        note="`crowd_with_trap` is `ten_thousand_cells` with the trap and bead of `single_bead` in their middle. "
        "Shares are of one core, at the speed of that line; *measured* counts candidates, and *took* holds their "
        "kernels' compilation where these were new.",
    )
    data = {f"{one['scene']} {one['budget']}": one for one in found}
    return Section(name="budget", kind="cpu" if place.is_cpu else "cuda", machine=machine, tables=[table], data=data)


if __name__ == "__main__":
    command(measure, "What a budget leaves of a scene.", rounds=1)
