"""Values that change in time, and equality of what holds arrays."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np


def _same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


class ByValue:
    """Equality field by field, arrays included; fields declared `compare=False` do not count."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields if f.compare)

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False, kw_only=True)
class Track(ByValue):
    """Time samples, interpolated linearly in between and held constant outside.

    Attributes:
        times: (n,) seconds from the start of the run, strictly increasing; n = 1 means constant.
        values: (n, k) samples.
    """

    times: np.ndarray
    values: np.ndarray

    @classmethod
    def constant(cls, value: object) -> Track:
        """A track that never changes; `value` is a scalar or a vector."""
        return cls(times=np.zeros(1), values=np.atleast_1d(np.asarray(value, dtype=float))[None, :])

    @property
    def animated(self) -> bool:
        """Whether the value changes at all."""
        return len(self.times) > 1 and bool(np.any(self.values != self.values[0]))

    def at(self, time: float) -> np.ndarray:
        """(k,) value at `time` [s]."""
        return np.array([np.interp(time, self.times, column) for column in self.values.T])

    def at_times(self, times: np.ndarray) -> np.ndarray:
        """(n, k) values at `times` (n,) [s]."""
        return np.stack([np.interp(times, self.times, column) for column in self.values.T], axis=1)
