"""A rigid dimer of two spheres of radius 1.5 µm, each in a trap of its own with the fitted laws."""

from __future__ import annotations

from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from scenes.author import shapes, trap_laws

RADIUS = 1.5
SEPARATION = 4.5  # between the centres [µm]: more than a trap's reach, so that each trap holds one sphere
POWER = 5.0  # per trap [mW]
HEIGHT = 10.0
DURATION = 1.0


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (3.0, -20.0, HEIGHT + 9.0), (0.0, 0.0, HEIGHT), field_of_view=36.0)
    ends = {"left": -SEPARATION / 2, "right": SEPARATION / 2}
    dimer = Body(
        prim="/World/dimer",
        position=(0.0, 0.0, HEIGHT),
        spheres=tuple(
            Sphere(prim=f"/World/dimer/{name}", offset=(x, 0.0, 0.0), radius=RADIUS, refractive_index=1.52)
            for name, x in ends.items()
        ),
        warning_force=10.0,
    )
    builder.add(dimer, color=shapes.WARM_ROBOT)
    builder.add_rod(dimer.prim, "rod", dimer.spheres[0].offset, dimer.spheres[1].offset, 0.6, color=shapes.WARM_ROBOT)
    equilibrium = trap_laws.equilibrium_of(RADIUS)
    for (name, x), color in zip(ends.items(), (shapes.RED_BEAM, shapes.CYAN_BEAM), strict=True):
        trap = Trap(
            prim=f"/World/Traps/{name}",
            position=Track.constant((x, 0.0, round(HEIGHT - equilibrium, 6))),
            power=Track.constant(POWER),
            radial=trap_laws.RADIAL,
            axial=trap_laws.AXIAL,
            equilibrium=equilibrium,
            hand="left" if name == "left" else "right",
            holds=f"/World/dimer/{name}",
        )
        builder.add(trap, color=color, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
