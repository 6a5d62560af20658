"""What ends the task of a world: predicates that run on the device, shipped ones and the user's."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.kernels.core.functions import arguments_of
from otwarp.kernels.core.types import WorldNow
from otwarp.kernels.drivers import predicates
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.scene.check.numbers import FARTHEST
from otwarp.simulation.packing.arguments import known_names, numbers, several
from otwarp.simulation.packing.parameters import Parameter, check_range, expand

_MOST = float(np.finfo(np.float32).max)

KINDS: dict[type, Parameter] = {
    float: Parameter(low=-_MOST, high=_MOST),
    int: Parameter(low=-1e7, high=1e7, whole=True),
    wp.vec3: Parameter(width=3, low=-_MOST, high=_MOST),
}
"""What the parameters of ends may be: numbers that single precision holds, whole ones exactly."""

BODY = Parameter(low=0.0, whole=True)
"""Index of a body; how many there are is the scene's."""


@dataclass(frozen=True, eq=False)
class End:
    """What ends a world's task, to give to a `Simulation`: what a function decorated by `end` becomes.

    Called with parameters it gives the same end with these values, each one for all worlds, or one per world.

    Attributes:
        name: Of the function.
        predicate: The function, and the types of its parameters.
        values: By name, what was given or is the default; None where somebody must give one.
        ranges: By name, what is allowed, where that is less than `KINDS` of its type.
    """

    name: str
    predicate: WorldFunction = field(repr=False)
    values: Mapping[str, Any]
    ranges: Mapping[str, Parameter] = field(default_factory=dict, repr=False)

    def __call__(self, **values: ArrayLike) -> End:
        """The same end with these parameters.

        Raises:
            InputError: A name that is no parameter of it, or a value out of range.
        """
        allowed = self._allowed()
        known_names(f"end {self.name}", values, allowed)
        for name, value in values.items():
            called = f"{name} of end {self.name}"
            check_range(called, allowed[name], numbers(f"parameter {called}", value))
        return replace(self, values={**self.values, **values})

    def _allowed(self) -> dict[str, Parameter]:
        """By name, what each parameter may be."""
        return {n: self.ranges.get(n, KINDS[kind]) for n, kind in zip(self.values, self.predicate.kinds, strict=True)}

    def rows(self, worlds: int, bodies: int) -> np.ndarray:
        """(1|W, P) its parameters as numbers.

        Raises:
            InputError: One without a value, of a wrong shape, or out of range.
        """
        columns = [np.zeros((1, 0))]
        for name, spec in self._allowed().items():
            value = self.values[name]
            if value is None:
                raise InputError(f"end {self.name}: parameter {name} has no value; allowed: {self.name}({name}=…)")
            spec = replace(spec, high=bodies - 1.0) if spec is BODY else spec
            column = expand(f"{name} of end {self.name}", value, worlds=worlds, traps=0, spec=spec)
            columns.append(column.reshape(len(column), -1))
        rows = max(len(c) for c in columns)
        return np.hstack([np.broadcast_to(c, (rows, c.shape[1])) for c in columns])


def end(function: Callable[..., Any]) -> End:
    """Make an end of a function: a world whose task it says is over stops at the end of a call of `step`.

    The function is Warp code (compiled, for CPU and CUDA, in float32 and float64) with the signature
    `(now: otwarp.WorldNow, *parameters) -> bool`. A parameter is annotated as `float`, `int` or `wp.vec3`; its values
    are finite, whole numbers within ±10⁷.

    Raises:
        InputError: The function is no such function.

    Example:
        >>> import otwarp as ot, warp as wp
        >>> @ot.end
        ... def sunk(now: ot.WorldNow, height: float) -> bool:
        ...     return now.state.position[now.world, 0][2] < height
        >>> sim = ot.Simulation(scene, worlds=1024, ends=[sunk(height=1.5), ot.timed_out(after=2.0)])
    """
    name = function.__name__
    rest, _ = arguments_of("end", function, WorldNow)
    for p in rest:
        if p.annotation not in KINDS:
            raise InputError(f"end {name}: argument {p.name} is annotated as {p.annotation!r}; "
                             "allowed: float, int, wp.vec3")  # fmt: skip
    values = {p.name: None if p.default is inspect.Parameter.empty else p.default for p in rest}
    return End(name, WorldFunction(function, tuple(p.annotation for p in rest)), values)


def check_ends(ends: Any) -> tuple[End, ...]:
    """The ends of a simulation.

    Raises:
        InputError: No list, or one of them is none.
    """
    return several("ends", ends, End, "functions decorated with otwarp.end")


_RADIUS = Parameter(low=0.0, high=FARTHEST, unit="µm")
_PLACE = Parameter(width=3, longest=FARTHEST, unit="µm")

escaped = end(predicates.escaped)
"""Some trap has lost the sphere that it held; `readout.escape_step` says which and when, to a step."""

reached = replace(end(predicates.reached), ranges={"goal": _PLACE, "radius": _RADIUS, "body": BODY})
"""The centre of diffusion of `body` (its index, 0 if not given) is within `radius` of `goal` [µm]."""

strayed = replace(end(predicates.strayed), ranges={"origin": _PLACE, "radius": _RADIUS, "body": BODY})
"""The centre of diffusion of `body` (its index, 0 if not given) is farther than `radius` from `origin` [µm]."""

left_behind = replace(
    end(predicates.left_behind), ranges={"distance": _RADIUS, "cell": BODY, "left": BODY, "right": BODY}
)
"""The centre of body `cell` is farther than `distance` [µm] from the middle of bodies `left` and `right`."""

timed_out = replace(end(predicates.timed_out), ranges={"after": Parameter(low=0.0, high=_MOST, unit="s")})
"""A world has run for `after` seconds since it was started or reset."""
