"""One bead of radius 0.5 µm beside one tabulated trap, far from walls: what studies of capture and escape start from.

The force is that of the focused beam, from its table, up to 2.5 µm from the focus.
"""

from __future__ import annotations

from pathlib import Path

from otwarp.scene import Body, Camera, SceneBuilder, Settings, Sphere, Track, Trap
from scenes.author import shapes

RADIUS, INDEX = 0.5, 1.59
POWER = 1.0  # [mW]
REACH = 2.5  # [µm]
HEIGHT = 10.0
DURATION = 1.0


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -14.0, HEIGHT + 6.0), (0.0, 0.0, HEIGHT), field_of_view=36.0)
    bead = Body(
        prim="/World/bead",
        position=(0.0, 0.0, HEIGHT),
        spheres=(Sphere(prim="/World/bead/sphere", radius=RADIUS, refractive_index=INDEX),),
        density=1050e-12,
        warning_force=10.0,
    )
    trap = Trap(
        prim="/World/Traps/trap",
        position=Track.constant((0.0, 0.0, HEIGHT)),
        power=Track.constant(POWER),
        numerical_aperture=1.2,
        model="table",
        reach=REACH,
        holds="/World/bead/sphere",
    )
    builder.add(bead, color=shapes.WARM_ROBOT)
    builder.add(trap, color=shapes.RED_BEAM, opacity=0.25)
    builder.add(Camera(prim="/World/microscope", focus=HEIGHT))
    shapes.light(builder)
    return builder


def main() -> None:
    build().save(Path(__file__).parents[1] / "table_trap.usda")


if __name__ == "__main__":
    main()
