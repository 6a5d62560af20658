"""Terms compiled for the shapes of obstacles that a scene has, and which of them need a gap.

A function for all shapes is much code, above all that for meshes, and it stands wherever a distance is asked for: on a
GPU a task's kernel was 200 kB of it, more than a multiprocessor caches.
"""

import ast
import functools
import types
from collections.abc import Callable
from typing import Any

import warp as wp

from otwarp.envs.kernels.geometry import gap_of, known_gap, shape_distance
from otwarp.kernels.contact.obstacles import distance_term
from otwarp.kernels.core.functions import outer_names, source_of


def _functions_of(function: Callable[..., Any]) -> dict[str, wp.Function]:
    """Warp's functions that a function calls by name, without those that are built in."""
    names = outer_names(function)
    return {name: f for name, f in names.items() if isinstance(f, wp.Function) and not f.is_builtin()}


@functools.lru_cache(maxsize=1024)
def finds_gap(function: Callable[..., Any]) -> bool:
    """Whether a function asks for a gap from all obstacles, itself or by others that it calls."""
    return any(f is gap_of or finds_gap(f.func) for f in _functions_of(function).values())


@functools.lru_cache(maxsize=1024)
def gap_parameters(function: Callable[..., Any]) -> tuple[str, ...] | None:
    """Names of those parameters of a function whose gaps are all that it asks for; None where it is not so plain."""
    called = _functions_of(function)
    direct = {name for name, f in called.items() if f is gap_of}
    nodes = list(ast.walk(ast.parse(source_of(function))))
    arguments = {n.arg for n in nodes if isinstance(n, ast.arg)}
    arguments -= {n.id for n in nodes if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)}
    uses = [n for n in nodes if isinstance(n, ast.Name) and n.id in direct]
    calls = [n for n in nodes if isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id in direct]
    asked = [c.args[1].id for c in calls if len(c.args) == 2 and isinstance(c.args[1], ast.Name)]
    others = any(finds_gap(f.func) for f in called.values() if f is not gap_of)
    plain = len(asked) == len(uses) and arguments.issuperset(asked) and not others
    return tuple(dict.fromkeys(asked)) if plain else None


@functools.lru_cache(maxsize=1024)
def for_shapes(function: Callable[..., Any], shapes: tuple[str, ...], known: bool = False) -> Callable[..., Any]:
    """The same function, where all distances that it asks for are those of some shapes alone.

    Args:
        function: Plain, of Warp code.
        shapes: Keys of `SHAPES`, at least one.
        known: Whether the gaps that it asks for itself have been found before.
    """
    changed = {}
    for name, called in _functions_of(function).items():
        twin = known_gap if known and called is gap_of else called_for(called, shapes)
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
