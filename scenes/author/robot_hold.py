"""One five-element robot in its three traps, in a stream that can be turned: which sphere lets go first?

The stream is a uniform flow along the +X axis of `/World/Stream`, whose `xformOp:rotateZ` says from where it comes:
to a robot in a stream happens what happens to one that its traps carry along at that speed.
"""

from __future__ import annotations

from pxr import UsdGeom

from otwarp.scene import Flow, SceneBuilder, Settings
from scenes.author import robots, shapes

HEIGHT = 30.0  # above where a floor would be [µm]
POWER = 3.6  # per trap [mW]
SPEED = 20.0  # of the stream [µm/s]
DURATION = 2.0


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (3.0, -26.0, HEIGHT + 20.0), (0.0, 0.0, HEIGHT), field_of_view=38.0)
    robot = robots.five_element_robot("/World/robot", (0.0, 0.0, HEIGHT))
    robots.add_robot(builder, robot, color=shapes.WARM_ROBOT)
    for trap in robots.traps_on(robot, "/World/Traps/trap", power=POWER):
        builder.add(trap, color=shapes.RED_BEAM, opacity=0.25)
    builder.add(Flow(prim="/World/Stream/flow", kind="uniform", origin=(0.0, 0.0, HEIGHT), speed=SPEED))
    UsdGeom.Xformable(builder.stage.GetPrimAtPath("/World/Stream")).AddRotateZOp(UsdGeom.XformOp.PrecisionDouble).Set(
        0.0
    )
    shapes.observed(builder, focus=HEIGHT)
    return builder
