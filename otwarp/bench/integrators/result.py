"""What `otwarp bench integrators` found, in memory and as JSON."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from otwarp.bench.findings import BeadFindings, costs_of, positive
from otwarp.bench.integrators.largest_step import Limit
from otwarp.bench.integrators.observables import OBSERVABLES, PANELS, Measured, worst
from otwarp.bench.timing import Spread

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
    errors: dict[str, Measured]

    def panel(self, name: str) -> Measured | None:
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
    cost: Spread
    ratio: Spread
    points: tuple[Point, ...]
    limits: dict[str, Limit]

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
        kind: `cpu` (processor time of one thread) or `cuda` (wall time).
        hardware: Name of the processor or accelerator that did the work.
        machine: Its description, see `otwarp.bench.machine.Machine`.
        beam, sphere: The bead and its trap, as plain numbers.
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

    kind: str
    hardware: str
    machine: dict[str, Any]
    beam: dict[str, Any]
    sphere: dict[str, Any]
    worlds: int
    rounds: int
    seconds: float
    powers: tuple[float, float]
    relaxations: tuple[float, float]
    lags: tuple[int, int, int]
    default: str
    default_product: float
    references: dict[str, dict[str, Measured]]
    lines: tuple[Line, ...]

    FORMAT = "otwarp bench integrators"

    def group(self, name: str) -> list[Line]:
        """The lines of a group."""
        return [line for line in self.lines if line.group == name]

    def line(self, name: str) -> Line:
        """A line by its name; `KeyError` if it was not measured."""
        return {line.name: line for line in self.lines}[name]

    def json(self) -> dict[str, Any]:
        """Plain data for `from_json`; what was not seen is null."""
        data = {"format": self.FORMAT, "version": self.VERSION, **dataclasses.asdict(self)}
        for line in data["lines"]:
            for point in line["points"]:
                point["errors"] = {k: None if math.isnan(v["value"]) else v for k, v in point["errors"].items()}
        return data

    @classmethod
    def from_json(cls, data: Any) -> IntegratorsBench:
        """The inverse of `json`.

        Raises:
            KeyError, TypeError, ValueError: Not what `json` gave.
        """
        fields = cls.fields_of(data)
        for name in ("powers", "relaxations", "lags"):
            fields[name] = tuple(fields[name])
        fields["lines"] = tuple(_line(dict(line)) for line in fields["lines"])
        fields["references"] = {
            model: {name: Measured(**found) for name, found in of.items()} for model, of in fields["references"].items()
        }
        out = cls(**fields)
        out.bead()
        out.line(out.default)
        return out


def _line(data: dict[str, Any]) -> Line:
    points = []
    for point in data["points"]:
        if not set(point["errors"]) <= set(OBSERVABLES):
            raise ValueError("an unknown observable")
        errors = {k: Measured(math.nan, math.nan) if v is None else Measured(**v) for k, v in point["errors"].items()}
        points.append(Point(product=positive(point["product"]), errors=errors))
    if not set(data["limits"]) <= set(PANELS):
        raise ValueError("an unknown panel")
    limits = {k: Limit(**v) for k, v in data["limits"].items()}
    return Line(**(data | costs_of(data) | {"points": tuple(points), "limits": limits}))
