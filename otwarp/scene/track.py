"""Values that change in time, and equality of what holds arrays."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.keywords import KnownFields
from otwarp.scene.transforms import align_z, rotate


def _same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


class ByValue(KnownFields):
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

    @classmethod
    def line(cls, start: Sequence[float], end: Sequence[float], *, speed: float, rest: float = 0.0) -> Track:
        """A straight way: see `polyline`."""
        return cls.polyline([start, end], speed=speed, rest=rest)

    @classmethod
    def polyline(cls, points: Sequence[Sequence[float]] | np.ndarray, *, speed: float, rest: float = 0.0) -> Track:
        """A way from point to point, at one speed.

        Args:
            points: (n, 3) places [µm], each another one than the last.
            speed: [µm/s].
            rest: Seconds at the first point before it begins.

        Raises:
            InputError: A speed that is not positive, fewer than two points, or two equal ones in a row.
        """
        p = np.asarray(points, dtype=float)
        if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2:
            raise InputError(f"Track: points = shape {p.shape}: must be (n, 3), n ≥ 2")
        if not (math.isfinite(speed) and speed > 0.0 and math.isfinite(rest) and rest >= 0.0):
            raise InputError(f"Track: speed, rest = {speed:g} µm/s, {rest:g} s: must be in (0, inf) and [0, inf)")
        times = rest + np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]) / speed
        still = rest > 0.0
        return cls(times=np.concatenate([[0.0] * still, times]), values=np.concatenate([p[:1].repeat(still, 0), p]))

    @classmethod
    def circle(
        cls,
        center: Sequence[float],
        radius: float,
        *,
        speed: float,
        turns: float = 1.0,
        normal: Sequence[float] = (0.0, 0.0, 1.0),
        start: float = 0.0,
        rest: float = 0.0,
    ) -> Track:
        """A way round a circle, counter-clockwise about its normal; chords of 3° stay within 0.04 % of the radius.

        Args:
            center: [µm].
            radius: [µm].
            speed: [µm/s].
            turns: How often round [1]; negative for clockwise.
            normal: Axis of the circle, of any length.
            start: Angle where it begins [degrees], from the axis x, turned with the normal.
            rest: Seconds at the start before it begins.

        Raises:
            InputError: A radius or speed that is not positive, no turns, or a normal without length.
        """
        if not (math.isfinite(radius) and radius > 0.0 and math.isfinite(turns) and turns != 0.0):
            raise InputError(f"Track: radius, turns = {radius:g} µm, {turns:g}: must be in (0, inf), and not 0")
        axis = np.asarray(normal, dtype=float)
        if not (np.isfinite(axis).all() and np.linalg.norm(axis) > 0.0):
            raise InputError(f"Track: normal = {tuple(normal)}: must be a direction")
        angles = math.radians(start) + 2.0 * math.pi * turns * np.linspace(0.0, 1.0, math.ceil(120 * abs(turns)) + 1)
        flat = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
        points = np.asarray(center, dtype=float) + rotate(align_z(axis / np.linalg.norm(axis)), flat)
        return cls.polyline(points, speed=speed, rest=rest)

    def shifted(self, by: Sequence[float]) -> Track:
        """The same way, displaced by `by` (k,), or by any that `values` can be added to."""
        return Track(times=self.times, values=self.values + np.asarray(by, dtype=float))

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
