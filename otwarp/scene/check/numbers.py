"""Places, rotations, sizes and tracks of the description: numbers that geometry can be made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.scene.check.fields import is_number
from otwarp.scene.track import Track
from otwarp.scene.vocabulary.values import bad

FARTHEST = 1e9
"""Largest coordinate of anything in a scene [µm]; single precision is coarser than 60 µm there."""

SMALLEST = 1e-30
"""Least size of anything but nothing [µm]: mobilities, and products of some, must not overflow."""

TURN_TOLERANCE = 0.01
"""How far the length of a quaternion may be from 1: written by hand, with few digits."""


def check_numbers(where: str, prim: str, name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """`value` as float64 of a shape, -1 for any count.

    Raises:
        InputError: Another shape or type, or a number that is not finite.
    """
    try:
        given = np.asarray(value)
    except ValueError:  # rows of unequal length
        given = np.array(None)
    fits = len(given.shape) == len(shape) and all(n in (-1, m) for n, m in zip(shape, given.shape, strict=True))
    if given.dtype.kind not in "iuf" or not fits:
        text = " × ".join("n" if n < 0 else str(n) for n in shape)
        raise bad(where, prim, name, _short(value), f"{text} numbers")
    outside = ~np.isfinite(given)
    if np.any(outside):
        place = "".join(f"[{i}]" for i in np.argwhere(outside)[0])
        raise bad(where, prim, name + place, given[outside][0], "finite")
    return given.astype(float)


def check_places(where: str, prims: list[str], name: str, values: np.ndarray) -> None:
    """Refuse the first of places (n, 3) [µm] that is too far away; each is that of a prim."""
    distance = np.abs(values).max(axis=1)  # a norm would overflow
    if np.any(far := distance > FARTHEST):
        shown = f"{distance[far][0]:g} µm from the origin"
        raise bad(where, prims[int(np.argmax(far))], name, shown, f"within {FARTHEST:g} µm of it")


def check_turns(where: str, prims: list[str], name: str, values: np.ndarray) -> None:
    """Refuse the first of quaternions (n, 4) whose length is not 1; each is that of a prim."""
    off = np.abs(np.linalg.norm(values, axis=1) - 1.0) > TURN_TOLERANCE
    if np.any(off):
        which = int(np.argmax(off))
        raise bad(where, prims[which], name, tuple(values[which].tolist()), "a quaternion (x, y, z, w) of length 1")


def check_length(where: str, prim: str, name: str, value: Any, *, zero: bool = False) -> None:
    """Refuse what is no size [µm]."""
    if not is_number(value) or not (SMALLEST <= value <= FARTHEST or (zero and value == 0.0)):
        raise bad(where, prim, name, repr(value), f"{'0 or ' if zero else ''}in [{SMALLEST:g}, {FARTHEST:g}] µm")


def check_track(where: str, prim: str, name: str, given: Any, width: int) -> None:
    """Refuse what is no track of values of a width; a track's own numbers are judged when it is made."""
    if not isinstance(given, Track) or given.values.shape[1] != width:
        shown = f"samples of {given.values.shape[1]} numbers" if isinstance(given, Track) else _short(given)
        value = "(x, y, z)" if width == 3 else "(x, y, z, w)" if width == 4 else "value"
        like = "" if isinstance(given, Track) else f", such as Track.constant({value})"
        raise bad(where, prim, name, shown, f"a Track of {width} number{'s' * (width > 1)} a sample{like}")
    if name == "position":
        check_places(where, [prim] * len(given.values), name, given.values)
    if name == "orientation":
        check_turns(where, [prim] * len(given.values), name, given.values)


def _short(value: Any) -> str:
    text = f"{value!r} (a {type(value).__name__})"
    return text if len(text) < 100 else f"{text[:60]} … (a {type(value).__name__})"
