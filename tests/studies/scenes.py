"""Scenes of the tests of studies."""

from __future__ import annotations

from pathlib import Path

from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap


def bead_in_a_well(folder: Path, *, stiffness: float = 0.5, cutoff: float = 0.4, accuracy: float = 0.05) -> Path:
    """A bead of radius 0.5 µm in a harmonic trap that ends at `cutoff` [µm]; the file."""
    builder = SceneBuilder(settings=Settings(duration=0.5, accuracy=accuracy))
    builder.add(
        Body(
            prim="/World/bead",
            position=(0.0, 0.0, 10.0),
            spheres=(Sphere(prim="/World/bead/sphere", radius=0.5, refractive_index=1.59),),
        )
    )
    builder.add(
        Trap(
            prim="/World/trap",
            position=Track.constant((0.0, 0.0, 10.0)),
            power=Track.constant(1.0),
            radial=TrapLaw(stiffness=stiffness, threshold=cutoff, cutoff=cutoff, power=1.0),
            holds="/World/bead/sphere",
        )
    )
    return builder.save(folder / "well.usda")
