"""Terms of tasks: what is observed, what is earned, and what ends an episode, with their units and scales."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp

from otwarp.envs.kernels import terms as functions
from otwarp.envs.kernels.types import TaskNow
from otwarp.errors import InputError
from otwarp.kernels.core.functions import arguments_of
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.scene import Scene

KINDS: dict[type, str] = {float: "a number", int: "a whole number", wp.vec3: "three numbers"}
"""What the parameters of terms may be."""
OWNERS = {
    "body": "bodies", "other": "bodies", "cell": "bodies", "left": "bodies", "right": "bodies",
    "trap": "traps", "second": "traps", "obstacle": "obstacles",
}  # fmt: skip
"""Parameters that are indices, which may be given as prim paths, and what of a scene they count."""
OPTIONS = ("name", "scale", "axes", "weight", "success")


@dataclass(frozen=True, eq=False)
class Term:
    """A function of a world at the end of a period: what `term` makes of one. Called, it gives one with parameters.

    Attributes:
        name: Of the function, or the one given.
        function: The function, and the types of its parameters.
        result: `vector` or `number`, which may be observed (a number be earned, too), or `truth`, which ends episodes.
        unit: Of the result.
        meaning: What it is, in one sentence.
        values: Its parameters by name; None where somebody must give one, a prim path where it is an index.
        scale: By what an observation is divided, in `unit`.
        axes: Components of a vector that are observed.
        weight: Of a reward, per `unit`.
        success: Whether an end is what was wanted.
    """

    name: str
    function: WorldFunction = field(repr=False)
    result: str
    unit: str
    meaning: str
    values: Mapping[str, Any]
    scale: float = 1.0
    axes: str = "xyz"
    weight: float = 1.0
    success: bool = False

    def __call__(self, **given: Any) -> Term:
        """The same term with these parameters; `name`, `scale`, `axes`, `weight` and `success` are those of the term.

        Raises:
            InputError: A name that is no parameter of it, or a value that it cannot have.
        """
        options = {name: given.pop(name) for name in OPTIONS if name in given}
        # numbers of NumPy as Python's own, which JSON has
        options = {name: v.item() if isinstance(v, np.generic) else v for name, v in options.items()}
        for name in given:
            if name not in self.values:
                allowed = ", ".join([*self.values, *OPTIONS])
                raise InputError(f"term {self.name} has no parameter {name}; allowed: {allowed}")
        scale, axes = options.get("scale", self.scale), options.get("axes", self.axes)
        if not (_is_number(scale) and scale > 0.0):
            raise InputError(f"scale of term {self.name} is {scale!r}; allowed: a finite number above 0")
        if not isinstance(axes, str) or not axes or any(a not in "xyz" or axes.count(a) > 1 for a in axes):
            raise InputError(f"axes of term {self.name} are {axes!r}; allowed: some of x, y, z, each once")
        weight = options.get("weight", self.weight)
        if not _is_number(weight):
            raise InputError(f"weight of term {self.name} is {weight!r}; allowed: a finite number")
        success, name = options.get("success", self.success), options.get("name", self.name)
        if not isinstance(success, bool):
            raise InputError(f"success of term {self.name} is {success!r}; allowed: True, False")
        if not isinstance(name, str) or not name:
            raise InputError(f"name of term {self.name} is {name!r}; allowed: a text")
        return replace(self, values={**self.values, **given}, **options)

    def row(self, scene: Scene) -> list[float]:
        """Its parameters as numbers, in the order of the function; prim paths are looked up in a scene.

        Raises:
            InputError: One without a value, of a wrong kind, or a prim that the scene does not have.
        """
        numbers: list[float] = []
        for (name, value), kind in zip(self.values.items(), self.function.kinds, strict=True):
            if value is None:
                raise InputError(f"term {self.name}: parameter {name} has no value; allowed: {self.name}({name}=…)")
            if name in OWNERS and kind is int:
                value = _index(f"{name} of term {self.name}", value, scene, OWNERS[name])
            parts = list(np.ravel(np.asarray(value, dtype=object)))
            good = len(parts) == (3 if kind is wp.vec3 else 1)
            if not good or not all(_is_number(p) for p in parts):
                raise InputError(f"{name} of term {self.name} is {value!r}; allowed: {KINDS[kind]}")
            if kind is int and int(parts[0]) != parts[0]:
                raise InputError(f"{name} of term {self.name} is {value!r}; allowed: {KINDS[kind]}")
            numbers += [float(p) for p in parts]
        return numbers

    def whole(self, scene: Scene) -> tuple[int, ...]:
        """Its whole-numbered parameters, as `row` has them."""
        kinds = [kind for kind in self.function.kinds for _ in range(3 if kind is wp.vec3 else 1)]
        return tuple(int(v) for v, kind in zip(self.row(scene), kinds, strict=True) if kind is int)

    @property
    def told(self) -> str:
        """Its meaning with the values of its parameters: numbers in place of their names, prims after it."""

        def value(named: re.Match[str]) -> str:
            given = self.values.get(named[1])
            return f"{given:g} {named[2] or ''}".rstrip() if _is_number(given) else named[0]

        text = re.sub(r"`(\w+)`(?: \[([^\]]+)\])?", lambda m: value(m), self.meaning)
        prims = {name: v.rsplit("/", 1)[-1] for name, v in self.values.items() if isinstance(v, str)}
        which = ", ".join(f"{name}: {prim}" for name, prim in prims.items() if prim != name)
        return f"{text.rstrip('.')} ({which})." if which else text

    @property
    def components(self) -> tuple[int, ...]:
        """Indices of the components that are observed; () of a number."""
        return tuple("xyz".index(a) for a in self.axes) if self.result == "vector" else ()


def _is_number(value: Any) -> bool:
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return real and math.isfinite(value)


def _index(what: str, value: Any, scene: Scene, owners: str) -> int:
    """Index of a body, trap or obstacle by its prim path, or as it is."""
    names = [getattr(owner, "name", owner.prim) for owner in getattr(scene, owners)]
    if isinstance(value, str):
        if value not in names:
            raise InputError(f"{what} is {value!r}; allowed: {', '.join(names) or f'nothing, there are no {owners}'}")
        return names.index(value)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < len(names):
        raise InputError(f"{what} is {value!r}; allowed: a prim path, or an index from 0 to {len(names) - 1}")
    return value


def term(*, unit: str = "1", scale: float = 1.0) -> Callable[[Callable[..., Any]], Term]:
    """Make a term of a function `(now: otwarp.envs.TaskNow, *parameters)` that returns `wp.vec3`, `float` or `bool`.

    The function is Warp code, compiled with the others of a task. Its parameters are annotated as `float`, `int` or
    `wp.vec3`; those called `body`, `trap`, `obstacle`, … are indices, and may be given as prim paths.

    Args:
        unit: Of its result; 1 for a pure number.
        scale: By what it is divided where it is observed, in that unit.

    Raises:
        InputError: The function is no such function.

    Example:
        >>> import otwarp.envs as envs, warp as wp
        >>> @envs.term(unit="µm", scale=5.0)
        ... def height(now: envs.TaskNow, body: int) -> float:
        ...     return now.state.position[now.world, body][2]
        >>> height(body="/World/bead").scale
        5.0
    """

    def make(function: Callable[..., Any]) -> Term:
        """The term of a function, whose arguments after the first are what is given by name."""
        rest, returned = arguments_of("term", function, TaskNow)
        results = {wp.vec3: "vector", float: "number", bool: "truth"}
        if returned not in results:
            raise InputError(f"term {function.__name__} returns {returned!r}; allowed: wp.vec3, float, bool")
        for p in rest:
            if p.annotation not in KINDS:
                raise InputError(f"term {function.__name__}: argument {p.name} is annotated as {p.annotation!r}; "
                                 "allowed: float, int, wp.vec3")  # fmt: skip
        values = {p.name: None if p.default is inspect.Parameter.empty else p.default for p in rest}
        kinds = tuple(p.annotation for p in rest)
        meaning = inspect.getdoc(function) or function.__name__
        return Term(
            function.__name__, WorldFunction(function, kinds), results[returned], unit, meaning.partition("\n")[0],
            values, scale=scale,
        )  # fmt: skip

    return make


goal_offset = term(unit="µm", scale=10.0)(functions.goal_offset)
body_position = term(unit="µm", scale=20.0)(functions.body_position)
body_offset = term(unit="µm", scale=10.0)(functions.body_offset)
body_velocity = term(unit="µm/s", scale=10.0)(functions.body_velocity)
body_axis = term()(functions.body_axis)
trap_offset = term(unit="µm", scale=1.0)(functions.trap_offset)
trap_position = term(unit="µm", scale=20.0)(functions.trap_position)
trap_spread = term(unit="µm", scale=5.0)(functions.trap_spread)
trap_power = term(unit="mW", scale=10.0)(functions.trap_power)
total_power = term(unit="mW", scale=10.0)(functions.total_power)
mean_power = term(unit="mW", scale=10.0)(functions.mean_power)
obstacle_offset = term(unit="µm", scale=10.0)(functions.obstacle_offset)
obstacle_velocity = term(unit="µm/s", scale=10.0)(functions.obstacle_velocity)
gap = term(unit="µm", scale=5.0)(functions.gap)
contact_load = term(unit="pN", scale=10.0)(functions.contact_load)
time_left = term(unit="s", scale=10.0)(functions.time_left)
progress = term(unit="µm")(functions.progress)
goal_distance = term(unit="µm", scale=10.0)(functions.goal_distance)
lag = term(unit="µm")(functions.lag)
worst_lag = term(unit="µm")(functions.worst_lag)
nearness = term()(functions.nearness)
alignment = term()(functions.alignment)
alignment_gain = term()(functions.alignment_gain)
action_size = term()(functions.action_size)
action_change = term()(functions.action_change)
arrival = term()(functions.arrival)
passing = term(unit="s")(functions.passing)
reached = term()(functions.reached)
strayed = term()(functions.strayed)
collided = term()(functions.collided)
touched = term()(functions.touched)
lost = term()(functions.lost)
escaped = term()(functions.escaped)
left_behind = term()(functions.left_behind)
aligned = term()(functions.aligned)
kept_up = term()(functions.kept_up)
