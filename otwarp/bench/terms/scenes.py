"""Scenes that differ by one term, built straight from the description, and the pairs whose difference is its cost.

Nothing sits at a coordinate of zero: a noiseless bead that relaxes towards the origin would end in denormal numbers,
whose arithmetic is many times slower on a CPU than that of any real scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from otwarp.bench.scenes import ELEMENTS, PLACE
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Flow, Material, Obstacle, Scene, Settings, Sphere, Track, Trap, Vec3

RADIUS = 1.5
LONG = 1e4
"""Time samples last this long [s]: no measurement outruns them."""
KEYS = 256
PRESS = 0.02
"""How far beyond contact a bead is pulled by its trap [µm]."""
FAR = 40.0
FAST = 1e4
"""A speed [µm/s] that no trap here reaches: what is timed is that it has a limit."""
SOFT = Material(youngs_modulus=1e4)
HARMONIC = TrapLaw(stiffness=50.0)
CURVE = TrapLaw(stiffness=50.0, threshold=0.5, inverse_square=6.25)
AXIAL = TrapLaw(stiffness=20.0, threshold=0.5, inverse_square=2.5)
_BUSY: dict[str, Any] = {"axial": AXIAL, "moving": True, "cutoff": 3.0}
EULER = "eulerMaruyama"
STILL = Settings(brownian=False)
THERMAL = Settings(brownian=True)


def shift(place: Vec3, x: float = 0.0, z: float = 0.0) -> Vec3:
    """A point beside another [µm], `x` and `z` further along these axes."""
    return (place[0] + x, place[1], place[2] + z)


def bead(place: Vec3 = PLACE, *, name: str = "bead", collides: bool = False) -> Body:
    """A lone sphere that collides only if asked to."""
    sphere = Sphere(prim=f"/World/{name}/sphere", radius=RADIUS, collides=collides)
    return Body(prim=f"/World/{name}", position=place, spheres=(sphere,), material=SOFT)


def robot(*, collides: bool = False) -> Body:
    """Five trapped spheres in a shallow U."""
    spheres = tuple(
        Sphere(prim=f"/World/robot/sphere{i}", offset=(x, 0.0, z), radius=RADIUS, collides=collides)
        for i, (x, z) in enumerate(ELEMENTS)
    )
    return Body(prim="/World/robot", position=PLACE, spheres=spheres, material=SOFT)


def path(place: Vec3, moving: bool) -> Track:
    """A position at rest, or one that creeps by 1 µm along x over `LONG`, sampled `KEYS` times."""
    if not moving:
        return Track.constant(place)
    times = np.linspace(0.0, LONG, KEYS)
    return Track(times=times, values=np.array(place) + np.outer(times / LONG, [1.0, 0.0, 0.0]))


def trap(
    place: Vec3 = PLACE,
    *,
    law: TrapLaw = CURVE,
    axial: TrapLaw | None = None,
    moving: bool = False,
    limit: float = np.inf,
    cutoff: float = np.inf,
    name: str = "trap",
) -> Trap:
    """A trap of 20 mW; the harmonic law has no threshold."""
    return Trap(
        prim=f"/World/{name}",
        position=path(place, moving),
        power=Track.constant(20.0),
        model="piecewise" if np.isfinite(law.threshold) else "harmonic",
        radial=replace(law, cutoff=cutoff),
        axial=replace(axial, cutoff=cutoff) if axial else None,
        speed_limit=limit,
    )


def table() -> Trap:
    """The same trap as a table of exact forces."""
    return replace(trap(), model="table", numerical_aperture=1.2)


def robot_traps(**how: object) -> tuple[Trap, ...]:
    """Three traps on the handles and the hub of the robot."""
    chosen = (ELEMENTS[0], ELEMENTS[2], ELEMENTS[4])
    return tuple(trap(shift(PLACE, x, z), name=f"trap{i}", **how) for i, (x, z) in enumerate(chosen))  # type: ignore[arg-type]


def obstacle(shape: str, *, gap: float, moving: bool = False) -> Obstacle:
    """An obstacle whose top is `gap` below the surface of the bead, `-PRESS` where the trap presses the bead on it."""
    top = PLACE[2] - RADIUS - gap
    depth = 0.0 if shape == "plane" else 4.0
    corners = np.array([[x, y, z] for z in (-4.0, 4.0) for y in (-4.0, 4.0) for x in (-4.0, 4.0)])
    place = (PLACE[0] + 0.3, PLACE[1] + 0.2, top - depth)
    track = path(place, moving)
    size = {"box": (4.0, 4.0, 4.0), "cylinder": (4.0, 4.0, 0.0)}.get(shape, (0.0, 0.0, 0.0))
    is_mesh = shape == "mesh"
    return Obstacle(
        prim=f"/World/{shape}",
        shape=shape,  # type: ignore[arg-type]
        position=track,
        orientation=Track(times=track.times, values=np.tile([0.0, 0.0, 0.0, 1.0], (len(track.times), 1))),
        size=size,
        vertices=corners if is_mesh else np.zeros((0, 3)),
        triangles=np.array(CUBE, dtype=np.int32) if is_mesh else np.zeros((0, 3), dtype=np.int32),
    )


CUBE = (
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
)  # fmt: skip
"""Triangles of a cube, outward, over corners ordered by z, y, x."""


def flow(kind: str) -> Flow:
    """A background flow along x through the bead."""
    origin = shift(PLACE, z=1.0)
    return Flow(prim="/World", kind=kind, origin=origin, speed=10.0, shear_rate=2.0, half_height=50.0)


def alone(*, settings: Settings = STILL, caught_by: Trap | None = None, **more: object) -> Scene:
    """One bead, by default with nothing acting on it."""
    traps = (caught_by,) if caught_by else ()
    return Scene(bodies=(bead(),), traps=traps, settings=settings, **more)  # type: ignore[arg-type]


def held(*obstacles: Obstacle, collides: bool = True, settings: Settings = STILL) -> Scene:
    """A bead in a harmonic trap with a speed limit, which makes one thread own the world with or without contact."""
    caught_by = trap(law=HARMONIC, limit=FAST)
    return Scene(bodies=(bead(collides=collides),), traps=(caught_by,), settings=settings, obstacles=obstacles)


def two(*, gap: float, collides: bool, settings: Settings = STILL) -> Scene:
    """Two beads side by side, each in its own trap of a reach short of the other, pressed together or `gap` apart."""
    other = shift(PLACE, 2.0 * RADIUS + gap)
    bodies = (bead(collides=collides), bead(other, name="other", collides=collides))
    how = {"law": HARMONIC, "limit": FAST, "cutoff": RADIUS}
    traps = (trap(**how), trap(other, **how, name="trap2"))
    return Scene(bodies=bodies, traps=traps, settings=settings)


def many_beads(*, collides: bool) -> Scene:
    """64 diffusing beads on a lattice with gaps of a tenth of a diameter."""
    step = 2.2 * RADIUS
    sites = [(x, y, z) for x in range(4) for y in range(4) for z in range(4)]
    bodies = tuple(
        bead((3.0 + x * step, 5.0 + y * step, 7.0 + z * step), name=f"bead{i}", collides=collides)
        for i, (x, y, z) in enumerate(sites)
    )
    return Scene(bodies=bodies, settings=THERMAL)


def lone_robot(*, settings: Settings = STILL, traps: tuple[Trap, ...] = (), **more: object) -> Scene:
    """The robot, by default with nothing acting on it."""
    return Scene(bodies=(robot(),), settings=settings, traps=traps, **more)  # type: ignore[arg-type]


def everything() -> Scene:
    """A cell pressed on a robot and the robot on a moving box, over a floor: all traps moving, limited and finite."""
    top = shift(PLACE, z=2.0 * RADIUS - PRESS)
    return Scene(
        bodies=(robot(collides=True), bead(top, name="cell", collides=True)),
        settings=replace(THERMAL, gravity=True),
        traps=(*robot_traps(**_BUSY, limit=FAST), trap(top, **_BUSY, limit=FAST, name="trap3")),
        obstacles=(obstacle("plane", gap=FAR), obstacle("box", gap=-PRESS, moving=True)),
        flow=flow("poiseuille"),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "bead": alone,
    "noise": lambda: alone(settings=THERMAL),
    "harmonic": lambda: alone(caught_by=trap(law=HARMONIC)),
    "noise, harmonic": lambda: alone(settings=THERMAL, caught_by=trap(law=HARMONIC)),
    "piecewise": lambda: alone(caught_by=trap()),
    "radial and axial": lambda: alone(caught_by=trap(axial=AXIAL)),
    "piecewise, one stage": lambda: alone(settings=replace(STILL, integrator=EULER), caught_by=trap()),
    "table": lambda: alone(caught_by=table()),
    "moving": lambda: alone(caught_by=trap(moving=True)),
    "limited": lambda: alone(caught_by=trap(moving=True, limit=FAST)),
    "reach": lambda: alone(caught_by=trap(cutoff=3.0)),
    "gravity": lambda: alone(settings=replace(STILL, gravity=True)),
    "uniform": lambda: alone(flow=flow("uniform")),
    "shear": lambda: alone(flow=flow("shear")),
    "poiseuille": lambda: alone(flow=flow("poiseuille")),
    "bead, all": lambda: alone(
        settings=replace(THERMAL, gravity=True), caught_by=trap(**_BUSY), flow=flow("poiseuille")
    ),
    "noise, three-point": lambda: alone(settings=replace(THERMAL, noise="threePoint")),
    "noise, hydrodynamic plane": lambda: alone(
        settings=THERMAL, obstacles=(replace(obstacle("plane", gap=1.0), hydrodynamic=True),)
    ),
    "robot": lone_robot,
    "robot, noise": lambda: lone_robot(settings=THERMAL),
    "robot, traps": lambda: lone_robot(settings=THERMAL, traps=robot_traps(cutoff=np.inf)),
    "robot, reach": lambda: lone_robot(settings=THERMAL, traps=robot_traps(cutoff=3.0)),
    "robot, flow": lambda: lone_robot(settings=THERMAL, flow=flow("poiseuille")),
    "held": lambda: held(collides=False),
    **{f"{s}, near": partial(lambda s: held(obstacle(s, gap=-PRESS)), s) for s in ("plane", "box", "cylinder", "mesh")},
    **{f"{s}, far": partial(lambda s: held(obstacle(s, gap=FAR)), s) for s in ("plane", "box", "cylinder", "mesh")},
    "moving box, near": lambda: held(obstacle("box", gap=-PRESS, moving=True)),
    "held, noise": lambda: held(collides=False, settings=THERMAL),
    "plane, noise": lambda: held(obstacle("plane", gap=-PRESS), settings=THERMAL),
    "two, noise": lambda: two(gap=1.0, collides=False, settings=THERMAL),
    "two, coupled": lambda: two(gap=1.0, collides=False, settings=replace(THERMAL, coupling=True)),
    "two, through each other": lambda: two(gap=-PRESS, collides=False),
    "two, near": lambda: two(gap=-PRESS, collides=True),
    "two, far": lambda: two(gap=FAR, collides=True),
    "crowd, through each other": lambda: many_beads(collides=False),
    "crowd": lambda: many_beads(collides=True),
    "everything": everything,
}
"""Every scene by name."""


@dataclass(frozen=True)
class Comparison:
    """A term, the scene without it and the scene with it; `touching` says that contact must be felt in the latter."""

    term: str
    without: str
    with_: str
    touching: bool = False


COMPARISONS: tuple[Comparison, ...] = (
    Comparison("Brownian noise", "bead", "noise"),
    Comparison("… three-point instead of Gaussian", "noise", "noise, three-point"),
    Comparison("… a hydrodynamic plane 1 µm away", "noise", "noise, hydrodynamic plane"),
    Comparison("harmonic trap", "bead", "harmonic"),
    Comparison("piecewise trap", "bead", "piecewise"),
    Comparison("… radial and axial curves instead of one", "piecewise", "radial and axial"),
    Comparison("… finite reach: escape detection", "piecewise", "reach"),
    Comparison(f"… moving on {KEYS} time samples", "piecewise", "moving"),
    Comparison("… speed limit", "moving", "limited"),
    Comparison("… Heun's two stages instead of one", "piecewise, one stage", "piecewise"),
    Comparison("tabulated trap, bilinear, 1e-3", "bead", "table"),
    Comparison("gravity", "bead", "gravity"),
    Comparison("uniform flow", "bead", "uniform"),
    Comparison("shear flow", "bead", "shear"),
    Comparison("Poiseuille flow", "bead", "poiseuille"),
    Comparison("rotation: 6×6 mobility, 5 spheres", "bead", "robot"),
    Comparison("… Brownian noise, 6 components", "robot", "robot, noise"),
    Comparison("… 3 piecewise traps on 5 spheres", "robot, noise", "robot, traps"),
    Comparison("… finite reach: cut-off and escapes", "robot, traps", "robot, reach"),
    Comparison("… Poiseuille flow on 5 spheres", "robot, noise", "robot, flow"),
    *(
        comparison
        for shape in ("plane", "box", "cylinder", "mesh")
        for comparison in (
            Comparison(f"{shape}, far", "held", f"{shape}, far"),
            Comparison(f"{shape}, touching", "held", f"{shape}, near", touching=True),
        )
    ),
    Comparison("plane, touching, with noise: thermal excursions", "held, noise", "plane, noise", touching=True),
    Comparison("… the touching box moves", "box, near", "moving box, near", touching=True),
    Comparison("hydrodynamic coupling of two beads", "two, noise", "two, coupled"),
    Comparison("body–body contact, far", "two, through each other", "two, far"),
    Comparison("body–body contact, touching", "two, through each other", "two, near", touching=True),
    Comparison("body–body contact in a crowd of 64", "crowd, through each other", "crowd"),
)
"""One row of the table each."""

TOGETHER: dict[str, tuple[str, tuple[str, ...]]] = {
    "bare bead, nothing switched on": ("bead", ()),
    "bead: noise, harmonic trap": ("noise, harmonic", ("noise", "harmonic")),
    "bead: noise, moving two-curve trap of finite reach, gravity, Poiseuille flow": (
        "bead, all",
        ("noise", "piecewise", "radial and axial", "moving", "reach", "gravity", "poiseuille"),
    ),
    "robot and cell: everything switched on, moving box and floor, touching": ("everything", ()),
}
"""Label → a scene, and the scenes of `COMPARISONS` that add its terms to the bare bead one at a time (or none)."""
