"""Simulated operators: seconds of theirs a second, and what each part of a servo period costs.

`python -m benchmarks.operators` runs simulated operators at the shipped cell delivery, with haptics.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from benchmarks import operators_chain
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.operators.loop import Loop
from otwarp.operators.study import OperatorStudy
from otwarp.scene import Scene

SCENE = Path(__file__).parent.parent / "scenes" / "cell_delivery.usda"
OPERATORS = {"cpu": (1, 16, 64), "cuda": (256, 2_048, 16_384)}
"""Simulated operators at once, a world each."""
BEGUN, SECONDS = 0.2, 0.5
"""Of simulated time: before anything is measured, and in a measurement. The first trials end after a second, and worlds
that are done stand still, so that every measurement is of a loop of its own."""
PERIODS = 40
"""Servo periods in a measurement of a part."""


def loop_of(operators: int, device: str) -> Loop:
    """Simulated operators with haptics, some way into their trials."""
    study = OperatorStudy(scene=Scene.load(SCENE), operators=operators, conditions=("with",), seed=7)
    loop = study.loop(np.arange(operators), device)
    loop.run(BEGUN)
    return loop


def pace(operators: int, device: wp.Device, rounds: int) -> Quartiles:
    """Operator-seconds per second of the whole loop, while everybody is at work."""
    speeds = []
    for _ in range(rounds):
        loop = loop_of(operators, str(device))
        speeds.append(operators * SECONDS / elapsed(partial(loop.run, SECONDS), device).on(device))
    return Quartiles.of(speeds)


def parts(loop: Loop, device: wp.Device, rounds: int) -> dict[str, Quartiles]:
    """Cost of each part per operator and servo period, launched alone [ns]; the state goes on, as in a trial."""
    frames = loop.frame_rate / loop.rate
    ways: dict[str, tuple[Callable[[], object], float]] = {
        "physics, contact included": (lambda: loop.sim.step(loop.turn.steps), 1.0),
        "hand: eyes, plan, arm": (loop.move_hands, 1.0),
        "servo chain, both hands": (loop.chain.step, 1.0),
        "traps and account": (lambda: (loop.command_traps(), loop.keep_account()), 1.0),
        "picture, for chain and eyes": (loop.publish, frames),
    }

    def cost(work: Callable[[], object], share: float) -> float:
        """Of one part [ns]."""
        taken = elapsed(lambda: [work() for _ in range(PERIODS)], device).on(device)
        return 1e9 * share * taken / PERIODS / loop.sim.model.worlds

    return {name: Quartiles.of([cost(*way) for _ in range(rounds)]) for name, way in ways.items()}


def measure(device: str = "cpu", *, rounds: int = 5, operators: tuple[int, ...] = ()) -> Section:
    """Speed over the number of simulated operators, and the parts of a servo period of the largest number."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    machine = Machine.look(place)
    counts = operators or OPERATORS[kind]
    found = {count: pace(count, place, rounds) for count in counts}
    split = parts(loop_of(counts[-1], str(place)), place, rounds)
    chains, chain_data = operators_chain.table(place, rounds)
    tables = [
        Table(
            title="Simulated operators with haptics at the cell delivery",
            head=("operators at once", "operator-seconds per second"),
            rows=[(f"{count:,}", speed.text()) for count, speed in found.items()],
            note="Hands, both servo chains at 1 kHz, two steps of physics a period, 120 pictures a second"
            f"{'; one core, processor time' if kind == 'cpu' else ''}.",
        ),
        Table(
            title=f"What a servo period of one operator costs, of {counts[-1]:,} at once",
            head=("part", "ns"),
            rows=[(name, cost.text()) for name, cost in split.items()],
            note="Parts are launched one by one here; in a loop they are one graph.",
        ),
        chains,
    ]
    data: dict[str, Any] = {
        "speed": {str(count): vars(speed) for count, speed in found.items()},
        "parts": {name: vars(cost) for name, cost in split.items()},
        "chain": chain_data,
    }
    return Section(name="operators", kind=kind, machine=machine, tables=tables, data=data)


if __name__ == "__main__":
    command(measure, "Simulated operators: their seconds a second, and what each part costs.", rounds=5)
