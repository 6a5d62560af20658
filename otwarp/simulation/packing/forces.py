"""Forces of a simulation: those that users write, those that a scene authors, and their numbers on the device."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.body_forces.body_force import BodyForce, Bound
from otwarp.kernels.core.types import ForceData
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.parameters import PARAMETERS, Parameter, expand, scene_values


@dataclass(frozen=True, eq=False)
class Force:
    """A force to give to a `Simulation`: what a function decorated by `force` becomes.

    Called with parameters it gives the same force with these values; each is one number (or vector) for all bodies, a
    mapping from prims of bodies to such, or an array `(1|W, B)` or `(1|W, B, 3)`. With a mapping the force acts on the
    bodies that are named alone; `/World/Cells` names all instances of a prim, `/World/Cells[2]` one, which goes first.

    Attributes:
        law: What it is.
        values: Parameters that were given so far.
        bodies: Names of the bodies it acts on, None for those that its values name, or all.
    """

    law: BodyForce
    values: Mapping[str, Any]
    bodies: tuple[str, ...] | None = None

    def __call__(self, **values: ArrayLike | Mapping[str, ArrayLike]) -> Force:
        """The same force with these parameters.

        Raises:
            InputError: A name that is no parameter of it.
        """
        names = [p.name for p in self.law.parameters]
        for name in values:
            if name not in names:
                allowed = ", ".join(names) or "none, it has no parameters"
                raise InputError(f"force {self.law.name}: parameter {name!r} is unknown; allowed: {allowed}")
        return Force(self.law, {**self.values, **values}, self.bodies)


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


@dataclass(frozen=True, eq=False)
class ActiveForces:
    """The forces with parameters per body that a simulation has, and their numbers.

    Attributes:
        laws: The scene's own, then the user's.
        values: Per parameter, by its full name, (1|W, B) or (1|W, B, 3) in its unit.
        acts: (F, B) whether a force acts on a body.
        overrides: Those of `values` that the user gave.
    """

    laws: tuple[BodyForce, ...]
    values: dict[str, np.ndarray]
    acts: np.ndarray
    overrides: dict[str, np.ndarray]

    @classmethod
    def of(cls, scene: Scene, forces: Sequence[Force], given: Mapping[str, np.ndarray], worlds: int) -> ActiveForces:
        """Gather the forces of a scene, then the user's, with a value of every parameter for every body.

        Args:
            forces: The user's.
            given: Parameters that the user gave to the simulation, expanded, by name; they go before all others.
            worlds: Independent copies of the scene.

        Raises:
            InputError: Not a force, two of one name, a prim that is no body, or a parameter without a value.
        """
        laws, acts, values = [], [], {}
        authored = scene_values(scene)
        for row in FORCES.values():
            if row.parametric is None:
                continue
            names = {p.name: row.parametric.full_name(p.name) for p in row.parametric.parameters}
            acting = np.array([any(n in b.forces for n in names.values()) for b in scene.bodies], dtype=bool)
            if any(n in given for n in names.values()):
                acting[:] = True
            if acting.any():
                laws.append(row.parametric)
                acts.append(acting)
                values |= {name: given.get(name, authored[name]) for name in names.values()}
        overrides: dict[str, np.ndarray] = {}
        for item in forces:
            if not isinstance(item, Force):
                raise InputError(f"forces has {item!r}; allowed: functions decorated with otwarp.force")
            if item.law.name in [law.name for law in laws]:
                raise InputError(f"forces has {item.law.name} twice; allowed: one force of a name")
            laws.append(item.law)
            found, acting = _values(scene, item, given, worlds)
            acts.append(acting)
            values |= found
            overrides |= found
        return cls(tuple(laws), values, np.array(acts, dtype=bool).reshape(len(laws), len(scene.bodies)), overrides)

    def of_law(self, index: int) -> dict[str, np.ndarray]:
        """Parameters of one force by their own names, (1|W, B) or (1|W, B, 3)."""
        law = self.laws[index]
        return {p.name: self.values[law.full_name(p.name)] for p in law.parameters}


def user_parameters(forces: Sequence[Force]) -> dict[str, Parameter]:
    """What `Simulation(parameters=...)` accepts for the user's forces, by full name.

    Raises:
        InputError: Two parameters would have one name, or one that the scene's vocabulary has.
    """
    known: dict[str, Parameter] = {}
    laws = {f.law.name: f.law for f in forces if isinstance(f, Force)}
    for law in laws.values():
        for p in law.parameters:
            name = law.full_name(p.name)
            if name in PARAMETERS or name in known:
                raise InputError(
                    f"force {law.name}: parameter {p.name} would be called {name}, as another parameter is; "
                    "allowed: another name of the function or of its argument"
                )
            known[name] = Parameter("bodies", width=p.width, unit=p.unit)
    return known


def _values(
    scene: Scene, item: Force, overrides: Mapping[str, np.ndarray], worlds: int
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Expanded parameters of a user's force by full name, and (B,) the bodies it acts on."""
    law, bodies = item.law, len(scene.bodies)
    places = _places(scene)
    named: set[int] | None = None if item.bodies is None else {b for name in item.bodies for b in places.get(name, ())}
    values = {}
    for p in law.parameters:
        given = item.values.get(p.name, p.default)
        where = f"force {law.name}: parameter {p.name}"
        if given is None and law.full_name(p.name) in overrides:
            given = 0.0
        if given is None:
            raise InputError(f"{where} has no value; allowed: {law.name}({p.name}=…) [{p.unit}]")
        if isinstance(given, Mapping):
            unknown = [prim for prim in given if prim not in places]
            if unknown:
                known = ", ".join(list(places)[:8]) + (" …" if len(places) > 8 else "")
                raise InputError(f"{where} has a value for {unknown[0]}; allowed: bodies, {known}")
            rows = np.zeros((bodies, 3) if p.width == 3 else bodies)
            # what an instance is given for itself goes before what its prim is given for all
            for prim, value in sorted(given.items(), key=lambda item: -len(places[item[0]])):
                numbers = np.asarray(value, dtype=float)
                if numbers.shape != rows.shape[1:]:
                    raise InputError(f"{where} of {prim} is {value!r}; allowed: {p.width} number{'s' * (p.width > 1)}")
                rows[list(places[prim])] = numbers
            chosen = {b for prim in given for b in places[prim]}
            named = chosen if named is None else named | chosen
            given = rows
        spec = Parameter("bodies", width=p.width, unit=p.unit)
        name = law.full_name(p.name)
        if name in overrides:
            values[name] = overrides[name]
        else:
            values[name] = expand(name, given, worlds=worlds, traps=0, bodies=bodies, spec=spec)
    acting = np.array([named is None or b in named for b in range(bodies)], dtype=bool)
    return values, acting


def _places(scene: Scene) -> dict[str, tuple[int, ...]]:
    """Indices of the bodies by prim, and by name where instances share one."""
    places: dict[str, tuple[int, ...]] = {}
    for b, body in enumerate(scene.bodies):
        for name in {body.prim, body.name}:
            places[name] = (*places.get(name, ()), b)
    return places


def pack_forces(
    scene: Scene, moves: list[BodyMobility], active: ActiveForces, device: Place
) -> tuple[wp.array, list[Any]]:
    """The kernels' view: parameters, where they lie, who is acted on, and the spheres if some force needs them.

    Returns:
        `ModelData.forces`, and what it refers to by address, to be kept alive; both empty without such forces.
    """
    kind = device.typed(ForceData)
    if not active.laws:
        return wp.empty(0, dtype=kind, device=device.device), []
    values, layout, first = [np.zeros(0)], [], 0
    for index, law in enumerate(active.laws):
        for p in law.parameters:
            array = active.of_law(index)[p.name]
            values.append(array.ravel())
            layout += [first, len(array)]
            first += array.size
    data = kind()
    data.value = device_array(np.concatenate(values), wp.float32, device)
    data.layout = device_array([*layout, *active.acts.ravel().astype(int)], wp.int32, device)
    starts, spheres = [], [np.zeros((0, 4))]
    if any(law.acts_on == "spheres" for law in active.laws):
        starts = [0]
        for body, move in zip(scene.bodies, moves, strict=True):
            spheres.append(np.array([[*(np.array(s.offset) - move.reference), s.radius] for s in body.spheres]))
            starts.append(starts[-1] + len(body.spheres))
    data.sphere_start = device_array(starts, wp.int32, device)
    data.sphere = device_array(np.concatenate(spheres), wp.vec4, device)
    return wp.array([data], dtype=kind, device=device.device), [data]
