"""Misspelt keywords: an `InputError` with the nearest name, where Python has a traceback."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, ParamSpec, Self, TypeVar

from otwarp.errors import InputError, nearest

P = ParamSpec("P")
R = TypeVar("R")


class KnownFields:
    """Base of dataclasses that are made by keywords: a name that is no field is refused before Python refuses it."""

    def __new__(cls, *args: Any, **given: Any) -> Self:
        """Judge the names; the fields themselves are set by the dataclass."""
        _refuse_strangers(cls.__name__, given, [f.name for f in dataclasses.fields(cls)])  # type: ignore[arg-type]
        return super().__new__(cls)


def known_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, which refuses keywords that it does not have with the nearest one that it has.

    Args:
        function: Or a method; its name is what errors begin with.
    """
    known = [name for name in inspect.signature(function).parameters if name != "self"]

    @functools.wraps(function)
    def call(*args: P.args, **given: P.kwargs) -> R:
        _refuse_strangers(function.__qualname__, given, known)
        return function(*args, **given)

    return call


def _refuse_strangers(what: str, given: Iterable[str], known: list[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{what}: {name} is unknown{nearest(name, known)}")
