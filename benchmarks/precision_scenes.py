"""Scenes of the comparison of float32 with float64: everything about one place, which may be far from the origin."""

from __future__ import annotations

from dataclasses import replace

from otwarp.laws import TrapLaw
from otwarp.scene import Body, Flow, Material, Medium, Scene, Settings, Sphere, Track, Trap, Vec3
from otwarp.units import BOLTZMANN

POWER = 20.0
RADIUS = 1.0
MEDIUM = Medium()
ENERGY = BOLTZMANN * MEDIUM.temperature
USUAL = 20.0
"""Stiffness of a trap where none is given [pN/µm]."""
ARMS = ((0.0, 1.0), (2.0, 0.6), (-2.0, 0.6), (4.0, 1.0), (-4.0, 1.0))
"""(x, radius) of the robot's five spheres."""
PRESS = 0.3
"""How much nearer than touching the traps of two cells stand [µm]."""


def sphere(name: str, place: Vec3, *, radius: float = RADIUS, material: Material | None = None) -> Body:
    """A bead, or with a material a cell that collides."""
    ball = Sphere(prim=f"/World/{name}/sphere", radius=radius, collides=material is not None)
    return Body(prim=f"/World/{name}", position=place, spheres=(ball,), material=material or Material())


def spring(name: str, place: Vec3, stiffness: float = USUAL, cutoff: float = float("inf")) -> Trap:
    """A linear trap of `stiffness` [pN/µm]."""
    law = TrapLaw(stiffness=stiffness, power=POWER, cutoff=cutoff)
    at, power = Track.constant(place), Track.constant(POWER)
    return Trap(prim=f"/World/{name}", position=at, power=power, model="harmonic", radial=law)


def trapped(place: float, stiffness: float = USUAL) -> Scene:
    """A bead in a spring at (place, place, place), with the time step that otwarp chooses."""
    at = (place, place, place)
    return Scene(medium=MEDIUM, bodies=(sphere("bead", at),), traps=(spring("trap", at, stiffness),))


def drifting(place: float, *, speed: float, brownian: bool, time_step: float = 1e-4) -> Scene:
    """A bead that nothing holds in a uniform flow along x [µm/s]."""
    flow = Flow(prim="/World", kind="uniform", speed=speed)
    settings = Settings(brownian=brownian, time_step=time_step)
    return Scene(medium=MEDIUM, bodies=(sphere("bead", (place, place, place)),), flow=flow, settings=settings)


def free(time_step: float = 1e-4) -> Scene:
    """A bead that nothing holds."""
    return Scene(medium=MEDIUM, bodies=(sphere("bead", (0.0, 0.0, 0.0)),), settings=Settings(time_step=time_step))


def tabulated() -> Scene:
    """A bead in a computed trap."""
    scene = trapped(0.0)
    optical = replace(scene.traps[0], model="table", radial=None)
    return replace(scene, traps=(optical,))


def robot() -> Scene:
    """Five spheres in three traps, each of which reaches its own sphere."""
    spheres = tuple(
        Sphere(prim=f"/World/robot/sphere{i}", offset=(x, 0.0, 0.0), radius=r, collides=False)
        for i, (x, r) in enumerate(ARMS)
    )
    traps = tuple(spring(f"trap{i}", (x, 0.1 * i, 0.0), cutoff=0.9) for i, x in enumerate((-4.0, 0.0, 4.0)))
    return Scene(medium=MEDIUM, bodies=(Body(prim="/World/robot", spheres=spheres),), traps=traps)


def pressed(youngs_modulus: float, *, brownian: bool = False) -> Scene:
    """Two cells of 1.5 and 2 µm 10 µm from the origin, which two traps press together by a force of some 3 pN."""
    stand = 0.5 * (3.5 - PRESS)
    material = Material(youngs_modulus=youngs_modulus, poisson_ratio=0.45)
    cells, traps = [], []
    for name, x, radius in (("a", 10.0 - stand, 1.5), ("b", 10.0 + stand, 2.0)):
        cells.append(sphere(name, (x, 10.0, 10.0), radius=radius, material=material))
        traps.append(spring(f"trap {name}".replace(" ", "_"), (x, 10.0, 10.0), cutoff=1.2))
    settings = Settings(brownian=brownian, time_step=2e-4)
    return Scene(medium=MEDIUM, bodies=tuple(cells), traps=tuple(traps), settings=settings)
