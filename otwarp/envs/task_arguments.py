"""What the arguments of a task may be: each is checked as it is given, and refused in one line with what is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from otwarp.errors import InputError

MOST_LENGTH = 1e4
"""Largest coordinate of a goal, and half width of a box [µm]: float32 tells 0.001 µm apart there."""
RATES = (0.1, 10_000.0)
"""Control periods a second [Hz]."""
TIME_LIMITS = (1e-4, 1e5)
"""Of episodes [s]: at the highest rate 10⁹ periods, which 32 bits count."""
SPEEDS = (1e-3, 1e4)
"""Of a hand [µm/s]."""
MOST_POWER = 1e4
"""Of a trap [mW], as of the parameter `trap_power`."""


def within(name: str, value: Any, low: float, high: float, unit: str) -> float:
    """A number from `low` to `high`.

    Raises:
        InputError: Another type, or out of range.
    """
    (number,) = _read(value, 1) or (np.nan,)
    if np.ndim(value) or not low <= number <= high:
        raise InputError(f"{name} is {value!r}; allowed: a number from {low:g} to {high:g} {unit}")
    return number


def triple(name: str, value: Any, *, least: float = -MOST_LENGTH) -> tuple[float, float, float]:
    """Three lengths [µm] from `least` to `MOST_LENGTH`.

    Raises:
        InputError: Another type, another count, or out of range.
    """
    numbers = _read(value, 3)
    if not numbers or not all(least <= n <= MOST_LENGTH for n in numbers):
        raise InputError(f"{name} is {value!r}; allowed: three numbers from {least:g} to {MOST_LENGTH:g} µm")
    return numbers[0], numbers[1], numbers[2]


def powers(name: str, value: Any) -> tuple[float, float]:
    """Least and largest power [mW].

    Raises:
        InputError: Another type, or out of order or range.
    """
    numbers = _read(value, 2)
    if not numbers or not 0.0 <= numbers[0] < numbers[1] <= MOST_POWER:
        raise InputError(f"{name} is {value!r}; allowed: two numbers, 0 ≤ low < high ≤ {MOST_POWER:g} mW")
    return numbers[0], numbers[1]


def rows(name: str, value: Any) -> tuple[tuple[float, ...], ...]:
    """Rows of finite numbers, all of one length; none of them, too.

    Raises:
        InputError: Another type or shape, or a number that is not finite.
    """
    try:
        table = np.asarray(value)
    except (TypeError, ValueError):
        table = np.array(None)
    if table.size == 0 and table.ndim == 1:
        return ()
    if table.dtype.kind not in "iuf" or table.ndim != 2 or not np.isfinite(table).all():
        raise InputError(f"{name} are {value!r}; allowed: rows of finite numbers, all of one length")
    return tuple(tuple(map(float, row)) for row in table)


def items(name: str, value: Any, kind: type, what: str) -> tuple[Any, ...]:
    """Any number of objects of one type, which messages call `what`.

    Raises:
        InputError: No list, or another type in it.
    """
    found = () if isinstance(value, str | Mapping) or not isinstance(value, Iterable) else tuple(value)
    if (not found and value not in ((), [])) or not all(isinstance(item, kind) for item in found):
        raise InputError(f"{name} is {value!r}; allowed: a tuple of {what}")
    return found


def _read(value: Any, count: int) -> tuple[float, ...] | None:
    """So many numbers, or None; NaN is none."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in "iuf" or array.size != count or array.ndim > 1 or np.isnan(array).any():
        return None
    return tuple(float(n) for n in array.ravel())
