"""Whether the chosen time step keeps its promise: accuracies × integrators × laws × depths, without sampling noise.

For every cell otwarp chooses the step of a scene, and the operator of `radial_chain` finds what the integrator makes of
that step: an error is within the wanted accuracy, or told by `otwarp info` and `run`, or silent and a defect.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import lru_cache, partial
from typing import Any

from benchmarks.radial_chain import RadialChain
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.radial_wells import SHAPES, Averages, RadialWell, solution, steps_in
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.simulation.model import Model

ACCURACIES = (0.001, 0.01, 0.05)

INTEGRATORS = ("eulerMaruyama", "heun", "exponential")
"""Those whose chain has no memory; `leimkuhlerMatthews` shares noise between steps, see `otwarp bench stability`."""

DEPTHS = (2.0, 5.0, 8.0)
"""[k_B T]"""

STARTS, BESIDE = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995), (0.98, 1.0, 1.02)
"""Where beads start whose survival is looked at: over where the law ends, and over where its spring ends."""

WATCHED = (0.05, 0.2, 1.0)
"""For how long [γ/k]."""

NAMES = {
    "variance": "variance",
    "correlation": "correlation",
    "displacement": "displacement",
    "displacements": "displacement",
    "escape": "escape",
    "survival": "survival",
}
"""What of `Averages` is which of `OBSERVABLES`; survival has a step, and an estimate of `escape`, for each start."""

HEAD = (
    "law",
    "integrator",
    "accuracy",
    "k·dt/γ",
    *(f.name for f in fields(Averages)),
    "near its end",
    "survival",
    "told",
)

NOTE = (
    "Errors in per cent, each the worst over depths of 2, 5 and 8 k_B T, against the Smoluchowski equation; k·dt/γ is "
    "the step that otwarp chooses, at these depths. Variances, correlations (at the time in which they fall to 1/e) "
    "and mean squared displacements (over one step and over five) are those of beads that are still there; escape is "
    "the mean time from the middle to where the law ends. Survival is the share still there after 0.05, 0.2 and 1 γ/k, "
    "of beads that start at 40 to 99.5 % of that distance and beside the place where the spring ends, with the step "
    "that otwarp chooses for a bead that starts there; `near its end` is the shortest of these steps, k·dt/γ. Errors "
    "above the wanted accuracy are in bold, and told: what `otwarp info` and `run` say is estimated to miss it. "
)


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One scene at one accuracy.

    Attributes:
        shape, depth: Of the well.
        integrator, accuracy: Of the scene.
        product, near: k·dt/γ as chosen for a bead that starts in the middle, and the least for one near the end.
        errors: Relative, by the names of `Averages`, and of survival.
        told: Estimated errors of what is said to miss the accuracy, by the names of `OBSERVABLES`; of survival the
            least for any start.
    """

    shape: str
    depth: float
    integrator: str
    accuracy: float
    product: float
    near: float
    errors: dict[str, float]
    told: dict[str, float]

    @property
    def silent(self) -> list[str]:
        """What is worse than wanted, and worse than told."""
        return [
            name
            for name, error in self.errors.items()
            if abs(error) > max(self.accuracy, abs(self.told.get(NAMES[name], 0.0)))
        ]


def chosen(well: RadialWell, integrator: str, accuracy: float, start: float = 0.0) -> tuple[float, dict[str, float]]:
    """k·dt/γ for a bead that starts at `start` of the way to the end, and what is told."""
    scene = well.scene(start, accuracy=accuracy, integrator=integrator)
    scales = Model.build(scene, device="cpu").scales
    return scales.time_step * well.rate, scales.missed


def cell(shape: str, depth: float, integrator: str, accuracy: float) -> Cell:
    """Choose the step, and find what it does."""
    well, truth = RadialWell(shape, depth), solution(shape, depth)
    step, told = chosen(well, integrator, accuracy)
    chain = lru_cache(partial(RadialChain, integrator, well))
    exact, found = asdict(truth.averages(step)), asdict(chain(step).averages())
    survival, near, least = 0.0, step, math.inf
    for start in sorted({*STARTS, *(r * well.bend / well.end for r in BESIDE if r * well.bend < well.end)}):
        taken, missed = chosen(well, integrator, accuracy, start)
        near, least = min(near, taken), min(least, missed.get("escape", 0.0))
        for steps in {steps_in(time, taken) for time in WATCHED}:
            right = truth.survival(start * well.end, steps * taken)
            survival = max(survival, chain(taken).survival(start, steps) / right - 1.0, key=abs)
    return Cell(
        shape=shape,
        depth=depth,
        integrator=integrator,
        accuracy=accuracy,
        product=step,
        near=near,
        errors={name: found[name] / exact[name] - 1.0 for name in exact} | {"survival": survival},
        told=told | ({"survival": least} if least > 0.0 else {}),
    )


def cells(
    shapes: Iterable[str] = tuple(SHAPES),
    integrators: Sequence[str] = INTEGRATORS,
    accuracies: Sequence[float] = ACCURACIES,
    depths: Sequence[float] = DEPTHS,
) -> Iterator[Cell]:
    """The sweep."""
    for shape in shapes:
        for integrator in integrators:
            for accuracy in accuracies:
                for depth in depths:
                    yield cell(shape, depth, integrator, accuracy)


def rows(found: Sequence[Cell]) -> list[tuple[str, ...]]:
    """One row for every law, integrator and accuracy: the worst over the depths."""
    groups: dict[tuple[str, str, float], list[Cell]] = {}
    for one in found:
        groups.setdefault((one.shape, one.integrator, one.accuracy), []).append(one)
    out = []
    for (shape, integrator, accuracy), group in groups.items():
        worst = {name: max((one.errors[name] for one in group), key=abs) for name in group[0].errors}
        told = sorted({name for one in group for name in one.told})
        out.append(
            (
                shape,
                integrator,
                f"{100.0 * accuracy:g} %",
                _span([one.product for one in group]),
                *(_bold(error, accuracy) for name, error in worst.items() if name != "survival"),
                _span([one.near for one in group]),
                _bold(worst["survival"], accuracy),
                ", ".join(told) or "–",
            )
        )
    return out


def _span(products: Sequence[float]) -> str:
    if min(products) > 0.99 * max(products):
        return f"{min(products):.2g}"
    return f"{min(products):.2g} … {max(products):.2g}"


def _bold(error: float, accuracy: float) -> str:
    text = f"{100.0 * error:+.2g}"
    return f"**{text}**" if abs(error) > accuracy else text


def measure(device: str = "cpu", *, rounds: int = 1, **which: Any) -> Section:
    """The sweep, or the part of it that `which` names, as arguments of `cells`; nothing is timed, nor on a device."""
    machine = Machine.look(pick_device("cpu"))
    found = list(cells(**which))
    silent = [one for one in found if one.silent]
    counts = f"{len(found)} cells, {sum(bool(one.told) for one in found)} of them with something told, "
    table = Table(
        title="Errors with the chosen step", head=HEAD, rows=rows(found), note=f"{NOTE}{counts}{len(silent)} silent."
    )
    return Section(
        name="time_step",
        kind="cpu",
        machine=machine,
        tables=[table],
        data={"cells": [{**asdict(one), "silent": one.silent} for one in found]},
    )


if __name__ == "__main__":
    command(measure, "Whether the chosen time step keeps its promise.", rounds=1)
