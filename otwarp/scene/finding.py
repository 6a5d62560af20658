"""`Finding`: one thing that is wrong or odd in a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing found.

    Attributes:
        severity: `error` stops a run, `warning` does not.
        prim: Path, or `/` for the stage.
        message: What is wrong, with the value and what is usual or allowed, in one line.
    """

    severity: Literal["error", "warning"] = "warning"
    prim: str
    message: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.prim}: {self.message}"
