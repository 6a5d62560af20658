"""What `otwarp bench forces` found, in memory and as JSON."""

from __future__ import annotations

from dataclasses import dataclass

from otwarp.bench.findings import BeadFindings
from otwarp.bench.timing import Quartiles


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
    cost: Quartiles
    ratio: Quartiles
    errors: Errors | None
    table_bytes: int
    build_seconds: float | None
    steps: int

    @property
    def rate(self) -> Quartiles:
        """Bead-steps per second."""
        return Quartiles(1e9 / self.cost.median, 1e9 / self.cost.high, 1e9 / self.cost.low)


@dataclass(frozen=True, kw_only=True)
class ForcesBench(BeadFindings):
    """Error and cost of the force models for one bead in one trap.

    Attributes:
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

    def check(self) -> None:
        """Raise `KeyError`, `TypeError` or `ValueError` for what no benchmark finds."""
        super().check()
        for row in self.rows:
            row.cost.check()
            row.ratio.check()
