"""Small scenes for live sessions."""

from __future__ import annotations

from dataclasses import replace

from otwarp.haptics.core import Vec3
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Medium, Scene, Settings, Sphere, Track, Trap

PLACES: dict[str, Vec3] = {"left": (-8.0, 0.0, 5.0), "right": (8.0, 0.0, 5.0), "none": (0.0, 8.0, 5.0)}
"""Where the bead and the trap of each hand are [µm]."""

POWER = 20.0
LAW = TrapLaw(stiffness=10.0, threshold=0.6, inverse_square=2.0, offset=0.444, cutoff=1.2, power=POWER)
"""At `POWER` continuous at the threshold: 6 pN there."""


def bead(name: str) -> Body:
    path = f"/World/bead_{name}"
    return Body(prim=path, position=PLACES[name], spheres=(Sphere(prim=f"{path}/sphere", radius=1.0),))


def trap(name: str, **changes) -> Trap:
    given = {"prim": f"/World/trap_{name}", "position": Track.constant(PLACES[name]), "hand": name} | changes
    return Trap(power=Track.constant(POWER), model="piecewise", radial=LAW, **given)


def three_beads(*, brownian: bool = False, **changes) -> Scene:
    """A bead in a trap of the left hand, of the right, and of none."""
    scene = Scene(
        root="/World",
        medium=Medium(),
        settings=Settings(brownian=brownian, time_step=1e-3, duration=10.0),
        bodies=tuple(bead(name) for name in PLACES),
        traps=tuple(trap(name) for name in PLACES),
    )
    return replace(scene, **changes)
