"""Hold: a robot is kept in a stream of unknown speed by one trap, with as little power as will do.

A trap of the power P pulls with at most P·f, f the largest force per power of its law, so that a stream of the speed u
asks for at least 6πηa·u/f, which the mean power of an episode is measured by. As much as that holds nothing for long:
thermal motion takes the robot past the largest force, from where there is no way back.
"""

from __future__ import annotations

import math

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.servo import PowerServo
from otwarp.envs.task import Hand, Task
from otwarp.envs.tasks import terms as own
from otwarp.scene import Scene
from otwarp.studies.axes import random

TRAP, ROBOT = "/World/trap", "/World/robot"
POWER = (0.0, 1.2)
"""Least and largest power of the trap [mW]."""
SPEEDS = (8.0, 28.0)
"""Of the stream in mid-channel [µm/s]."""
LOST, DURATION = 3.5, 8.0
"""How far the robot may be from the trap [µm], and for how long it is to be held [s]."""
MOST = 1.5
"""Mean power, over the least that the stream asks for, up to which a robot counts as held."""


def least_power(scene: Scene) -> float:
    """Power of the trap by which its largest force is the drag in a stream of 1 µm/s [mW per µm/s]."""
    (trap,), (robot,) = scene.traps, scene.bodies
    assert trap.radial is not None
    drag = 6.0 * math.pi * scene.medium.viscosity * robot.spheres[0].radius
    return drag / (trap.radial.stiffness * trap.radial.threshold / trap.radial.power)


def task() -> Task:
    """The task."""
    scene = scenes.without_contact(scenes.load("hold"))
    little = {"duration": DURATION, "need": least_power(scene), "most": MOST}
    return Task(
        name="otwarp/Hold-v0",
        description="Keep a robot in a stream, whose speed differs by episode, with as little power as will do.",
        scene=scene,
        hands=(Hand(name="hand", traps=(TRAP,)),),
        observations=(
            t.trap_offset(trap=TRAP, scale=2.0),
            t.trap_power(trap=TRAP, scale=POWER[1]),
            t.mean_power(scale=POWER[1]),
            t.body_velocity(body=ROBOT, scale=20.0),
            t.time_left(),
        ),
        rewards=(
            t.passing(weight=1.0),
            t.total_power(weight=-0.05),
            own.slip(distance=LOST, weight=-5.0),
            own.thrift_now(**little, weight=5.0),
        ),
        ends=(
            own.held_with_little(**little, success=True),
            t.lost(distance=LOST),
            t.kept_up(duration=DURATION, name="wasteful"),
        ),
        action="power",
        power=POWER,
        time_limit=DURATION + 1.0,
        randomise={"flow_speed": random(*SPEEDS, 64, unit="µm/s")},
        expert=PowerServo,
    )
