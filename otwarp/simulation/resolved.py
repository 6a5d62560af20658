"""What follows from a scene and the user's parameters before the time step is known."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.core.features import Features
from otwarp.kernels.forces.force import Load
from otwarp.kernels.optics.traps import AUTHORED
from otwarp.laws.trap_law import FIELDS
from otwarp.scene import Scene
from otwarp.simulation.composition import compose, scene_features
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.packing.forces import ActiveForces
from otwarp.simulation.packing.optics import TrapOptics
from otwarp.simulation.packing.parameters import expand_all, scene_values
from otwarp.simulation.packing.traps import trap_parameters, trap_places, trap_reach
from otwarp.simulation.packing.walls import check_flow
from otwarp.simulation.time_step.edges import Edges, at_edges, close_starts, left_behind, pulls
from otwarp.simulation.time_step.relaxation import Neighbours, TrapRelaxation
from otwarp.simulation.time_step.speeds import authored_powers
from otwarp.simulation.time_step.steady_loads import stated_loads, steady_loads
from otwarp.simulation.user_forces import user_parameters


@dataclass(frozen=True, eq=False, kw_only=True)
class ResolvedScene:
    """A scene with its mobilities, parameters, optics and rates.

    Attributes:
        moves: Mobility of each body.
        features: Terms of the step but for `soft_contacts`, which the time step decides.
        forces: Forces with parameters per body.
        loads: Per body, how strong all forces but traps are.
        edges: Rates where beads leave the traps.
        scene, values, overrides, held, held_range, relaxation, steepest, optics: As in `Model`.
    """

    scene: Scene
    moves: list[BodyMobility]
    values: dict[str, np.ndarray]
    overrides: dict[str, np.ndarray]
    features: Features
    forces: ActiveForces
    loads: list[Load]
    held: tuple[tuple[int, int], ...]
    held_range: np.ndarray
    relaxation: TrapRelaxation
    steepest: TrapRelaxation
    edges: Edges
    optics: TrapOptics

    @classmethod
    def of(
        cls,
        scene: Scene,
        parameters: Mapping[str, ArrayLike],
        device: wp.Device,
        options: StepOptions,
        *,
        worlds: int,
        rows: int,
        part: bool = False,
    ) -> ResolvedScene:
        """Resolve a scene, whose settings are those of the options already; arguments as for `Model.build`.

        `rows` says how many rows parameters have, one for each world or fewer that they share, and `part` whether only
        some of the worlds will be stepped.

        Raises:
            InputError: A parameter that does not apply or is out of range, or features that do not go together.
        """
        moves = mobilities(scene)
        size = {"worlds": rows, "traps": len(scene.traps), "bodies": len(scene.bodies)}
        overrides = expand_all(parameters, **size, more=user_parameters(options.forces))
        forces = ActiveForces.of(scene, options.forces, overrides, rows)
        _check_laws(scene, overrides)
        optics = TrapOptics.of(scene, {**trap_places(scene), **overrides}["trap_position"][0], device)
        scene = optics.resolve(scene)
        values = optics.keep_laws({**_scene_values(scene), **overrides}, _scene_values(scene))
        near = Neighbours.of(scene, values, optics.escape_distance())
        held = near.held(scene)
        features = compose(scene, values, optics, device, forces.body_forces, options, worlds=worlds, part=part)
        check_flow(scene, values)
        loads = steady_loads(scene, moves, values, features, forces, device)
        gap = np.where(near.within, near.gap, 0.0).max(axis=1, initial=0.0)
        gap = np.maximum(gap, left_behind(scene, moves, values, held))
        pull = pulls(scene, moves, values, loads, held)
        edges = at_edges(scene, values, optics, authored_powers(scene, values), gap, pull)
        return cls(
            scene=scene,
            moves=moves,
            values=values,
            overrides=overrides | forces.overrides,
            features=features,
            forces=forces,
            loads=loads,
            held=held,
            held_range=np.minimum(_held_range(scene, values, held), optics.escape_distance()),
            relaxation=TrapRelaxation.of(scene, moves, optics.stiffest(values), near, held, loads),
            steepest=TrapRelaxation.of(scene, moves, optics.steepest(values), near, held, loads),
            edges=Edges(TrapRelaxation.of(scene, moves, edges, near, held, loads), close_starts(values, gap)),
            optics=optics,
        )

    def part(self, rows: slice) -> ResolvedScene:
        """The same for some of the worlds: what they share, steps and terms included, stays as it is for all, and so
        does what the user gave.
        """

        def of(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
            return {name: array if len(array) == 1 else array[rows] for name, array in values.items()}

        forces = dataclasses.replace(self.forces, values=of(self.forces.values))
        held_range = of({"": self.held_range})[""]
        return dataclasses.replace(self, values=of(self.values), held_range=held_range, forces=forces)

    def shared(self, which: np.ndarray) -> ResolvedScene:
        """The same for worlds that share rows, (W) `which` each has: those of forces with parameters for each world.

        All others are gathered on the device, by `packing.arrays.device_rows`.
        """
        rows = {name: array if len(array) == 1 else array[which] for name, array in self.forces.values.items()}
        return dataclasses.replace(self, forces=dataclasses.replace(self.forces, values=rows))

    @property
    def reference(self) -> np.ndarray:
        """(B, 3) reference point of each body in its prim's frame [µm]."""
        return np.array([m.reference for m in self.moves]).reshape(-1, 3)


def resting_loads(scene: Scene) -> list[Load]:
    """Forces on all bodies by all that a scene authors but its traps, without a simulation, as `steady_loads`.

    Mobilities are needed, and torques and rates found, only where a scene has forces with parameters.
    """
    active = ActiveForces.of(scene, (), {}, 1)
    optics = TrapOptics.without_tables(scene)
    scene = optics.resolve(scene)
    values = _scene_values(scene)
    features = dataclasses.replace(scene_features(scene, values, optics), forces=active.body_forces)
    if not active.body_forces:
        return stated_loads(scene, values, features)
    return steady_loads(scene, mobilities(scene), values, features, active, wp.get_device("cpu"))


def _check_laws(scene: Scene, overrides: Mapping[str, np.ndarray]) -> None:
    """Refuse parameters of a force law in a scene where no trap follows one; optical traps keep their own."""
    named = [name for name in overrides if name.removeprefix("trap_").removeprefix("axial_") in FIELDS]
    if named and scene.traps and all(trap.optical for trap in scene.traps):
        trap = scene.traps[0]
        raise InputError(
            f"parameter {named[0]} does not apply to trap {trap.prim}, whose ot:trap:model is {trap.model}; "
            f"allowed: traps with model {' or '.join(AUTHORED)}"
        )


def _scene_values(scene: Scene) -> dict[str, np.ndarray]:
    """All parameters as the scene authors them, one row."""
    return {**scene_values(scene), **trap_parameters(scene)}


def _held_range(scene: Scene, values: Mapping[str, np.ndarray], held: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(1|W, T) distance at which the held sphere has escaped [µm], inf where a trap holds none."""
    radii = np.array([scene.bodies[b].spheres[i].radius if b >= 0 else 1.0 for b, i in held])
    return np.where([b >= 0 for b, _ in held], trap_reach(scene, values, radii), np.inf)
