"""Options of a task as they are written on a command line: `strategy=B`, `time_limit=10`, `image_size=84,84`."""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Iterable
from importlib import import_module
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from otwarp.envs.registration import TASKS
from otwarp.envs.task import Task
from otwarp.errors import InputError

FIXED = ("name", "scene", "description")
"""Attributes of `Task` that make another one of it."""


def options_of(name: str, texts: Iterable[str]) -> dict[str, Any]:
    """What `task_named` takes, from texts.

    Args:
        name: Of an environment, or the file of a scene with a goal.
        texts: `NAME=VALUE` each; the numbers of a tuple are parted by commas.

    Raises:
        InputError: An option that the task does not have or that has no text, or a value of another kind.
    """
    kinds = kinds_of(name)
    found: dict[str, Any] = {}
    for text in texts:
        option, given, value = text.partition("=")
        if not given or option not in kinds:
            raise InputError(f"option {text!r} of {name}; allowed: NAME=VALUE, NAME one of {', '.join(kinds)}")
        try:
            found[option] = _read(kinds[option], value)
        except ValueError:
            allowed = _said(kinds[option])
            raise InputError(f"option {option} of {name} is {value!r}; allowed: {allowed}") from None
    return found


def kinds_of(name: str) -> dict[str, Any]:
    """Types of the options that can be written, by name: the task's own, then attributes of `Task`."""
    own = {}
    if name in TASKS:
        make = import_module(f"otwarp.envs.tasks.{TASKS[name]}").task
        hints = get_type_hints(make)
        own = {option: hints[option] for option in inspect.signature(make).parameters}
    shared = {option: kind for option, kind in get_type_hints(Task).items() if option not in FIXED}
    return {option: kind for option, kind in (own | shared).items() if _is_written(kind)}


def _bare(kind: Any) -> Any:
    """A type without the None that may stand for it."""
    parts = [part for part in get_args(kind) if part is not types.NoneType]
    return parts[0] if get_origin(kind) in (Union, types.UnionType) and len(parts) == 1 else kind


def _is_written(kind: Any) -> bool:
    """Whether values of a type have a text: numbers, words and truths, and tuples of so many numbers."""
    kind = _bare(kind)
    if get_origin(kind) is tuple:
        return all(part in (int, float) for part in get_args(kind))
    return kind in (bool, int, float, str) or get_origin(kind) is Literal


def _read(kind: Any, text: str) -> Any:
    """A value from its text.

    Raises:
        ValueError: It is none of the type.
    """
    kind = _bare(kind)
    if get_origin(kind) is tuple:
        parts = text.split(",")
        return tuple(_read(one, part) for one, part in zip(get_args(kind), parts, strict=True))
    if get_origin(kind) is Literal:
        if text not in get_args(kind):
            raise ValueError(text)
        return text
    if kind is bool:
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"
    value = kind(text)
    if kind is float and not math.isfinite(value):
        raise ValueError(text)
    return value


def _said(kind: Any) -> str:
    """What a type allows, in words."""
    kind = _bare(kind)
    if get_origin(kind) is tuple:
        parts = get_args(kind)
        return f"{len(parts)} {'whole ' if int in parts else ''}numbers parted by commas"
    if get_origin(kind) is Literal:
        return ", ".join(get_args(kind))
    return {bool: "true or false", int: "a whole number", float: "a finite number", str: "a word"}[kind]
