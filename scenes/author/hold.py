"""A robot of one sphere held by one trap in mid-channel against a Poiseuille flow: with how little power?

At SPEED the drag 6πηr·v on the robot is 0.84 pN; the trap pulls with 1.6 pN/mW at most, so that POWER is four times
what would just do without thermal motion, and less than a quarter of it lets the robot go.
"""

from __future__ import annotations

from otwarp.scene import Flow, SceneBuilder, Settings
from scenes.author import one_sphere, shapes

HALF_HEIGHT = 10.0  # of the channel [µm]
SPEED = 20.0  # of the flow in mid-channel [µm/s]
POWER = 2.1  # [mW]
DURATION = 10.0  # [s]


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (6.0, -44.0, 26.0), (2.0, 0.0, HALF_HEIGHT - 3.0), field_of_view=40.0)
    flow = Flow(
        prim="/World/flow", kind="poiseuille", origin=(0.0, 0.0, HALF_HEIGHT), speed=SPEED, half_height=HALF_HEIGHT
    )
    builder.add(flow)
    builder.add(one_sphere.robot((0.0, 0.0, HALF_HEIGHT)), color=shapes.WARM_ROBOT)
    builder.add(one_sphere.trap((0.0, 0.0, HALF_HEIGHT), POWER), color=shapes.RED_BEAM, opacity=0.45)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    lid = shapes.plane("/World/Channel/lid", (0.0, 0.0, 2 * HALF_HEIGHT), orientation=shapes.DOWNWARDS)
    builder.add(lid, color=shapes.GLASS, opacity=0.05)
    shapes.observed(builder, focus=HALF_HEIGHT)
    return builder
