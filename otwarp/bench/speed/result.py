"""What `otwarp bench speed` found, in memory and as JSON."""

from __future__ import annotations

from dataclasses import dataclass

from otwarp.bench.findings import Findings
from otwarp.bench.timing import Quartiles


@dataclass(frozen=True, kw_only=True)
class SpeedRow:
    """One workload.

    Attributes:
        case: Name of the case it belongs to.
        label: For people.
        unit: What is counted.
        worlds: Copies, or particles.
        rate: Units per second; None if it was skipped.
        ratio: Rate over that of the case's first row, measured in turns with it; None for that row.
        peer: Whether it is not otwarp's.
        goal: Rate that was wanted on this kind of device, or None.
        check: Stationary variance over the exact one of the scheme, where it is known: is the work done at all?
        skipped: Why there is no rate.
    """

    case: str
    label: str
    unit: str
    worlds: int
    rate: Quartiles | None = None
    ratio: Quartiles | None = None
    peer: bool = False
    goal: float | None = None
    check: float | None = None
    skipped: str = ""


@dataclass(frozen=True, kw_only=True)
class SpeedBench(Findings):
    """Speeds on one device.

    Attributes:
        rounds: Repeats.
        rows: In order of the cases.
    """

    rounds: int
    rows: tuple[SpeedRow, ...]

    FORMAT = "otwarp bench speed"

    def row(self, label: str) -> SpeedRow:
        """The row of that label; `KeyError` if there is none."""
        return {row.label: row for row in self.rows}[label]
