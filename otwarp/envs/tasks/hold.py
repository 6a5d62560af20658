"""Hold: a robot is kept in a stream of unknown speed by one trap, with as little power as will do."""

from __future__ import annotations

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.servo import PowerServo
from otwarp.envs.task import Hand, Task
from otwarp.envs.tasks import terms as own
from otwarp.studies.axes import random

TRAP, ROBOT = "/World/trap", "/World/robot"
POWER = (0.0, 1.2)
"""Least and largest power of the trap [mW]."""
SPEEDS = (8.0, 28.0)
"""Of the stream in mid-channel [µm/s]."""
LOST, DURATION = 3.5, 8.0
"""How far the robot may be from the trap [µm], and for how long it is to be held [s]."""


def task() -> Task:
    """The task."""
    return Task(
        name="otwarp/Hold-v0",
        description="Keep a robot in a stream, whose speed differs by episode, with as little power as will do.",
        scene=scenes.without_contact(scenes.load("hold")),
        hands=(Hand(name="hand", traps=(TRAP,)),),
        observations=(
            t.trap_offset(trap=TRAP, scale=2.0),
            t.trap_power(trap=TRAP, scale=POWER[1]),
            t.body_velocity(body=ROBOT, scale=20.0),
            t.time_left(),
        ),
        rewards=(
            t.passing(weight=1.0),
            t.total_power(weight=-0.05),
            own.slip(distance=LOST, weight=-5.0),
        ),
        ends=(t.lost(distance=LOST), t.kept_up(duration=DURATION, success=True)),
        action="power",
        power=POWER,
        time_limit=DURATION + 1.0,
        randomise={"flow_speed": random(*SPEEDS, 64, unit="µm/s")},
        expert=PowerServo,
    )
