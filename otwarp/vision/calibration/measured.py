"""A number that was measured: its standard error, its interval, and what it should have been where that is known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LEVEL = 0.95
"""Of intervals."""


@dataclass(frozen=True)
class Measured:
    """A result of a calibration.

    Attributes:
        value: In its unit.
        standard_error: Of the value; of what images cannot tell, such as a pitch that is not what is said, it knows
            nothing.
        low, high: Interval that holds the true value in `LEVEL` of cases, by Student's t.
        unit: Of all of these.
        about: What it is.
        authored: What a synthetic target was made with, or None.
    """

    value: float
    standard_error: float
    low: float
    high: float
    unit: str
    about: str
    authored: float | None = None

    @classmethod
    def of(
        cls, value: float, error: float, freedom: float, unit: str, about: str, authored: float | None = None
    ) -> Measured:
        """With the interval that a standard error of so many degrees of freedom means."""
        from scipy.stats import t

        half = float(t.ppf(0.5 + 0.5 * LEVEL, max(freedom, 1.0))) * error
        return cls(float(value), float(error), float(value - half), float(value + half), unit, about,
                   None if authored is None else float(authored))  # fmt: skip

    def described(self) -> dict[str, Any]:
        """What a calibration file says of it, from which `read` makes it again."""
        return {"value": self.value, "standard_error": self.standard_error, "interval": [self.low, self.high],
                "level": LEVEL, "unit": self.unit, "about": self.about, "authored": self.authored}  # fmt: skip

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Measured:
        """From a file; KeyError, TypeError or ValueError where it is none."""
        low, high = said["interval"]
        if not math.isfinite(said["value"]):
            raise ValueError(f"value is {said['value']}")
        authored = said.get("authored")
        return cls(float(said["value"]), float(said["standard_error"]), float(low), float(high), str(said["unit"]),
                   str(said["about"]), None if authored is None else float(authored))  # fmt: skip
