"""The model: constants of a scene on a device, its feature set, and its time step."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.device import pick_device
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.forces.force import Load
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Scene
from otwarp.scene.period import in_cell
from otwarp.scene.plausibility import judge
from otwarp.scene.plausibility.ranges import unusual_parameters
from otwarp.simulation.body_space import body_space
from otwarp.simulation.composition import check_settings, fits_a_block
from otwarp.simulation.drivers.world_scratch import keeps_contacts, largest_launch, many_in_phases, team_for
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.arguments import whole
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.bodies import is_rigid, pack_bodies, pack_contact, pack_obstacles
from otwarp.simulation.packing.capacity import check_worlds
from otwarp.simulation.packing.commands import Samples, staged_commands
from otwarp.simulation.packing.coupling import pack_coupling
from otwarp.simulation.packing.flow import pack_flow
from otwarp.simulation.packing.forces import ActiveForces, pack_forces
from otwarp.simulation.packing.inlets import pack_inlets
from otwarp.simulation.packing.optics import TrapOptics, exact_room
from otwarp.simulation.packing.parameters import SharedRows
from otwarp.simulation.packing.period import pack_period
from otwarp.simulation.packing.traps import HeldSphere, pack_medium, pack_traps, rotate
from otwarp.simulation.packing.walls import hydrodynamic_walls, pack_walls
from otwarp.simulation.packing.worlds import pack_worlds
from otwarp.simulation.resolved import ResolvedScene
from otwarp.simulation.time_step.observables import ExplicitStep
from otwarp.simulation.time_step.relaxation import TrapRelaxation, mean_point_mobility
from otwarp.simulation.time_step.softness import soft_contacts, takes_turns
from otwarp.simulation.time_step.timescales import TimeScales, time_scales, warn_of_lost_motion


@dataclass(frozen=True, eq=False, kw_only=True)
class Model:
    """Constants of a scene on a device. Made by `Model.build`; nothing in it changes during a run.

    Attributes:
        scene: What it was built from, with the laws that follow from optics filled in.
        authored: The scene as it was given.
        worlds: Number of worlds W in this part.
        first_world: Number of the first of them among all worlds.
        all_worlds: Number of worlds in all parts.
        seed: Key of the random streams.
        device: Where the arrays live.
        features: Terms the step is made of.
        values: Parameters in force, `(1|W, …)` float64, by the names of `parameters.PARAMETERS`; `(1|R, …)` where
            worlds share rows.
        overrides: Those of them that the user gave, for all worlds.
        which: (W) int32 row of `values` that each world has where they share rows, on the device, else None.
        reference: (B, 3) reference point (centre of diffusion) of each body in its prim's frame [µm].
        held: Per trap the body index of the sphere it holds (-1: none) and that sphere's index in the body. A trap that
            names no sphere holds the nearest at the start, of all worlds, if that is within its reach.
        held_range: (1|W, T) distance at which that sphere has escaped [µm], inf for none.
        relaxation: Relaxation rates near the equilibria of the traps, by power; accuracy follows from them.
        steepest: Rates where the forces are steepest; stability follows from them.
        optics: Force tables of the beams and spheres.
        forces: Forces with parameters per body.
        loads: Per body, how strong all forces but traps are.
        scales: Time scales and the time step.
        data: The kernels' view.
        meshes: Obstacle meshes, kept alive for the kernels.
        force_data: `ForceData` of the forces with parameters, likewise; at most one.
        episode_data: `WorldsData`, likewise, where worlds have clocks of their own.
        inlet_data: `InletData`, likewise, where cells come in again.
        exact_room: Of a GPU's threads for exact forces, likewise.
    """

    scene: Scene
    authored: Scene
    worlds: int
    first_world: int
    all_worlds: int
    seed: int
    device: wp.Device
    features: Features
    values: dict[str, np.ndarray]
    overrides: dict[str, np.ndarray]
    which: wp.array | None
    reference: np.ndarray
    held: tuple[tuple[int, int], ...]
    held_range: np.ndarray
    relaxation: TrapRelaxation
    steepest: TrapRelaxation
    optics: TrapOptics
    forces: ActiveForces
    loads: list[Load]
    scales: TimeScales
    data: Annotated[Any, ModelData]
    meshes: list[wp.Mesh]
    force_data: list[Any]
    episode_data: list[Any]
    inlet_data: list[Any]
    exact_room: wp.array

    @property
    def time_step(self) -> float:
        """Time step [s]."""
        return self.scales.time_step

    @classmethod
    def build(
        cls,
        scene: Scene,
        *,
        worlds: int = 1,
        seed: int = 0,
        device: str | wp.Device | None = None,
        parameters: Mapping[str, ArrayLike] | SharedRows | None = None,
        options: StepOptions | None = None,
        part: tuple[int, int] | None = None,
    ) -> Model:
        """Pack a scene for a device.

        Args:
            worlds: Independent copies of the scene, at least 1.
            seed: 0 … 2³² − 1.
            device: `"cpu"`, `"cuda:0"` or None for the best available.
            parameters: Values that differ from the scene's or from world to world; see `parameters.PARAMETERS`. Many
                worlds that have the same: `SharedRows`.
            options: What is chosen about the step; None: as the scene says.
            part: First of the worlds that this model holds, and the one after its last; None: all of them.

        Raises:
            InputError: Anything out of range or of another type, in the arguments and in the scene (`Scene.check`).
        """
        options = options or StepOptions()
        asked = _asked(scene, options)
        worlds, seed = whole("worlds", worlds, 1), whole("seed", seed, 0, 2**32 - 1)
        _warn_of_oddities(scene, () if scene.judged else (f"{f.prim}: {f.message}" for f in judge(scene)))
        rows = _rows(part, worlds)
        place = pick_device(device)
        check_worlds(asked, rows.stop - rows.start, place, options.precision)
        shared = parameters if isinstance(parameters, SharedRows) else SharedRows.own(parameters, worlds)
        shared.check(worlds)
        size = {"worlds": worlds, "rows": shared.rows}
        known = ResolvedScene.of(asked, shared.values, place, options, **size, part=part is not None)
        _warn_of_oddities(scene, unusual_parameters(known.overrides))
        own = options.time_step is None and scene.file is not None
        scales = _time_scales(known, from_scene=own, allow_large=options.allow_large_step)
        staged = staged_commands(known.scene, scales.time_step, INTEGRATORS[known.features.integrator])
        features = dataclasses.replace(
            _stepped_features(known, scales.time_step, place, worlds=worlds), leaps=staged is not None
        )
        which = None if shared.which is None else shared.which[rows]
        packed = Place(place, options.precision, None if which is None else device_array(which, wp.int32, place))
        known = dataclasses.replace(known.part(rows) if which is None else known.shared(which), features=features)
        count = rows.stop - rows.start
        room = exact_room(known.optics, largest_launch(features, count, place), place)
        data, kept = _pack(known, scales.time_step, seed, rows, staged, room, packed)
        resolved: dict[str, Any] = {
            f.name: getattr(known, f.name) for f in dataclasses.fields(cls) if hasattr(known, f.name)
        }
        return cls(
            **resolved,
            authored=scene,
            worlds=count,
            first_world=rows.start,
            all_worlds=worlds,
            seed=seed,
            device=place,
            scales=scales,
            which=packed.which,
            data=data,
            **kept,
            exact_room=room,
        )

    def rows(self, values: np.ndarray) -> np.ndarray:
        """The rows of this part in a `(1|W, …)` array of all worlds."""
        return values if len(values) == 1 else values[self.first_world : self.first_world + self.worlds]

    @property
    def place(self) -> Place:
        """Device and precision of the arrays."""
        return Place(self.device, self.features.precision, self.which)

    def start_position(self) -> np.ndarray:
        """(B, 3) reference points of the bodies at the start [µm]."""
        place = np.array([b.position for b in self.scene.bodies]).reshape(-1, 3)
        return place + rotate(self.start_orientation(), self.reference)

    def start_orientation(self) -> np.ndarray:
        """(B, 4) orientations of the bodies at the start."""
        return np.array([b.orientation for b in self.scene.bodies]).reshape(-1, 4)

    def in_cell(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., B, 3) points put into the cell that repeats [µm], and (..., B, 3) how many periods each was away."""
        settings = self.scene.settings
        return in_cell(place, settings.period, settings.period_center)

    def prim_position(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """(..., B, 3) origins of the bodies' prims from reference points and orientations [µm]."""
        return position - rotate(orientation, self.reference)


def _rows(part: tuple[int, int] | None, worlds: int) -> slice:
    """The worlds of a part.

    Raises:
        InputError: It is no pair of numbers, empty, or not within all worlds.
    """
    if part is None:
        return slice(0, worlds)
    try:
        first, stop = (whole("part", n, 0, worlds) for n in part)
    except (TypeError, ValueError):  # no pair, or not of such numbers
        first = stop = 0
    if first >= stop:
        raise InputError(f"part is {part!r}; allowed: two whole numbers from 0 to {worlds}, the first of them smaller")
    return slice(first, stop)


def _asked(scene: Scene, options: StepOptions) -> Scene:
    """The scene with the settings of the options.

    Raises:
        InputError: No model can be built from it: what the reader refuses in files, or no body.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene is {scene!r}; allowed: a Scene, such as Scene.load reads from a file")
    asked = options.of(scene)
    check_settings(asked)
    scene.check()
    if not scene.bodies:
        where = f"{scene.file}: {scene.root}" if scene.file else scene.root
        raise InputError(f"{where} has no body; allowed: at least one OtBodyAPI or OtCellAPI prim")
    return asked


def _warn_of_oddities(scene: Scene, texts: Iterable[str]) -> None:
    """Say what is implausible in a scene or its parameters; Python says the same from the same line once."""
    for text in texts:
        warnings.warn(f"{scene.file or scene.root}: {text}", PlausibilityWarning, stacklevel=2)


def _time_scales(known: ResolvedScene, *, from_scene: bool, allow_large: bool) -> TimeScales:
    """The step, the scene's own if `from_scene`, and what limits it."""
    wanted, what = known.scene.settings.time_step, "time step"
    if from_scene:
        what = f"{known.scene.file}: ot:scene:timeStep, time step"
    return time_scales(
        known.scene,
        known.moves,
        known.values,
        known.relaxation,
        known.steepest,
        known.edges,
        known.loads,
        integrator=known.features.integrator,
        contacts=known.features.contacts,
        explicit=None if wanted is None else ExplicitStep(step=wanted, what=what, allow_large=allow_large),
    )


def _stepped_features(known: ResolvedScene, time_step: float, device: wp.Device, *, worlds: int) -> Features:
    """Terms of a step of that length [s]; warns of motion that it would lose."""
    scene, moves, values, features = known.scene, known.moves, known.values, known.features
    soft = soft_contacts(scene, moves, values, features, time_step)
    in_turn = device.is_cpu and not soft and takes_turns(scene, moves, values, features, time_step)
    how = {"brownian": features.brownian, "precision": features.precision}
    warn_of_lost_motion(scene, moves, values, known.loads, time_step, **how)
    space = body_space(scene, moves, values, features, time_step)
    if features.episodes and soft:
        raise InputError(
            f"{scene.file or scene.root}: ends is given; allowed: none in a scene of {features.bodies} bodies whose "
            f"contacts are explicit at time steps of {time_step:.4g} s, as they are soft"
        )
    by_world = features.driver == "grid" and not soft and fits_a_block(scene)
    solved = {"soft_contacts": soft, "in_turn": in_turn, "body_space": space, "by_world": by_world}
    features = dataclasses.replace(features, **solved)
    features = dataclasses.replace(features, phased=features.phased or many_in_phases(features, worlds, device))
    forms = {"keeps": keeps_contacts(features, worlds, device), "team": team_for(features, worlds, device)}
    return dataclasses.replace(features, **forms)


def _pack(
    known: ResolvedScene,
    time_step: float,
    seed: int,
    rows: slice,
    staged: list[Samples] | None,
    room: wp.array,
    place: Place,
) -> tuple[Annotated[Any, ModelData], dict[str, Any]]:
    """The kernels' view of the worlds `rows`, and by their names in `Model` the data that it refers to."""
    scene, moves, values, optics, features = known.scene, known.moves, known.values, known.optics, known.features
    data = place.typed(ModelData)()
    data.bodies = len(scene.bodies)
    data.period = pack_period(scene, place)
    data.medium = pack_medium(values["medium_temperature"], values["medium_viscosity"], place)
    data.body = pack_bodies(scene, moves, optics, place)
    data.contact = pack_contact(scene, moves, features.contacts, place, rods=features.rods)
    data.obstacles, meshes = pack_obstacles(scene, bool(features.obstacles), place)
    data.flow = pack_flow(scene, values["flow_speed"], values["flow_shear_rate"], place)
    data.walls = pack_walls(scene, moves, hydrodynamic_walls(scene), place)
    data.coupling = pack_coupling(scene, moves, features.coupling, place)
    data.forces, force_data = pack_forces(scene, moves, known.forces, place)
    held = _held_spheres(scene, known.held, moves)
    data.traps = pack_traps(scene, values, held, known.held_range, optics, staged, room, place)
    data.time_step = wp.float64(time_step)
    data.seed = wp.uint32(seed)
    data.first_world = wp.int32(rows.start)
    data.worlds, episode_data = pack_worlds(rows.stop - rows.start if features.episodes else 0, rows.start, place)
    data.inlets, inlet_data = pack_inlets(scene, place)
    kept = {"meshes": meshes, "force_data": force_data, "episode_data": episode_data, "inlet_data": inlet_data}
    return data, kept


def _held_spheres(scene: Scene, held: tuple[tuple[int, int], ...], moves: list[BodyMobility]) -> list[HeldSphere]:
    """Per trap the sphere it holds."""
    spheres = []
    for b, i in held:
        if b < 0:
            spheres.append(HeldSphere(-1, np.zeros(3), 0.0))
            continue
        offset = np.array(scene.bodies[b].spheres[i].offset)
        mobility = mean_point_mobility(moves[b], offset) if is_rigid(scene.bodies[b]) else moves[b].mobility[0, 0]
        spheres.append(HeldSphere(b, offset - moves[b].reference, float(mobility)))
    return spheres
