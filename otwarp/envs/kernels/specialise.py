"""Terms compiled for the shapes of obstacles that a scene has, and which of them need a gap.

A function for all shapes is much code, above all that for meshes, and it stands wherever a distance is asked for: on a
GPU a task's kernel was 200 kB of it, more than a multiprocessor caches.
"""

import functools
import types
from collections.abc import Callable
from typing import Any

import warp as wp

from otwarp.envs.kernels.geometry import gap_of, shape_distance
from otwarp.kernels.contact.obstacles import distance_term
from otwarp.kernels.core.functions import outer_names


def _functions_of(function: Callable[..., Any]) -> dict[str, wp.Function]:
    """Warp's functions that a function calls by name, without those that are built in."""
    names = outer_names(function)
    return {name: f for name, f in names.items() if isinstance(f, wp.Function) and not f.is_builtin()}


@functools.lru_cache(maxsize=1024)
def finds_gap(function: Callable[..., Any]) -> bool:
    """Whether a function asks for a gap from all obstacles, itself or by others that it calls."""
    return any(f is gap_of or finds_gap(f.func) for f in _functions_of(function).values())


@functools.lru_cache(maxsize=1024)
def for_shapes(function: Callable[..., Any], shapes: tuple[str, ...]) -> Callable[..., Any]:
    """The same function, where all distances that it asks for are those of some shapes alone.

    Args:
        function: Plain, of Warp code.
        shapes: Keys of `SHAPES`, at least one.
    """
    changed = {}
    for name, called in _functions_of(function).items():
        twin = called_for(called, shapes)
        if twin is not called:
            changed[name] = twin
    if not changed:
        return function
    code, cells = function.__code__, function.__closure__ or ()
    cells = tuple(
        types.CellType(changed[name]) if name in changed else cell
        for name, cell in zip(code.co_freevars, cells, strict=True)
    )
    known = {**function.__globals__, **changed}
    twin = types.FunctionType(code, known, function.__name__, function.__defaults__, cells or None)
    # what Warp registers by a name with <locals> replaces no other function of that name
    twin.__qualname__ = f"for_shapes.<locals>.{function.__name__}"
    twin.__annotations__, twin.__doc__ = function.__annotations__, function.__doc__
    return twin


def called_for(called: wp.Function, shapes: tuple[str, ...]) -> wp.Function:
    """The same for a function of Warp."""
    if called is shape_distance:
        return distance_term(shapes)
    plain = for_shapes(called.func, shapes)
    return called if plain is called.func else _as_warp(plain)


@functools.lru_cache(maxsize=1024)
def _as_warp(function: Callable[..., Any]) -> wp.Function:
    """One function of Warp for each plain one."""
    return wp.func(function)
