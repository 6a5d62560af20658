"""A robot of one sphere held by one trap in mid-channel against a Poiseuille flow: with how little power?

At SPEED the drag 6πηr·v on the robot is 0.84 pN; the trap pulls with 1.6 pN/mW at most, so that POWER is four times
what would just do without thermal motion, and less than a quarter of it lets the robot go.
"""

from __future__ import annotations

from otwarp.scene import Body, Flow, SceneBuilder, Settings, Sphere, Track, Trap
from scenes.author import robots, shapes, trap_laws

RADIUS = 2.5
HALF_HEIGHT = 10.0  # of the channel [µm]
SPEED = 20.0  # of the flow in mid-channel [µm/s]
POWER = 2.1  # [mW]
DURATION = 10.0  # [s]


def robot() -> Body:
    """A sphere of resist in mid-channel."""
    sphere = Sphere(prim="/World/robot/sphere", radius=RADIUS, refractive_index=robots.RESIST_INDEX)
    return Body(
        prim="/World/robot",
        position=(0.0, 0.0, HALF_HEIGHT),
        spheres=(sphere,),
        material=robots.RESIST,
        warning_force=10.0,
    )


def trap() -> Trap:
    """The trap, under the robot by what its light pushes."""
    return Trap(
        prim="/World/trap",
        position=Track.constant((0.0, 0.0, round(HALF_HEIGHT - trap_laws.EQUILIBRIUM, 6))),
        power=Track.constant(POWER),
        radial=trap_laws.RADIAL,
        axial=trap_laws.AXIAL,
        equilibrium=trap_laws.EQUILIBRIUM,
        hand="left",
        holds="/World/robot/sphere",
    )


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (6.0, -44.0, 26.0), (2.0, 0.0, HALF_HEIGHT - 3.0), field_of_view=40.0)
    flow = Flow(
        prim="/World/flow", kind="poiseuille", origin=(0.0, 0.0, HALF_HEIGHT), speed=SPEED, half_height=HALF_HEIGHT
    )
    builder.add(flow)
    builder.add(robot(), color=shapes.WARM_ROBOT)
    builder.add(trap(), color=shapes.RED_BEAM, opacity=0.45)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    lid = shapes.plane("/World/Channel/lid", (0.0, 0.0, 2 * HALF_HEIGHT), orientation=shapes.DOWNWARDS)
    builder.add(lid, color=shapes.GLASS, opacity=0.05)
    shapes.observed(builder, focus=HALF_HEIGHT)
    return builder
