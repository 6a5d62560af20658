"""Forces that users write: a function becomes one, is given parameters, and goes to a `Simulation`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.kernels.body_forces.body_force import BodyForce, Bound
from otwarp.simulation.packing.arguments import known_names, several
from otwarp.simulation.packing.parameters import PARAMETERS, Parameter


@dataclass(frozen=True, eq=False)
class Force:
    """A force to give to a `Simulation`: what a function decorated by `force` becomes.

    Called with parameters it gives the same force with these values; each is one number (or vector) for all bodies, a
    mapping from prims of bodies to such, or an array `(1|W, B)` or `(1|W, B, 3)`. With a mapping the force acts on the
    bodies that are named alone; `/World/Cells` names all instances of a prim, `/World/Cells[2]` one, which goes first.

    Attributes:
        body_force: The function, its parameters with their units, and its bounds.
        values: Parameters that were given so far.
        bodies: Names of the bodies it acts on, None for those that its values name, or all.
    """

    body_force: BodyForce
    values: Mapping[str, Any]
    bodies: tuple[str, ...] | None = None

    def __call__(self, **values: ArrayLike | Mapping[str, ArrayLike]) -> Force:
        """The same force with these parameters.

        Raises:
            InputError: A name that is no parameter of it.
        """
        known_names(f"force {self.body_force.name}", values, [p.name for p in self.body_force.parameters])
        return Force(self.body_force, {**self.values, **values}, self.bodies)


def force(*, acts_on: str = "body", slope: Bound | None = None, load: Bound | None = None, **units: str) -> Any:
    """Make a force of a function, to be summed in every step: `Simulation(scene, forces=[...])`.

    The function is Warp code (compiled, for CPU and CUDA, in float32 and float64) with the signature
    `(body: otwarp.ForceInput, *parameters) -> wp.vec3`, the force in pN in world axes, or `-> otwarp.Wrench`, a force
    and a torque. A parameter is annotated as `float` or `wp.vec3` and has one value per body, or per world and body:
    `Simulation(parameters={"<function>_<parameter>": ...})`.

    Args:
        acts_on: `body`: at each body's centre of diffusion; `spheres`: at the centre of each sphere, so that it turns
            rigid bodies, too.
        slope: Bound of how fast the force changes with place, as the norm of its gradient [pN/µm]: a number, or a NumPy
            function of the parameters by name. It limits the time step. None: measured where bodies start and traps go
            (at fewer places where bodies are many), at 24 moments.
        load: Bound of the force [pN], likewise. Torques of a `Wrench` are always measured.
        units: Unit of each parameter by its name, "1" for a pure number.

    Raises:
        InputError: The function is no such function.

    Example:
        >>> import otwarp as ot, warp as wp
        >>> @ot.force(strength="pN")
        ... def push(body: ot.ForceInput, strength: float):
        ...     return wp.vec3(strength, 0.0, 0.0)
        >>> sim = ot.Simulation(scene, forces=[push(strength={"/World/bead": 3.0})])
    """

    def made(function: Callable[..., Any]) -> Force:
        plain = function.func if isinstance(function, wp.Function) and function.func else function
        return Force(BodyForce.of(plain, units, acts_on=acts_on, slope=slope, load=load), {})

    return made


def check_forces(forces: Any) -> tuple[Force, ...]:
    """The forces that a user gives to a simulation.

    Raises:
        InputError: No list, or one of them is none.
    """
    return several("forces", forces, Force, "functions decorated with otwarp.force")


def user_parameters(forces: Sequence[Force]) -> dict[str, Parameter]:
    """What `Simulation(parameters=...)` accepts for the user's forces, by full name.

    Raises:
        InputError: Not a force, or two parameters would have one name, or one that the scene's vocabulary has.
    """
    check_forces(forces)
    known: dict[str, Parameter] = {}
    for body_force in {f.body_force.name: f.body_force for f in forces}.values():
        for p in body_force.parameters:
            name = body_force.full_name(p.name)
            if name in PARAMETERS or name in known:
                raise InputError(
                    f"force {body_force.name}: parameter {p.name} would be called {name}, as another parameter is; "
                    "allowed: another name of the function or of its argument"
                )
            known[name] = Parameter("bodies", width=p.width, unit=p.unit)
    return known
