"""What `otwarp bench speed` found, in memory and as JSON."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from otwarp.bench.timing import Spread
from otwarp.errors import InputError


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
    rate: Spread | None = None
    ratio: Spread | None = None
    peer: bool = False
    goal: float | None = None
    check: float | None = None
    skipped: str = ""


@dataclass(frozen=True, kw_only=True)
class SpeedBench:
    """Speeds on one device.

    Attributes:
        kind: `cpu` (processor time of one thread, unless a row says otherwise) or `cuda` (wall time).
        hardware: Name of the processor or accelerator.
        machine: See `otwarp.bench.machine.Machine`.
        rounds: Repeats.
        rows: In order of the cases.
    """

    kind: str
    hardware: str
    machine: dict[str, Any]
    rounds: int
    rows: tuple[SpeedRow, ...]

    def row(self, label: str) -> SpeedRow:
        """The row of that label; `KeyError` if there is none."""
        return {row.label: row for row in self.rows}[label]

    def json(self) -> dict[str, Any]:
        """Plain data."""
        return {"format": "otwarp bench speed", "version": 1, **dataclasses.asdict(self)}

    def save(self, file: Path) -> None:
        """Write as JSON, to a temporary file that then takes the name.

        Raises:
            InputError: The file cannot be written.
        """
        part = file.with_name(f".{file.name}.part")
        try:
            part.write_text(json.dumps(self.json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")
            part.replace(file)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise InputError(f"--json {file} cannot be written: {error.strerror}") from error
