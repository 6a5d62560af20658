"""A force that is a function of a body, its place and some parameters: what it is, and its function for Warp."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.functions import arguments_of, compiled, digest_of
from otwarp.kernels.core.types import ForceInput, Wrench

Bound = float | Callable[..., Any]
"""A number, or a NumPy function of the parameters by name that gives one per body."""

OPTIONS = ("acts_on", "slope", "load")
"""What `BodyForce.of` is asked besides units, so that no parameter may have these names."""

_WIDTHS = {float: 1, wp.float32: 1, wp.vec3: 3}


@dataclass(frozen=True)
class ForceParameter:
    """A parameter of a force, with one value per body.

    Attributes:
        name: As the function calls it.
        unit: What it is measured in, for messages and files; "1" for a pure number.
        width: Numbers in one value: 1, or 3 for a vector.
        default: Value where nobody gives one, or None if somebody must.
    """

    name: str
    unit: str
    width: int = 1
    default: float | tuple[float, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class BodyForce:
    """A force with parameters per body; two of the same name and digest are the same.

    Attributes:
        name: As `otwarp info` and the parameters of `Simulation` call it.
        parameters: In the order of the function's arguments.
        acts_on: `body`, once per body, at its centre of diffusion; `spheres`, at the centre of each of its spheres.
        turns: Whether the function returns a `Wrench`, a force and a torque, instead of a force.
        digest: SHA-256 of its source, of the functions and constants it uses, and of all above.
        function: `(ForceInput, *parameters) -> vec3 [pN] or Wrench [pN, pN·µm]`, as written.
        slope: Bound of how fast the force changes with place [pN/µm], or None: measured.
        load: Bound of the force [pN], or None: measured.
    """

    name: str
    parameters: tuple[ForceParameter, ...]
    acts_on: Literal["body", "spheres"]
    turns: bool
    digest: str
    function: Callable[..., Any] = field(compare=False, repr=False)
    slope: Bound | None = field(default=None, compare=False)
    load: Bound | None = field(default=None, compare=False)

    @classmethod
    def of(
        cls,
        function: Callable[..., Any],
        units: dict[str, str],
        *,
        acts_on: str = "body",
        slope: Bound | None = None,
        load: Bound | None = None,
    ) -> BodyForce:
        """Read the parameters of a force off the signature of its function.

        Raises:
            InputError: The function is no force: its arguments, their types or their units are not as they must be.
        """
        name = function.__name__
        if acts_on not in ("body", "spheres"):
            raise InputError(f"force {name}: acts_on is {acts_on!r}; allowed: body, spheres")
        arguments, returned = arguments_of("force", function, ForceInput)
        parameters = tuple(_parameter(name, argument, units) for argument in arguments)
        unknown = sorted(set(units) - {p.name for p in parameters})
        if unknown:
            known = ", ".join(p.name for p in parameters) or "none, it has no parameters"
            raise InputError(f"force {name}: unit of {unknown[0]!r}, which is no argument of it; allowed: {known}")
        turns = returned is Wrench
        return cls(
            name=name,
            parameters=parameters,
            acts_on=acts_on,
            turns=turns,
            digest=digest_of(function, name, parameters, acts_on, turns),
            function=function,
            slope=slope,
            load=load,
        )

    def full_name(self, parameter: str) -> str:
        """Name of one of its parameters among those of `Simulation`."""
        return f"{self.name}_{parameter}"

    def compiled(self, precision: str) -> wp.Function:
        """The function in a precision, as Warp's.

        Raises:
            InputError: Warp cannot compile it, or it returns something else than its annotation says.
        """
        kind = Wrench if self.turns else wp.vec3
        allowed = "otwarp.Wrench" if self.turns else "wp.vec3, or otwarp.Wrench where it is annotated -> otwarp.Wrench"
        return compiled(self.function, precision, "force", (kind,), allowed)


def _parameter(force: str, argument: inspect.Parameter, units: dict[str, str]) -> ForceParameter:
    """One argument of a force's function.

    Raises:
        InputError: Its name, type, unit or default is none that a parameter may have.
    """
    where = f"force {force}: argument {argument.name}"
    if argument.kind is not inspect.Parameter.POSITIONAL_OR_KEYWORD or argument.name in OPTIONS:
        raise InputError(f"{where} must be an ordinary one, called neither {', '.join(OPTIONS[:-1])} nor {OPTIONS[-1]}")
    if argument.annotation not in _WIDTHS:
        raise InputError(f"{where} is annotated as {argument.annotation!r}; allowed: float, wp.vec3")
    if not isinstance(units.get(argument.name), str):
        raise InputError(f"{where} has no unit; allowed: {argument.name}='…' in the decorator, '1' for a pure number")
    width, default = _WIDTHS[argument.annotation], argument.default
    if default is inspect.Parameter.empty:
        return ForceParameter(argument.name, units[argument.name], width)
    numbers = np.asarray(default, dtype=float)
    if numbers.size != width or not np.all(np.isfinite(numbers)):
        raise InputError(f"{where} has the default {default!r}; allowed: {width} finite number{'s' * (width > 1)}")
    value = float(numbers) if width == 1 else tuple(float(n) for n in numbers)
    return ForceParameter(argument.name, units[argument.name], width, value)
