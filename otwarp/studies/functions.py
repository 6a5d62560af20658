"""Functions of users with parameters: Warp code of a world at a moment, and rows of numbers to call it with."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from otwarp.errors import InputError
from otwarp.kernels.core.functions import arguments_of
from otwarp.kernels.core.types import WorldNow
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.simulation.ends import KINDS

Row = Callable[[Mapping[str, Any]], tuple[float, ...]]
"""Numbers of a function's parameters in their order, from values by name and its defaults."""


def world_function(what: str, function: Callable[..., Any]) -> tuple[WorldFunction, Row]:
    """A function `(now: otwarp.WorldNow, *parameters) -> float`, and what makes rows of its parameters.

    Args:
        what: What it is called in messages: an observable, an order.
        function: Its parameters are annotated as `float`, `int` or `wp.vec3`.

    Raises:
        InputError: The function is no such function; likewise of a row, for a parameter that is none or has no value.
    """
    name = function.__name__
    rest, _ = arguments_of(what, function, WorldNow)
    for p in rest:
        if p.annotation not in KINDS:
            raise InputError(f"{what} {name}: argument {p.name} is annotated as {p.annotation!r}; "
                             "allowed: float, int, wp.vec3")  # fmt: skip
    defaults = {p.name: p.default for p in rest}

    def row(values: Mapping[str, Any]) -> tuple[float, ...]:
        """Numbers of all parameters in their order, those that are not given at their defaults."""
        numbers: list[float] = []
        for given in values:
            if given not in defaults:
                raise InputError(f"{what} {name} has no parameter {given}; allowed: {', '.join(defaults) or 'none'}")
        for key, value in {**defaults, **values}.items():
            if value is inspect.Parameter.empty:
                raise InputError(f"{what} {name}: parameter {key} has no value; allowed: {name}({key}=…)")
            numbers += [float(v) for v in (value if hasattr(value, "__len__") else [value])]
        return tuple(numbers)

    return WorldFunction(function, tuple(p.annotation for p in rest)), row
