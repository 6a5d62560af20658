"""A study as bytes for a process that may not be able to import the user's functions: they travel as their source."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import inspect
import io
import pickle
import sys
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.functions import function_from_text, outer_names, source_of
from otwarp.scene.read.variations import Variations
from otwarp.studies.any_study import AnyStudy

LIBRARIES = {"otwarp", "warp", "numpy"} | (sys.stdlib_module_names - {"__main__"})
"""Packages that every worker has: their functions travel by name."""


def packed(study: AnyStudy, scene: Path) -> bytes:
    """The study, with `scene` as the file of its scene.

    Raises:
        InputError: A function that uses what cannot be sent.
    """
    moved = copy.copy(study)
    moved.design = dataclasses.replace(study.design, variations=Variations(scene))
    out = io.BytesIO()
    try:
        _Pickler(out).dump(moved)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise InputError(f"the study cannot be sent to workers ({error}); allowed: functions that use modules, numbers "
                         "and other functions") from None  # fmt: skip
    return out.getvalue()


def unpacked(data: bytes) -> AnyStudy:
    """The study again; the file of its scene must be there."""
    return pickle.loads(data)


class _Pickler(pickle.Pickler):
    """Pickles functions of users by their source, and modules by their names."""

    def reducer_override(self, item: Any) -> Any:
        """How something is made again elsewhere; NotImplemented for what pickle knows."""
        if isinstance(item, ModuleType):
            return importlib.import_module, (item.__name__,)
        if isinstance(item, wp.Function):
            return (getattr, (wp, item.key)) if item.is_builtin() else (wp.func, (item.func,))
        if isinstance(item, FunctionType) and item.__module__.partition(".")[0] not in LIBRARIES:
            return _function, (item.__name__, source_of(item), {**_annotations(item), **outer_names(item)})
        return NotImplemented


def _annotations(function: FunctionType) -> dict[str, Any]:
    """What the first names of annotations stand for that are kept as text."""
    texts = [str(a) for a in inspect.get_annotations(function).values() if isinstance(a, str)]
    names = {text.partition(".")[0] for text in texts}
    return {name: function.__globals__[name] for name in names if name in function.__globals__}


def _function(name: str, text: str, names: dict[str, Any]) -> Any:
    """A function from its source; its annotations are evaluated, as if it stood in a file of its own."""
    return function_from_text(name, text + "\n", dict(names))
