"""What ends the task of a world: predicates that run on the device, shipped ones and the user's."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.kernels.core.types import WorldNow
from otwarp.kernels.drivers import predicates
from otwarp.kernels.drivers.episodes import EndLaw
from otwarp.simulation.packing.parameters import Parameter, expand

_KINDS = (float, int, wp.vec3)


@dataclass(frozen=True, eq=False)
class End:
    """What ends a world's task, to give to a `Simulation`: what a function decorated by `end` becomes.

    Called with parameters it gives the same end with these values, each one for all worlds, or one per world.

    Attributes:
        name: Of the function.
        law: The function, and the types of its parameters.
        values: By name, what was given or is the default; None where somebody must give one.
    """

    name: str
    law: EndLaw
    values: Mapping[str, Any]

    def __call__(self, **values: ArrayLike) -> End:
        """The same end with these parameters.

        Raises:
            InputError: A name that is no parameter of it.
        """
        for name in values:
            if name not in self.values:
                allowed = ", ".join(self.values) or "none, it has no parameters"
                raise InputError(f"end {self.name}: parameter {name!r} is unknown; allowed: {allowed}")
        return End(self.name, self.law, {**self.values, **values})

    def rows(self, worlds: int) -> np.ndarray:
        """(1|W, P) its parameters as numbers.

        Raises:
            InputError: One without a value, of a wrong shape, or not finite.
        """
        columns = [np.zeros((1, 0))]
        for (name, value), kind in zip(self.values.items(), self.law.kinds, strict=True):
            if value is None:
                raise InputError(f"end {self.name}: parameter {name} has no value; allowed: {self.name}({name}=…)")
            spec = Parameter(width=3 if kind is wp.vec3 else 1)
            column = expand(f"{name} of end {self.name}", value, worlds=worlds, traps=0, spec=spec)
            columns.append(column.reshape(len(column), -1))
        rows = max(len(c) for c in columns)
        return np.hstack([np.broadcast_to(c, (rows, c.shape[1])) for c in columns])


def end(function: Callable[..., Any]) -> End:
    """Make an end of a function: a world whose task it says is over stops at the end of a call of `step`.

    The function is Warp code (compiled, for CPU and CUDA, in float32 and float64) with the signature
    `(now: otwarp.WorldNow, *parameters) -> bool`. A parameter is annotated as `float`, `int` or `wp.vec3`.

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
    try:
        signature = inspect.signature(function, eval_str=True, locals=dict(inspect.getclosurevars(function).nonlocals))
    except (NameError, TypeError) as error:
        raise InputError(f"end {name}: its annotations cannot be read ({error})") from error
    first, *rest = signature.parameters.values() or (None,)
    if first is None or first.annotation is not WorldNow:
        raise InputError(f"end {name}: its first argument must be annotated as otwarp.WorldNow")
    for p in rest:
        if p.annotation not in _KINDS:
            raise InputError(f"end {name}: argument {p.name} is annotated as {p.annotation!r}; "
                             "allowed: float, int, wp.vec3")  # fmt: skip
    values = {p.name: None if p.default is inspect.Parameter.empty else p.default for p in rest}
    return End(name, EndLaw(function, tuple(p.annotation for p in rest)), values)


def check_ends(ends: Sequence[End]) -> tuple[End, ...]:
    """The ends of a simulation.

    Raises:
        InputError: One of them is none.
    """
    for item in ends:
        if not isinstance(item, End):
            raise InputError(f"ends has {item!r}; allowed: functions decorated with otwarp.end")
    return tuple(ends)


escaped = end(predicates.escaped)
"""Some trap has lost the sphere that it held; `readout.escape_step` says which and when, to a step."""

reached = end(predicates.reached)
"""The centre of diffusion of `body` (its index, 0 if not given) is within `radius` of `goal` [µm]."""

strayed = end(predicates.strayed)
"""The centre of diffusion of `body` (its index, 0 if not given) is farther than `radius` from `origin` [µm]."""

timed_out = end(predicates.timed_out)
"""A world has run for `after` seconds since it was started or reset."""
