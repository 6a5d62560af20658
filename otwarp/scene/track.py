"""Values that change in time, and equality of what holds arrays."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError


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

    Raises:
        InputError: Other shapes, a number that is not finite, times that do not increase.
    """

    times: np.ndarray
    values: np.ndarray

    def __post_init__(self) -> None:
        for name, shape in (("times", 1), ("values", 2)):
            given = np.asarray(getattr(self, name))
            if given.ndim != shape or given.dtype.kind not in "iuf" or not len(given):
                allowed = "numbers (n,)" if name == "times" else "numbers (n, k)"
                raise InputError(f"Track: {name} = shape {given.shape} of {given.dtype}: must be {allowed}, n ≥ 1")
            if np.any(bad := ~np.isfinite(given)):
                place = "".join(f"[{i}]" for i in np.argwhere(bad)[0])
                raise InputError(f"Track: {name}{place} = {given[bad][0]}: must be finite")
        if len(self.times) != len(self.values):
            raise InputError(f"Track: values = {len(self.values)} samples: must be as many as times, {len(self.times)}")
        if np.any(late := np.diff(self.times) <= 0.0):
            n = int(np.argmax(late))
            shown = f"times[{n + 1}] = {self.times[n + 1]:g} s after {self.times[n]:g} s"
            raise InputError(f"Track: {shown}: must be strictly increasing")

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
