"""Shorthand for beads and obstacles, and the microscope, lights and colours that the shipped stages share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from otwarp.scene import IDENTITY, Body, Camera, Obstacle, Quat, Sphere, Track, Vec3

if TYPE_CHECKING:
    from otwarp.scene import SceneBuilder

# Linear RGB, as USD has it: deeper than they look on a screen.
WARM_ROBOT = (0.90, 0.27, 0.04)
GOLD_ROBOT = (0.93, 0.52, 0.06)
PINK_CELL = (0.92, 0.20, 0.36)
RED_BEAM = (1.0, 0.10, 0.07)
CYAN_BEAM = (0.03, 0.75, 1.0)
GREEN_GOAL = (0.10, 0.85, 0.30)
DEEP_BLUE = (0.010, 0.026, 0.085)
GLASS = (0.16, 0.38, 0.75)
PILLAR = (0.10, 0.19, 0.42)
CUBE = (0.24, 0.10, 0.62)

DOWNWARDS: Quat = (1.0, 0.0, 0.0, 0.0)
"""Half a turn about X: a plane that looks down, such as a lid."""


def _still(rotation: Quat = IDENTITY) -> Track:
    return Track.constant(rotation)


def bead(prim: str, position: Vec3, *, radius: float) -> Body:
    """A polystyrene bead of `radius` at `position` [µm], its sphere at `prim`/sphere."""
    sphere = Sphere(prim=f"{prim}/sphere", radius=radius, refractive_index=1.59)
    return Body(prim=prim, position=position, spheres=(sphere,), density=1050e-12, warning_force=10.0)


def plane(prim: str, position: Vec3, *, orientation: Quat = IDENTITY) -> Obstacle:
    """A plane through `position` [µm] whose normal is the rotated +Z."""
    return Obstacle(prim=prim, shape="plane", position=Track.constant(position), orientation=_still(orientation))


def box(prim: str, position: Vec3 | Track, half: Vec3) -> Obstacle:
    """An upright box with half extents `half` [µm], at rest or on a track."""
    track = position if isinstance(position, Track) else Track.constant(position)
    turned = Track(times=track.times, values=np.tile(IDENTITY, (len(track.times), 1)))
    return Obstacle(prim=prim, shape="box", position=track, orientation=turned, size=half)


def pillar(prim: str, x: float, y: float, *, radius: float, height: float) -> Obstacle:
    """A round pillar that stands on z = 0 [µm]."""
    size = (radius, height / 2, 0.0)
    position = Track.constant((x, y, height / 2))
    return Obstacle(prim=prim, shape="cylinder", position=position, orientation=_still(), size=size)


def walls(prefix: str, *, half_x: float, half_y: float, height: float, thickness: float) -> list[Obstacle]:
    """Four walls around |x| < half_x, |y| < half_y, standing on z = 0 [µm]."""
    x, y, t = half_x + thickness / 2, half_y + thickness / 2, thickness / 2
    long, short = (half_x + thickness, t, height / 2), (t, half_y, height / 2)
    return [
        box(f"{prefix}_south", (0.0, -y, height / 2), long),
        box(f"{prefix}_north", (0.0, y, height / 2), long),
        box(f"{prefix}_west", (-x, 0.0, height / 2), short),
        box(f"{prefix}_east", (x, 0.0, height / 2), short),
    ]


def observed(builder: SceneBuilder, *, focus: float, color: Vec3 | None = None) -> None:
    """Light the scene, and add the microscope, focused at the height `focus` [µm]."""
    builder.add(Camera(prim="/World/microscope", focus=focus), color=color)
    light(builder)


def watched(builder: SceneBuilder, *, focus: float, frame: tuple[float, float], color: Vec3 | None = None) -> None:
    """Light the scene, and add a camera `top` that has all of it in its frame [µm], focused at the height `focus` [µm].

    A 40× objective of aperture 0.9 on pixels of 6.4 µm: what a session is fed by has to see all robots at once, in no
    more pixels than a network takes in time.
    """
    builder.add(
        Camera(
            prim="/World/top", focus=focus, frame=frame, numerical_aperture=0.9, condenser_aperture=0.3,
            magnification=40.0, pixel_size=0.16,
        ),
        color=color,
    )  # fmt: skip
    light(builder)


def light(builder: SceneBuilder) -> None:
    """A cool dome and a warm key light from the upper left."""
    builder.add_light("/World/Lights/dome", kind="dome", color=(0.75, 0.85, 1.0))
    builder.add_light("/World/Lights/key", direction=(0.45, 0.55, -1.0), color=(1.0, 0.96, 0.9))
