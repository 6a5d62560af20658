"""What `otwarp bench forces` found, in memory and as JSON."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from otwarp.bench.findings import BeadFindings, costs_of
from otwarp.bench.timing import Spread
from otwarp.optics import Beam, Particle


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Distances |F − F_exact| over the peak force.

    Attributes:
        rms, largest: Over points spread evenly over the trap region.
        thermal_rms, thermal_largest: Over points where a trapped bead is found.
    """

    rms: float
    largest: float
    thermal_rms: float
    thermal_largest: float


@dataclass(frozen=True, kw_only=True)
class Row:
    """One force model.

    Attributes:
        name, label, family, tolerance: Of its rung, see `otwarp.bench.rungs.Rung`.
        cost: ns per bead-step.
        ratio: Cost over that of the harmonic trap, measured in turns with it.
        errors: None without a trap.
        table_bytes: Memory of the table's nodes, 0 without one.
        build_seconds: Time to build the table; None without one, or if it was in the cache.
        steps: Steps in one measured call.
    """

    name: str
    label: str
    family: str
    tolerance: float | None
    cost: Spread
    ratio: Spread
    errors: Errors | None
    table_bytes: int
    build_seconds: float | None
    steps: int

    @property
    def rate(self) -> Spread:
        """Bead-steps per second."""
        return Spread(1e9 / self.cost.median, 1e9 / self.cost.high, 1e9 / self.cost.low)


@dataclass(frozen=True, kw_only=True)
class ForcesBench(BeadFindings):
    """Error and cost of the force models for one bead in one trap.

    Attributes:
        kind: `cpu` (processor time of one thread) or `cuda` (wall time).
        hardware: Name of the processor or accelerator that did the work.
        machine: Its description, see `otwarp.bench.machine.Machine`.
        beam, sphere: The bead and its trap, as plain numbers.
        worlds: Beads, one per world.
        time_step: The same for all rows [s].
        rounds: Repeats.
        peak: Largest force of the trap [pN].
        region: Radius of the trap region about the equilibrium [µm].
        spread: Standard deviations of the trapped bead's position along x, y, z [µm].
        probes: Points of the region and thermal points behind the errors.
        reference_error: Estimated error of the exact forces, over the peak.
        rows: In the ladder's order.
    """

    kind: str
    hardware: str
    machine: dict[str, Any]
    beam: dict[str, Any]
    sphere: dict[str, Any]
    worlds: int
    time_step: float
    rounds: int
    peak: float
    region: float
    spread: tuple[float, float, float]
    probes: tuple[int, int]
    reference_error: float
    rows: tuple[Row, ...]

    FORMAT = "otwarp bench forces"

    def row(self, name: str) -> Row:
        """The row of a rung; `KeyError` if it was not measured."""
        return {row.name: row for row in self.rows}[name]

    def bead(self) -> str:
        """The bead and its trap in words."""
        return f"{super().bead()}, {self.beam['power']:g} mW"

    def json(self) -> dict[str, Any]:
        """Plain data for `from_json`."""
        return {"format": self.FORMAT, "version": self.VERSION, **dataclasses.asdict(self)}

    @classmethod
    def from_json(cls, data: Any) -> ForcesBench:
        """The inverse of `json`.

        Raises:
            KeyError, TypeError, ValueError: Not what `json` gave.
        """
        fields = cls.fields_of(data)
        rows = []
        for row in fields.pop("rows"):
            errors = None if row["errors"] is None else Errors(**{k: float(v) for k, v in row["errors"].items()})
            rows.append(Row(**(row | costs_of(row) | {"errors": errors})))
        for name in ("spread", "probes"):
            fields[name] = tuple(fields[name])
        out = cls(**fields, rows=tuple(rows))
        out.bead()
        return out


def beam_fields(beam: Beam) -> dict[str, Any]:
    """A beam as plain numbers and names."""
    return dataclasses.asdict(beam)


def sphere_fields(sphere: Particle) -> dict[str, Any]:
    """A sphere of real index as plain numbers."""
    return {"radius": sphere.radius, "index": complex(sphere.index).real}
