"""Small scenes with closed forms: a bead in a spring, a pressed pair, a bead on a floor, a robot in three traps.

Nothing sits at a coordinate of zero, where float32 resolves more than anywhere else in a real scene.
"""

from __future__ import annotations

import numpy as np

from otwarp.bench.closed_forms import POISSON_RATIO
from otwarp.laws import TrapLaw
from otwarp.scene import (
    IDENTITY,
    Body,
    Material,
    Medium,
    Obstacle,
    Scene,
    Settings,
    Sphere,
    Track,
    Trap,
    Vec3,
)

POWER = 20.0
"""At which laws hold [mW]."""

STIFFNESS = 20.0
"""Of the traps at that power [pN/µm]."""

PLACE: Vec3 = (3.0, 5.0, 7.0)

ELEMENTS = ((-4.0, 1.0), (-2.0, 0.4), (0.0, 0.0), (2.0, 0.4), (4.0, 1.0))
"""(x, z) of the five spheres of the robot [µm]: a shallow U."""

HELD = (0, 2, 4)
"""Those that its traps hold."""

REACH = 1.2
"""Of these traps [µm]: less than the distance to the next element."""


def bead(
    radius: float = 1.0,
    place: Vec3 = PLACE,
    *,
    name: str = "bead",
    modulus: float = 1e6,
    collides: bool = False,
    trapped: bool = True,
) -> Body:
    """A lone sphere of one radius [µm] at a place [µm], with Young's modulus `modulus` [Pa]."""
    sphere = Sphere(prim=f"/World/{name}/sphere", radius=radius, collides=collides, trapped=trapped)
    material = Material(youngs_modulus=modulus, poisson_ratio=POISSON_RATIO)
    return Body(prim=f"/World/{name}", position=place, spheres=(sphere,), material=material)


def spring(
    place: Vec3 | Track = PLACE,
    *,
    power: float = POWER,
    stiffness: float = STIFFNESS,
    name: str = "trap",
    cutoff: float = np.inf,
    holds: str | None = None,
) -> Trap:
    """A harmonic trap; `stiffness` holds at `POWER`."""
    return Trap(
        prim=f"/World/{name}",
        position=place if isinstance(place, Track) else Track.constant(place),
        power=Track.constant(power),
        model="harmonic",
        radial=TrapLaw(stiffness=stiffness, power=POWER, cutoff=cutoff),
        holds=holds,
    )


def scene(
    *bodies: Body, traps: tuple[Trap, ...] = (), temperature: float = 298.15, obstacles: tuple[Obstacle, ...] = ()
) -> Scene:
    """Bodies and traps in water; at 0 K the scene has no noise, and is stepped without it."""
    return Scene(
        medium=Medium(temperature=temperature),
        settings=Settings(brownian=temperature > 0.0, duration=1e4),
        bodies=bodies,
        traps=traps,
        obstacles=obstacles,
    )


def pair(modulus: float, ratio: float, *, overlap: float = 0.0, press: float = 0.0) -> Scene:
    """Two elastic spheres side by side along x at 0 K; the first has a radius of 1 µm.

    Args:
        modulus: Young's modulus of both [Pa].
        ratio: Second radius over the first.
        overlap: At the start [µm].
        press: Force with which one spring pulls both towards its centre once they just touch [pN]; 0 for no trap.
    """
    reach = 1.0 + ratio
    x, y, z = PLACE
    there = (x + reach - overlap, y, z)
    bodies = (
        bead(1.0, PLACE, name="small", modulus=modulus, collides=True),
        bead(ratio, there, name="large", modulus=modulus, collides=True),
    )
    middle = (x + 0.5 * (reach - overlap), y, z)
    traps = (spring(middle, stiffness=2.0 * press / reach),) if press > 0.0 else ()
    return scene(*bodies, traps=traps, temperature=0.0)


def obstacle(shape: str, *, size: Vec3 = (0.0, 0.0, 0.0), place: Vec3 = (0.0, 0.0, 0.0)) -> Obstacle:
    """An obstacle at rest, its axes those of the world."""
    return Obstacle(
        prim=f"/World/{shape}",
        shape=shape,  # type: ignore[arg-type]
        position=Track.constant(place),
        orientation=Track.constant(IDENTITY),
        size=size,
    )


THIN = 0.05
"""Half the thickness of the box and of the cylinder that a bead must not be pulled through [µm]."""

TOPS = {
    "plane": ((0.0, 0.0, 0.0), 0.0),
    "box": ((20.0, 20.0, THIN), THIN),
    "cylinder": ((20.0, THIN, 0.0), THIN),
    "sphere": ((5.0, 0.0, 0.0), 5.0),
    "capsule": ((2.0, 3.0, 0.0), 5.0),
}
"""Size of the obstacles a bead is pulled onto, and how far their tops are above their origins [µm]."""


def resting(shape: str, *, modulus: float, power: float = POWER, below: float = 0.0, temperature: float = 0.0) -> Scene:
    """A bead of 1 µm that just touches the top of an obstacle, in a spring centred `below` its place [µm]."""
    x, y, z = PLACE
    size, top = TOPS[shape]
    return scene(
        bead(1.0, PLACE, modulus=modulus, collides=True),
        traps=(spring((x, y, z - below), power=power),),
        temperature=temperature,
        obstacles=(obstacle(shape, size=size, place=(x, y, z - 1.0 - top)),),
    )


def robot(*, power: float = POWER, temperature: float = 298.15) -> Scene:
    """Five spheres in a shallow U, springs on both ends and the middle."""
    x, y, z = PLACE
    spheres = tuple(
        Sphere(prim=f"/World/robot/sphere{i}", offset=(a, 0.0, c), radius=1.0, collides=False)
        for i, (a, c) in enumerate(ELEMENTS)
    )
    body = Body(prim="/World/robot", position=PLACE, spheres=spheres)
    traps = tuple(
        spring(
            (x + ELEMENTS[i][0], y, z + ELEMENTS[i][1]),
            power=power,
            name=f"trap{i}",
            cutoff=REACH,
            holds=f"/World/robot/sphere{i}",
        )
        for i in HELD
    )
    return scene(body, traps=traps, temperature=temperature)
