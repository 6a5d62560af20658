"""Whether the chosen time step keeps its promise: accuracies × integrators × laws × depths, without sampling noise.

For every cell otwarp chooses the step of a scene, and the operator of `radial_chain` finds what the integrator makes of
that step: an error is within the wanted accuracy, or told by `otwarp info` and `run`, or silent and a defect.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from benchmarks.radial_chain import RadialChain
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.radial_wells import SHAPES, Averages, RadialWell, solution
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.simulation.model import Model

ACCURACIES = (0.001, 0.01, 0.05)

INTEGRATORS = ("eulerMaruyama", "heun", "exponential")
"""Those whose chain has no memory; `leimkuhlerMatthews` shares noise between steps, see `otwarp bench stability`."""

DEPTHS = (2.0, 5.0, 8.0)
"""[k_B T]"""

NAMES = {
    "variance": "variance",
    "correlation": "correlation",
    "displacement": "displacement",
    "displacements": "displacement",
    "escape": "escape",
    "survival": "escape",
}
"""What of `Averages` is which of `OBSERVABLES`."""

HEAD = ("law", "integrator", "accuracy", "k·dt/γ", *(f.name for f in fields(Averages)), "told")

NOTE = (
    "Errors in per cent, each the worst over depths of 2, 5 and 8 k_B T, against the Smoluchowski equation; k·dt/γ is "
    "the step that otwarp chooses, at these depths. Variances, correlations (at the time in which they fall to 1/e) "
    "and mean squared displacements (over one step and over five) are those of beads that are still there; escape is "
    "the mean time from the middle to where the law ends, survival the share still there after 0.2 γ/k, started at "
    "95 % of that distance. Errors above the wanted accuracy are in bold, and told: what `otwarp info` and "
    "`run` say is estimated to miss it. "
)


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One scene at one accuracy.

    Attributes:
        shape, depth: Of the well.
        integrator, accuracy: Of the scene.
        product: k·dt/γ as chosen.
        errors: Relative, by the names of `Averages`.
        told: Estimated errors of what is said to miss the accuracy, by the names of `OBSERVABLES`.
    """

    shape: str
    depth: float
    integrator: str
    accuracy: float
    product: float
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


def cell(shape: str, depth: float, integrator: str, accuracy: float) -> Cell:
    """Choose the step, and find what it does."""
    well = RadialWell(shape, depth)
    scales = Model.build(well.scene(accuracy=accuracy, integrator=integrator), device="cpu").scales
    step = scales.time_step * well.rate
    exact, found = asdict(solution(shape, depth).averages(step)), asdict(RadialChain(integrator, well, step).averages())
    return Cell(
        shape=shape,
        depth=depth,
        integrator=integrator,
        accuracy=accuracy,
        product=step,
        errors={name: found[name] / exact[name] - 1.0 for name in exact},
        told=scales.missed,
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
        products = [one.product for one in group]
        worst = {name: max((one.errors[name] for one in group), key=abs) for name in group[0].errors}
        told = sorted({name for one in group for name in one.told})
        span = f"{min(products):.2g}" if min(products) > 0.99 * max(products) else _span(products)
        out.append(
            (
                shape,
                integrator,
                f"{100.0 * accuracy:g} %",
                span,
                *(_bold(error, accuracy) for error in worst.values()),
                ", ".join(told) or "–",
            )
        )
    return out


def _span(products: Sequence[float]) -> str:
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
