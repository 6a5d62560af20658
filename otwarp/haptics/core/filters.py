"""First-order low-pass filters, each with the rate that gives its α a meaning."""

from __future__ import annotations

import math
from dataclasses import dataclass

from otwarp.errors import InputError
from otwarp.haptics.core.fields import check_fields, number
from otwarp.haptics.core.types import Vec3

RATES = (1.0, 20_000.0)
"""Allowed rates of a filter or a servo [Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LowPass:
    """y += α(x − y), once per sample at `rate`.

    An α without its rate means nothing: 0.05 is 19.5 ms at 1 kHz and 162 ms at 120 Hz. τ = −T/ln(1 − α), T = 1/rate.

    Attributes:
        alpha: Share of the new sample, above 0 to 1; 1 filters nothing.
        rate: Samples per second [Hz].

    Raises:
        InputError: α or rate out of range.
    """

    alpha: float = number(None, 0.0, 1.0, "", open_low=True)
    rate: float = number(None, *RATES, "Hz")

    def __post_init__(self) -> None:
        check_fields(self, "filter")

    @classmethod
    def of_time_constant(cls, time_constant: float, rate: float) -> LowPass:
        """The filter with this τ [s] at this rate [Hz].

        Raises:
            InputError: τ negative or not finite, or so long that α vanishes.
        """
        if not 0.0 <= time_constant < math.inf:
            raise InputError(f"filter time constant is {time_constant!r}; allowed: 0 or more, finite [s]")
        alpha = 1.0 if time_constant == 0.0 else -math.expm1(-1.0 / (rate * time_constant))
        return cls(alpha=alpha, rate=rate)

    @property
    def time_constant(self) -> float:
        """τ [s]; 0 for α = 1."""
        return 0.0 if self.alpha == 1.0 else -1.0 / (self.rate * math.log1p(-self.alpha))

    def at(self, rate: float) -> LowPass:
        """The filter of the same τ at another rate [Hz]."""
        return LowPass.of_time_constant(self.time_constant, rate)


class VectorFilter:
    """A low-pass filter of a vector: `value` follows what `step` is given."""

    __slots__ = ("alpha", "value")

    def __init__(self, alpha: float, value: Vec3 = (0.0, 0.0, 0.0)) -> None:
        self.alpha = alpha
        self.value = value

    def step(self, x: float, y: float, z: float) -> Vec3:
        """One sample; returns the filtered vector."""
        a, (u, v, w) = self.alpha, self.value
        self.value = (u + a * (x - u), v + a * (y - v), w + a * (z - w))
        return self.value
