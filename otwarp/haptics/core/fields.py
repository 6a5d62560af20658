"""Fields of a configuration: their ranges, the refusal of what is outside, and the way to JSON and back."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from dataclasses import field
from typing import Any, Literal

from otwarp.errors import InputError

Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
"""Rows of a 3×3 matrix."""


def number(default: float | None, low: float, high: float, unit: str, *, open_low: bool = False) -> Any:
    """A field for a number between two bounds; `open_low` leaves the lower one out, no default makes it needed."""
    bounds = {"low": low, "high": high, "unit": unit, "open": open_low}
    return field(metadata=bounds) if default is None else field(default=default, metadata=bounds)


def check_fields(config: Any, where: str) -> None:
    """Refuse the first field whose value is of the wrong kind or out of range."""
    hints = _hints(type(config))
    for item in dataclasses.fields(config):
        check_value(f"{where}.{item.name}", getattr(config, item.name), hints[item.name], item.metadata)


def check_value(where: str, value: Any, kind: Any, bounds: Mapping[str, Any]) -> None:
    """Refuse a value that is not of its kind (a type as in the field's annotation) or out of its bounds.

    Raises:
        InputError: Names the key, the value and what is allowed.
    """
    if kind is float or kind is int:
        real = isinstance(value, int) or (kind is float and isinstance(value, float))
        low, high = bounds["low"], bounds["high"]
        inside = real and not isinstance(value, bool) and low <= value <= high
        if not inside or (bounds["open"] and value == low):
            span = f"{'above ' if bounds['open'] else ''}{low:g} to {high:g} {bounds['unit']}".rstrip()
            raise InputError(f"{where} is {value!r}; allowed: {span}")
        return
    origin, choices = typing.get_origin(kind), typing.get_args(kind)
    if origin is Literal:
        fits, allowed = isinstance(value, str) and value in choices, ", ".join(choices)
    elif origin is types.UnionType:
        fits, allowed = isinstance(value, choices), f"{choices[0].__name__} or none"
    elif kind == Matrix:
        fits, allowed = _is_matrix(value), "three rows of three finite numbers"
    elif kind == tuple[int, ...]:
        fits = isinstance(value, tuple) and all(type(n) is int and n >= 0 for n in value)
        allowed = "whole numbers from 0 on"
    elif origin is tuple:
        fits = isinstance(value, tuple) and all(isinstance(item, choices[0]) for item in value)
        allowed = f"any number of {choices[0].__name__}"
    else:
        fits, allowed = isinstance(value, kind), "true or false" if kind is bool else kind.__name__
    if not fits:
        raise InputError(f"{where} is {value!r}; allowed: {allowed}")


def _is_matrix(value: Any) -> bool:
    """Three tuples of three finite numbers."""
    return (
        isinstance(value, tuple)
        and len(value) == 3
        and all(isinstance(row, tuple) and len(row) == 3 for row in value)
        and all(isinstance(x, int | float) and math.isfinite(x) for row in value for x in row)
    )


def _hints(kind: type) -> dict[str, Any]:
    """Annotations of a configuration, resolved."""
    return typing.get_type_hints(kind)


def to_dict(config: Any) -> dict[str, Any]:
    """A configuration as what JSON can hold: dictionaries, lists, numbers, words; infinity is the word `inf`."""
    return {item.name: _plain(getattr(config, item.name)) for item in dataclasses.fields(config)}


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return to_dict(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return "inf" if isinstance(value, float) and value == math.inf else value


def from_dict(kind: type, data: Any, where: str = "") -> Any:
    """The configuration of this class that `to_dict` wrote; keys that are absent have their defaults.

    Args:
        kind: `HapticsConfig`, `HandConfig`, or any other here.
        data: What `json.load` gives.
        where: What the configuration is called in messages.

    Raises:
        InputError: A key that the class lacks, a value of the wrong kind or out of range; one line that names it.
    """
    where = where or kind.__name__
    if not isinstance(data, Mapping):
        raise InputError(f"{where} is {data!r}; allowed: keys and values")
    items = {item.name: item for item in dataclasses.fields(kind)}
    for key in data:
        if key not in items:
            raise InputError(f"{where} has the key {key!r}; allowed: {', '.join(items)}")
    hints, values = _hints(kind), {}
    for key, value in data.items():
        values[key] = _typed(f"{where}.{key}", value, hints[key])
        if not dataclasses.is_dataclass(values[key]):
            check_value(f"{where}.{key}", values[key], hints[key], items[key].metadata)
    try:
        return kind(**values)
    except TypeError:
        raise InputError(f"{where} has {', '.join(data) or 'nothing'}; it needs {', '.join(items)}") from None


def _typed(where: str, value: Any, kind: Any) -> Any:
    """Lists into tuples, dictionaries into configurations, `inf` into infinity."""
    inner = [choice for choice in (kind, *typing.get_args(kind)) if dataclasses.is_dataclass(choice)]
    if inner and isinstance(value, Mapping):
        return from_dict(typing.cast(type, inner[0]), value, where)
    if inner and isinstance(value, list):
        return tuple(from_dict(typing.cast(type, inner[0]), item, f"{where}[{n}]") for n, item in enumerate(value))
    if isinstance(value, list):
        return tuple(_typed(where, item, None) for item in value)
    return math.inf if kind is float and value == "inf" else value
