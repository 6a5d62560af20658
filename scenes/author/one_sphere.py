"""A robot of one sphere of resist, and the trap that an operator's left hand moves it with."""

from __future__ import annotations

import math

from otwarp.scene import Body, Sphere, Track, Trap, Vec3
from scenes.author import robots, trap_laws

ROBOT, SPHERE, TRAP = "/World/robot", "/World/robot/sphere", "/World/trap"
RADIUS = 2.5  # [µm], for which the trap laws were fitted


def robot(position: Vec3) -> Body:
    """The robot, with its middle there [µm]."""
    sphere = Sphere(prim=SPHERE, radius=RADIUS, refractive_index=robots.RESIST_INDEX)
    return Body(prim=ROBOT, position=position, spheres=(sphere,), material=robots.RESIST, warning_force=10.0)


def trap(position: Vec3, power: float, *, speed_limit: float = math.inf) -> Trap:
    """Its trap, below that place by what its light pushes; power in mW, speed in µm/s."""
    x, y, z = position
    return Trap(
        prim=TRAP,
        position=Track.constant((x, y, round(z - trap_laws.EQUILIBRIUM, 6))),
        power=Track.constant(power),
        radial=trap_laws.RADIAL,
        axial=trap_laws.AXIAL,
        equilibrium=trap_laws.EQUILIBRIUM,
        hand="left",
        speed_limit=speed_limit,
        holds=SPHERE,
    )
