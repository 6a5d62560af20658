"""One bead of radius 0.5 µm beside one tabulated trap, far from walls: what studies of capture and escape start from.

The force is that of the focused beam, from its table, up to 2.5 µm from the focus.
"""

from __future__ import annotations

from otwarp.scene import SceneBuilder, Settings, Track, Trap
from scenes.author import shapes

RADIUS = 0.5
POWER = 1.0  # [mW]
REACH = 2.5  # [µm]
HEIGHT = 10.0
DURATION = 1.0


def trap() -> Trap:
    """A tight beam that stays where it is."""
    return Trap(
        prim="/World/Traps/trap",
        position=Track.constant((0.0, 0.0, HEIGHT)),
        power=Track.constant(POWER),
        numerical_aperture=1.2,
        model="table",
        reach=REACH,
        holds="/World/bead/sphere",
    )


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -14.0, HEIGHT + 6.0), (0.0, 0.0, HEIGHT), field_of_view=36.0)
    builder.add(shapes.bead("/World/bead", (0.0, 0.0, HEIGHT), radius=RADIUS), color=shapes.WARM_ROBOT)
    builder.add(trap(), color=shapes.RED_BEAM, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
