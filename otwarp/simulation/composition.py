"""What a step is composed of: the features of a scene, its driver and its integrator."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.core.features import GRID_WORLD_BODIES, MAX_CONTACTS, MAX_WORLD_BODIES, Features
from otwarp.kernels.core.noise import NOISES
from otwarp.kernels.core.precision import PRECISIONS
from otwarp.kernels.drivers.lane_groups import GROUP
from otwarp.kernels.drivers.lanes_alike import go_together
from otwarp.kernels.forces.locality import needs_place
from otwarp.kernels.hydrodynamics.coupling import COUPLED
from otwarp.kernels.hydrodynamics.walls import NEAR_WALLS
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Body, Scene
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import is_rigid
from otwarp.simulation.packing.coupling import check_coupling, takes_coupling
from otwarp.simulation.packing.flow import flows
from otwarp.simulation.packing.inlets import has_inlet
from otwarp.simulation.packing.optics import TrapOptics
from otwarp.simulation.packing.traps import trap_reach
from otwarp.simulation.packing.walls import hydrodynamic_walls


def compose(
    scene: Scene,
    values: Mapping[str, np.ndarray],
    optics: TrapOptics,
    device: wp.Device,
    forces: tuple[BodyForce, ...],
    options: StepOptions,
    *,
    worlds: int,
    part: bool,
) -> Features:
    """The features of a scene on a device.

    Args:
        values: Parameters in force, as `Model.values`.
        forces: Forces with parameters per body.
        options: What the user chose about the step.
        worlds: How many there are in all.
        part: Whether only some of the worlds are stepped.

    Raises:
        InputError: Rods that collide in a many-body scene; coupling of too many bodies, or beside hydrodynamic walls;
            an unknown precision, or one that the scene does not go with.
    """
    f = dataclasses.replace(scene_features(scene, values, optics), forces=forces)
    check_coupling(scene)
    _check_rods(scene, f)
    hydrodynamic_walls(scene)  # no body starts behind one
    _check_precision(scene, f, options.precision, fast_math=options.fast_math)
    if options.ends is not None and f.driver == "grid" and not fits_a_block(scene):
        raise InputError(
            f"{scene.file or scene.root}: ends is given; allowed: none in a scene of {f.bodies} bodies {_why_grid(f)}, "
            f"any in scenes of up to {GRID_WORLD_BODIES} bodies and elements that collide"
        )
    f = dataclasses.replace(
        f,
        integrator=serving_integrator(f),
        fast_math=options.fast_math,
        crossings=options.crossings,
        precision=options.precision,
        gliding_traps=options.glides and f.traps > 0,
        # a part has its worlds' numbers from their trials; the grid driver counts its worlds by itself
        episodes=options.ends is not None or (part and f.driver != "grid"),
    )
    lanes = device.is_cpu and f.precision == "float32" and _takes_lanes(f)
    # what a few worlds cannot fill costs one world 15 % of its speed
    vectors = lanes and worlds >= GROUP and go_together(f)
    cached = device.is_cpu and f.driver == "world" and not f.coupling
    return dataclasses.replace(
        f,
        lanes=lanes,
        blocks=device.is_cpu and _takes_blocks(f),
        vectors=vectors,
        cached=cached,
        phased=device.is_cuda and _takes_phases(f),
        listed=device.is_cuda and _lists_traps(f),
    )


def _check_rods(scene: Scene, f: Features) -> None:
    """Refuse rods that collide in a many-body scene.

    Raises:
        InputError: One line.
    """
    if f.driver == "grid" and f.rods:
        first = next(rod for b in scene.bodies for rod in b.rods if rod.collides)
        raise InputError(
            f"{scene.file or scene.root}: {first.prim}: ot:rod:collides = true: must be false in a scene of "
            f"{f.bodies} bodies, rods collide in scenes of up to {MAX_WORLD_BODIES}"
        )


def _check_precision(scene: Scene, f: Features, precision: str, *, fast_math: bool) -> None:
    """Refuse what is no precision or no choice of fast math, and float64 where there is none.

    That is with many bodies, before a mesh, and with fast math.

    Raises:
        InputError: One line.
    """
    if not isinstance(fast_math, bool):
        raise InputError(f"fast_math is {fast_math!r}; allowed: true or false")
    if precision not in PRECISIONS:
        raise InputError(f"precision is {precision!r}; allowed: {', '.join(PRECISIONS)}")
    if precision == "float32":
        return
    where = f"{scene.file or scene.root}: "
    if f.driver == "grid":
        raise InputError(
            f"{where}precision is 'float64'; allowed: float32 in a scene of {f.bodies} bodies {_why_grid(f)}, "
            f"float64 in scenes of up to {MAX_WORLD_BODIES}"
        )
    if "mesh" in f.obstacles:
        mesh = next(o for o in scene.obstacles if o.shape == "mesh")
        raise InputError(
            f"{where}{mesh.prim}: precision is 'float64'; allowed: float32 with an obstacle that is a mesh, "
            "whose distances are float32"
        )
    if fast_math:
        raise InputError("precision is 'float64' with fast_math; allowed: one of the two")


def _why_grid(f: Features) -> str:
    """What the bodies of a scene in the grid driver have that keeps them from being stepped one by one."""
    if f.pairs:
        return "that can touch each other"
    return "that can touch obstacles" if f.obstacles else "with a trap speed limit"


def check_settings(scene: Scene) -> None:
    """Refuse an unknown integrator or noise.

    Raises:
        InputError: One line.
    """
    for name, value, known in (
        ("integrator", scene.settings.integrator, INTEGRATORS),
        ("noise", scene.settings.noise, NOISES),
    ):
        if not isinstance(value, str) or value not in known:
            raise InputError(f"{name} is {value!r}; allowed: {', '.join(known)}")


def serving_integrator(f: Features) -> str:
    """The integrator that does what the wanted one would: a simpler one where that makes no difference.

    Where nothing depends on place, one stage is exact. Near walls, where mobility depends on place, only some schemes
    have the right drift; of bodies that carry each other along it depends on place, too.
    """
    if f.walls:
        return f.integrator if f.integrator in NEAR_WALLS else NEAR_WALLS[0]
    if f.coupling:
        return f.integrator if f.integrator in COUPLED else COUPLED[0]
    return f.integrator if needs_place(f) else "eulerMaruyama"


def _room_for_contacts(scene: Scene, pairs: bool) -> int:
    """Contacts a world can have at most, as a power of two (so that similar scenes share a step), up to the limit."""
    elements = [len(body.colliding) for body in scene.bodies]
    possible = sum(elements) * len(scene.obstacles)
    if pairs:
        possible += (sum(elements) ** 2 - sum(n * n for n in elements)) // 2
    if any(_has_rods(body) for body in scene.bodies):
        possible *= 3  # a rod that lies flat touches at both ends of where it does, and in the middle
    return min(MAX_CONTACTS, 1 << max(2, (possible - 1).bit_length()))


def _takes_lanes(f: Features) -> bool:
    """Whether a CPU draws noise in blocks: bodies on their own, and many-body scenes of lone spheres."""
    return not f.walls and (f.driver == "solo" or (_fills_blocks(f) and not f.rigid))


def _lists_traps(f: Features) -> bool:
    """Whether a GPU lists which traps may reach which spheres: of robots alone, where something can escape."""
    alone = f.driver == "solo" and f.rigid and not f.spheres
    return alone and f.escapes and f.keeps_aims and not f.inlet and f.precision == "float32"


def _takes_blocks(f: Features) -> bool:
    """Whether a CPU draws the noise of lone spheres in blocks beside bodies that turn."""
    return not f.walls and f.rigid and f.spheres and _fills_blocks(f)


def _fills_blocks(f: Features) -> bool:
    """Whether a step of the `grid` driver has noise that fills blocks of many bodies.

    A block holds one step: nothing for a scheme that looks at the next step's noise.
    """
    return f.driver == "grid" and f.contacts and f.brownian and INTEGRATORS[f.integrator].noise_ahead == 0


def fits_a_block(scene: Scene) -> bool:
    """Whether a block of threads steps a world of the scene by itself in the grid driver."""
    colliding = sum(len(body.colliding) for body in scene.bodies)
    return max(len(scene.bodies), colliding) <= GRID_WORLD_BODIES


def _takes_phases(f: Features) -> bool:
    """Whether a GPU has a kernel for each stage: where one for all is more code than it keeps at hand."""
    return f.driver == "world" and f.rigid and f.contacts and not f.coupling


def _has_rods(body: Body) -> bool:
    """Whether a rod of the body collides."""
    return any(rod.collides for rod in body.rods)


def scene_features(scene: Scene, values: Mapping[str, np.ndarray], optics: TrapOptics) -> Features:
    """The terms this scene needs, whether or not they go together; the integrator is still the wanted one."""
    bodies, traps = scene.bodies, scene.traps
    colliding = sum(bool(b.colliding) for b in bodies)
    pushed = any(s.trapped for b in bodies for s in b.spheres)
    # sorted, so that scenes with the same models share one compiled step
    models = tuple(sorted({optics.term_name(scene, t) for t in range(len(traps))})) if pushed else ()
    obstacles = tuple(sorted({o.shape for o in scene.obstacles})) if colliding else ()
    pairs = colliding > 1
    limits = bool(models) and bool(np.any(np.isfinite(values["trap_speed_limit"])))
    driver = "solo"
    coupling = takes_coupling(scene)
    if pairs or obstacles or limits or coupling:
        driver = "world" if len(bodies) <= MAX_WORLD_BODIES else "grid"
    rods = bool(pairs or obstacles) and any(_has_rods(b) for b in bodies)
    return Features(
        driver=driver,
        bodies=len(bodies),
        traps=len(traps) if models else 0,
        trap_models=models,
        moving_traps=bool(models) and any(t.position.animated or t.power.animated for t in traps),
        speed_limits=limits,
        spheres=not all(is_rigid(b) for b in bodies),
        rigid=any(is_rigid(b) for b in bodies),
        brownian=scene.settings.brownian and bool(np.any(values["medium_temperature"] > 0.0)),
        gravity=scene.settings.gravity,
        flow=scene.flow.kind if scene.flow and flows(scene, values) else None,
        obstacles=obstacles,
        moving_obstacles=bool(obstacles)
        and any(o.position.animated or o.orientation.animated for o in scene.obstacles),
        pairs=pairs,
        rods=rods,
        coupling=coupling,
        periodic=any(scene.settings.period),
        inlet=has_inlet(scene),
        walls=min(2, sum(o.hydrodynamic for o in scene.obstacles)),
        max_contacts=_room_for_contacts(scene, pairs) if pairs or obstacles else MAX_CONTACTS,
        escapes=bool(models) and bool(np.any(np.isfinite(trap_reach(scene, values, 1.0)))),
        integrator=scene.settings.integrator,
        noise=scene.settings.noise,
    )
