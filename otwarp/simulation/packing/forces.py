"""Forces of a simulation, the scene's own and the user's: what they are, their numbers, and both on the device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.core.types import ForceData
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Scene
from otwarp.simulation.packing.arguments import numbers
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.parameters import Parameter, expand, scene_values

if TYPE_CHECKING:
    from otwarp.simulation.user_forces import Force


@dataclass(frozen=True, eq=False)
class ActiveForces:
    """The forces with parameters per body that a simulation has, and their numbers.

    Attributes:
        body_forces: The scene's own, then the user's.
        values: Per parameter, by its full name, (1|W, B) or (1|W, B, 3) in its unit.
        acts: (F, B) whether a force acts on a body.
        overrides: Those of `values` that the user gave.
    """

    body_forces: tuple[BodyForce, ...]
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
            InputError: Two of one name, a prim that is no body, or a parameter without a value.
        """
        body_forces, acts, values = [], [], {}
        authored = scene_values(scene)
        for row in FORCES.values():
            if row.parametric is None:
                continue
            names = {p.name: row.parametric.full_name(p.name) for p in row.parametric.parameters}
            acting = np.array([any(n in b.forces for n in names.values()) for b in scene.bodies], dtype=bool)
            if any(n in given for n in names.values()):
                acting[:] = True
            if acting.any():
                body_forces.append(row.parametric)
                acts.append(acting)
                values |= {name: given.get(name, authored[name]) for name in names.values()}
        overrides: dict[str, np.ndarray] = {}
        for item in forces:
            if item.body_force.name in [body_force.name for body_force in body_forces]:
                raise InputError(f"forces has {item.body_force.name} twice; allowed: one force of a name")
            body_forces.append(item.body_force)
            found, acting = _values(scene, item, given, worlds)
            acts.append(acting)
            values |= found
            overrides |= found
        return cls(
            tuple(body_forces),
            values,
            np.array(acts, dtype=bool).reshape(len(body_forces), len(scene.bodies)),
            overrides,
        )

    def parameters_of(self, index: int) -> dict[str, np.ndarray]:
        """Parameters of one force by their own names, (1|W, B) or (1|W, B, 3)."""
        body_force = self.body_forces[index]
        return {p.name: self.values[body_force.full_name(p.name)] for p in body_force.parameters}


def _values(
    scene: Scene, item: Force, overrides: Mapping[str, np.ndarray], worlds: int
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Expanded parameters of a user's force by full name, and (B,) the bodies it acts on."""
    body_force, bodies = item.body_force, len(scene.bodies)
    places = _places(scene)
    named: set[int] | None = None if item.bodies is None else {b for name in item.bodies for b in places.get(name, ())}
    values = {}
    for p in body_force.parameters:
        given = item.values.get(p.name, p.default)
        where = f"force {body_force.name}: parameter {p.name}"
        if given is None and body_force.full_name(p.name) in overrides:
            given = 0.0
        if given is None:
            raise InputError(f"{where} has no value; allowed: {body_force.name}({p.name}=…) [{p.unit}]")
        if isinstance(given, Mapping):
            unknown = [prim for prim in given if prim not in places]
            if unknown:
                known = ", ".join(list(places)[:8]) + (" …" if len(places) > 8 else "")
                raise InputError(f"{where} has a value for {unknown[0]}; allowed: bodies, {known}")
            rows = np.zeros((bodies, 3) if p.width == 3 else bodies)
            # what an instance is given for itself goes before what its prim is given for all
            for prim, value in sorted(given.items(), key=lambda item: -len(places[item[0]])):
                row = numbers(f"{where} of {prim}", value)
                if row.shape != rows.shape[1:]:
                    raise InputError(f"{where} of {prim} is {value!r}; allowed: {p.width} number{'s' * (p.width > 1)}")
                rows[list(places[prim])] = row
            chosen = {b for prim in given for b in places[prim]}
            named = chosen if named is None else named | chosen
            given = rows
        spec = Parameter("bodies", width=p.width, unit=p.unit)
        name = body_force.full_name(p.name)
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
    if not active.body_forces:
        return wp.empty(0, dtype=kind, device=device.device), []
    values, layout, first = [np.zeros(0)], [], 0
    for index, body_force in enumerate(active.body_forces):
        for p in body_force.parameters:
            array = active.parameters_of(index)[p.name]
            values.append(array.ravel())
            layout += [first, len(array)]
            first += array.size
    data = kind()
    data.value = device_array(np.concatenate(values), wp.float32, device)
    data.layout = device_array([*layout, *active.acts.ravel().astype(int)], wp.int32, device)
    starts, spheres = [], [np.zeros((0, 4))]
    if any(body_force.acts_on == "spheres" for body_force in active.body_forces):
        starts = [0]
        for body, move in zip(scene.bodies, moves, strict=True):
            spheres.append(np.array([[*(np.array(s.offset) - move.reference), s.radius] for s in body.spheres]))
            starts.append(starts[-1] + len(body.spheres))
    data.sphere_start = device_array(starts, wp.int32, device)
    data.sphere = device_array(np.concatenate(spheres), wp.vec4, device)
    return wp.array([data], dtype=kind, device=device.device), [data]
