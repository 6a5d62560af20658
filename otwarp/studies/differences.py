"""Where two descriptions differ first: what a study that is refused differs in."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

Difference = tuple[str, str, str]
"""Where, what stands there in the one, and what in the other."""

ABSENT = object()
LONGEST = 80
"""Characters of a value in a message."""


def difference(a: Any, b: Any) -> Difference | None:
    """The first place in which nested mappings, lists and dataclasses differ, as `axes.power.values[3]`; or None."""
    found = _difference(a, b)
    return None if found is None else (found[0].removeprefix("."), short(found[1]), short(found[2]))


def _difference(a: Any, b: Any) -> tuple[str, Any, Any] | None:
    one, other = _parts(a), _parts(b)
    if one is None or other is None or type(a) is not type(b):
        return None if _equal(a, b) else ("", a, b)
    if isinstance(a, list | tuple | np.ndarray) and len(one) != len(other):
        return " (its length)", len(one), len(other)
    for name in {**one, **other}:
        found = _difference(one.get(name, ABSENT), other.get(name, ABSENT))
        if found is not None:
            return f"{name}{found[0]}", found[1], found[2]
    return None


def _parts(item: Any) -> dict[str, Any] | None:
    """What something is made of, by how its place is written; None of a plain value."""
    if dataclasses.is_dataclass(item) and not isinstance(item, type):
        return {f".{f.name}": getattr(item, f.name) for f in dataclasses.fields(item) if f.compare}
    if isinstance(item, Mapping):
        return {f".{name}": value for name, value in item.items()}
    if isinstance(item, list | tuple) or (isinstance(item, np.ndarray) and item.ndim):
        return {f"[{n}]": value for n, value in enumerate(item)}
    return None


def _equal(a: Any, b: Any) -> bool:
    return a is b or (type(a) is type(b) and bool(a == b or (a != a and b != b)))


def short(value: Any) -> str:
    """A value as JSON, cut off where it is long."""
    if value is ABSENT:
        return "none"
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}…"
