"""Arguments that users give in Python: whole numbers and arrays of numbers, held to be what they say they are."""

from __future__ import annotations

import math
import operator
from collections.abc import Collection, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError

T = TypeVar("T")


def whole(name: str, value: Any, least: int, most: int | None = None) -> int:
    """A whole number in a range.

    Raises:
        InputError: Another type (a text, a truth value, 1.5), or out of range.
    """
    allowed = f"{least} or more" if most is None else f"{least} to {most}"
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or isinstance(value, bool | np.bool_):
        raise InputError(f"{name} is {value!r}; allowed: a whole number, {allowed}")
    if number < least or (most is not None and number > most):
        raise InputError(f"{name} is {number}; allowed: {allowed}")
    return number


def several(name: str, values: Any, kind: type[T], what: str) -> tuple[T, ...]:
    """Any number of objects of one type, which messages call `what`.

    Raises:
        InputError: No list, or one of another type in it.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InputError(f"{name} is {_shown(values)}; allowed: a list of {what}")
    given = tuple(values)
    for item in given:
        if not isinstance(item, kind):
            raise InputError(f"{name} has {_shown(item)}; allowed: {what}")
    return given


def by_name(name: str, values: Any) -> Mapping[str, Any]:
    """Values by their names.

    Raises:
        InputError: No mapping.
    """
    if not isinstance(values, Mapping):
        raise InputError(f"{name} is {_shown(values)}; allowed: a dict of values by their names")
    return values


def numbers(name: str, values: ArrayLike) -> np.ndarray:
    """Real numbers as a float64 array of their own shape.

    Raises:
        InputError: Texts, truth values, complex numbers, objects, or rows of unequal length.
    """
    try:
        given = np.asarray(values)
    except ValueError:
        raise InputError(f"{name} has rows of unequal length; allowed: an array of numbers") from None
    if given.dtype.kind not in "iuf":
        raise InputError(f"{name} is {_shown(values)} of type {given.dtype}; allowed: numbers")
    return given.astype(float)


def number(name: str, value: Any) -> float:
    """One real number.

    Raises:
        InputError: Another type, or an array.
    """
    given = numbers(name, value)
    if given.ndim:
        raise InputError(f"{name} has shape {given.shape}; allowed: one number")
    return float(given)


def seconds(name: str, value: Any) -> float:
    """A time [s], finite and 0 or more.

    Raises:
        InputError: Another type, or out of range.
    """
    time = number(name, value)
    if not (math.isfinite(time) and time >= 0.0):
        raise InputError(f"{name} is {time:g} s; allowed: a finite time, 0 or more")
    return time


def known_names(what: str, given: Iterable[str], known: Collection[str]) -> None:
    """Refuse a parameter that a function of the user's does not have.

    Raises:
        InputError: One of `given` is not among `known`.
    """
    for name in given:
        if name not in known:
            allowed = ", ".join(known) or "none, it has no parameters"
            raise InputError(f"{what}: parameter {name!r} is unknown; allowed: {allowed}")


def _shown(value: Any) -> str:
    """A value as messages show it: its start, if it is long."""
    text = " ".join(repr(value).split())  # an array is shown in several lines
    return text if len(text) < 60 else f"{text[:57]}…"
