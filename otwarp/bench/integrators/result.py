"""What `otwarp bench integrators` found, in memory and as JSON."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Self

from otwarp.bench.findings import BeadFindings
from otwarp.bench.integrators.largest_step import StepLimit
from otwarp.bench.integrators.observables import OBSERVABLES, PANELS, UNSEEN, Mean, worst
from otwarp.bench.timing import Quartiles

WANTED = 0.01
"""Relative error to which the figure `time to 1 %` belongs."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """Errors at one time step.

    Attributes:
        product: z = k·dt/γ of the stiffest direction.
        errors: Signed relative errors by observable, with their standard errors; nan where nothing was seen.
    """

    product: float
    errors: dict[str, Mean]

    def panel(self, name: str) -> Mean | None:
        """The worst observable of a panel."""
        return worst(self.errors, name)


@dataclass(frozen=True, kw_only=True)
class Line:
    """One integrator over a ladder of time steps, or one force model or precision at its default step.

    Attributes:
        name, label: For programs and for people.
        group: `integrator`, `force` or `precision`.
        cost: ns per bead-step.
        ratio: Cost over that of the default integrator, or of the default model, measured in turns with it.
        points: By falling number of steps per relaxation time.
        limits: By panel, the largest step of `WANTED`; empty where there is one step only.
    """

    name: str
    label: str
    group: str
    cost: Quartiles
    ratio: Quartiles
    points: tuple[Point, ...]
    limits: dict[str, StepLimit]

    def time(self, product: float) -> float:
        """Run time per bead and simulated relaxation time [ns]."""
        return self.cost.median / product

    def time_to(self, panel: str | None = None) -> tuple[float, bool]:
        """Run time to `WANTED` [ns per relaxation time] in a panel, or in all; whether it is an upper bound."""
        limits = [self.limits[panel]] if panel else list(self.limits.values())
        least = min(limits, key=lambda limit: limit.product)
        return self.time(least.product), least.beyond


@dataclass(frozen=True, kw_only=True)
class IntegratorsBench(BeadFindings):
    """Error against run time of integrators, force models and precisions for one bead in one trap.

    Attributes:
        worlds: Beads of a timed call.
        rounds: Repeats of a timed call.
        seconds: Budget of the errors [s].
        powers: Of the deep and of the shallow well [mW].
        relaxations: γ/k of the stiffest direction there [s].
        lags: Relaxation times over which x, z and z again are correlated.
        default: Name of the default integrator's line.
        default_product: z of the step that otwarp chooses for it, by itself, at an accuracy of `WANTED`.
        references: By force model (`table`, `exact`) and observable, value and error of the Fokker–Planck solution.
        lines: All.
    """

    worlds: int
    rounds: int
    seconds: float
    powers: tuple[float, float]
    relaxations: tuple[float, float]
    lags: tuple[int, int, int]
    default: str
    default_product: float
    references: dict[str, dict[str, Mean]]
    lines: tuple[Line, ...]

    FORMAT = "otwarp bench integrators"

    def group(self, name: str) -> list[Line]:
        """The lines of a group, in the order of the measurement; none for an unknown name."""
        return [line for line in self.lines if line.group == name]

    def line(self, name: str) -> Line:
        """A line by its name; `KeyError` if it was not measured."""
        return {line.name: line for line in self.lines}[name]

    def json(self) -> dict[str, Any]:
        """Plain data for `from_json`; what was not seen is null."""
        data = super().json()
        for errors in _errors(data):
            errors.update({name: None for name, found in errors.items() if math.isnan(found["value"])})
        return data

    @classmethod
    def from_json(cls, data: Any) -> Self:
        """The inverse of `json`.

        Raises:
            KeyError, TypeError, ValueError: Not what `json` gave.
        """
        for errors in _errors(data):
            errors.update({name: dataclasses.asdict(UNSEEN) for name, found in errors.items() if found is None})
        return super().from_json(data)

    def check(self) -> None:
        """Raise `KeyError`, `TypeError` or `ValueError` for what no benchmark finds."""
        super().check()
        self.line(self.default)
        for line in self.lines:
            line.cost.check()
            line.ratio.check()
            if not set(line.limits) <= set(PANELS):
                raise ValueError("an unknown panel")
            for point in line.points:
                if not set(point.errors) <= set(OBSERVABLES) or not 0.0 < point.product < math.inf:
                    raise ValueError("an unknown observable, or no step")


def _errors(data: Any) -> list[dict[str, Any]]:
    """The errors of all points in plain data."""
    return [point["errors"] for line in data["lines"] for point in line["points"]]
