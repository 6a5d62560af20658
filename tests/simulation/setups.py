"""Small scenes that the driver tests share, so that they share compiled steps too."""

from __future__ import annotations

import numpy as np

from otwarp.hydrodynamics import body_mobility
from otwarp.laws import TrapLaw
from otwarp.scene import (
    IDENTITY,
    Body,
    Material,
    Medium,
    Obstacle,
    Quat,
    Scene,
    Settings,
    Sphere,
    Track,
    Trap,
    Vec3,
)
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.user_forces import Force
from otwarp.units import BOLTZMANN

VISCOSITY = 0.00089
ENERGY = BOLTZMANN * 298.15
STIFFNESS = 20.0
"""Of the harmonic traps at POWER [pN/µm]."""
POWER = 20.0
COLD = 1e-9
"""Temperature [K] at which noise is 2e-6 of that at 298 K: a run without noise that shares the kernel with noise."""

FIVE = (((0.0, 0, 0), 1.0), ((1.9, 0, 0), 0.8), ((-1.9, 0, 0), 0.8), ((3.5, 0, 0.8), 1.0), ((-3.5, 0, 0.8), 1.0))
"""Offsets and radii of a five-sphere robot: handle – arm – hub – arm – handle [µm]."""


def drag(radius: float) -> float:
    """6πηa [pN·s/µm]."""
    return 6.0 * np.pi * VISCOSITY * radius


def sphere_body(
    name: str,
    position: Vec3 = (0.0, 0.0, 0.0),
    *,
    radius: float = 1.0,
    collides: bool = False,
    trapped: bool = True,
    material: Material | None = None,
    density: float = 1190e-12,
    kind: str = "robot",
) -> Body:
    """A bead or cell: one sphere."""
    ball = Sphere(prim=f"/World/{name}/S", radius=radius, collides=collides, trapped=trapped)
    return Body(
        prim=f"/World/{name}",
        kind=kind,  # type: ignore[arg-type]
        position=position,
        spheres=(ball,),
        material=material or Material(),
        density=density,
    )


def robot(name: str, position: Vec3 = (0.0, 0.0, 0.0), orientation: Quat = IDENTITY, *, shape=FIVE, **flags) -> Body:
    """A rigid body of several spheres; `flags` go to each sphere."""
    flags = {"collides": False, **flags}
    spheres = tuple(Sphere(prim=f"/World/{name}/S{i}", offset=o, radius=r, **flags) for i, (o, r) in enumerate(shape))
    return Body(prim=f"/World/{name}", position=position, orientation=orientation, spheres=spheres)


def harmonic(name: str, position: object = (0.0, 0.0, 0.0), *, power: object = POWER, cutoff=np.inf, **more) -> Trap:
    """An isotropic spring of STIFFNESS at POWER; tracks or constants."""
    return Trap(
        prim=f"/World/{name}",
        position=position if isinstance(position, Track) else Track.constant(position),
        power=power if isinstance(power, Track) else Track.constant(power),
        model="harmonic",
        radial=TrapLaw(stiffness=STIFFNESS, power=POWER, cutoff=cutoff),
        **more,
    )


def line(*samples: tuple[float, object]) -> Track:
    """A track through (time, value) samples."""
    values = np.array([np.atleast_1d(v) for _, v in samples], dtype=float)
    return Track(times=np.array([t for t, _ in samples], dtype=float), values=values)


def obstacle(name: str, shape: str, position: object, size: Vec3 = (0.0, 0.0, 0.0), turn: Quat = IDENTITY) -> Obstacle:
    """An obstacle at rest, or along a track of positions."""
    place = position if isinstance(position, Track) else Track.constant(position)
    turns = Track(times=place.times, values=np.tile(turn, (len(place.times), 1)))
    return Obstacle(prim=f"/World/{name}", shape=shape, position=place, orientation=turns, size=size)  # type: ignore[arg-type]


def bead_scene(*, accuracy: float = 0.01, time_step: float | None = None) -> Scene:
    """One bead in one harmonic trap: the solo driver."""
    return Scene(
        bodies=(sphere_body("Bead"),),
        traps=(harmonic("Trap"),),
        settings=Settings(accuracy=accuracy, time_step=time_step),
    )


CONTACT_STEP = 2e-4
STILL_BOX = (0.0, 0.0, -500.0)
FLOOR = 0.0
CELL = Material(youngs_modulus=2e3, poisson_ratio=0.45)


def contact_scene(
    first: Body,
    second: Body,
    *,
    traps: tuple[Trap, Trap] | None = None,
    box: Track | Vec3 = STILL_BOX,
    box_size: Vec3 = (2.0, 2.0, 2.0),
    floor: float = FLOOR,
    temperature: float = COLD,
    time_step: float = CONTACT_STEP,
) -> Scene:
    """Two spheres, two harmonic traps, a floor and a box that moves: every test of contact uses these features.

    A box given by a point creeps by 1 nm in 1000 s, so that it counts as moving, and traps that are off end far away,
    so that escapes are looked for: every test shares the kernels.
    """
    if not isinstance(box, Track):
        box = line((0.0, box), (1e3, np.add(box, (1e-3, 0.0, 0.0))))
    off = (harmonic("TrapA", power=0.0, cutoff=1e9), harmonic("TrapB", power=0.0, cutoff=1e9))
    return Scene(
        medium=Medium(temperature=temperature, viscosity=VISCOSITY),
        bodies=(first, second),
        traps=traps or off,
        obstacles=(obstacle("Floor", "plane", (0.0, 0.0, floor)), obstacle("Box", "box", box, box_size)),
        settings=Settings(gravity=True, time_step=time_step),
    )


def neutral(name: str, position: Vec3, **more) -> Body:
    """A colliding sphere that neither sinks nor rises."""
    return sphere_body(name, position, collides=True, density=Medium().density, **more)


def five_sphere_mobility():
    """Mobility of `FIVE`, from the hydrodynamics room."""
    centres, radii = np.array([o for o, _ in FIVE]), np.array([r for _, r in FIVE])
    return body_mobility(centres, radii, accuracy=Body.mobility_accuracy)


def model_with(scene: Scene, force: Force, device: str) -> Model:
    """What a simulation of the scene with one more force would step, without its kernels."""
    return Model.build(scene, device=device, options=StepOptions(forces=(force,)))
