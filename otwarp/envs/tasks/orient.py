"""Orient: a pair of spheres is tilted by how far its two traps stand apart, to a height that differs by episode.

In equal harmonic traps d apart, softer along the beam, a pair of length L rests at cos θ = d/((1 − η)·L): strategy A.
Traps that come too close lose a sphere; those that part too far lay the pair flat, and which end rises then is chance.
"""

from __future__ import annotations

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.servo import SpacingServo
from otwarp.envs.task import Hand, Task
from otwarp.envs.tasks import terms as own

PAIR, LEFT, RIGHT = "/World/pair", "/World/Traps/left", "/World/Traps/right"
SPEED_LIMIT = 2.0
"""Of either trap [µm/s]."""
RISE = (2.0, 1.5)
"""Wanted height of the right sphere above the middle: mean and half width [µm]."""
TOLERANCE, LEAST_TIME, LOST = 0.2, 3.0, 4.6
"""Of the height [µm]; before which it does not count [s]; of a sphere from its trap, at which it is lost [µm]."""


def task() -> Task:
    """The task."""
    return Task(
        name="otwarp/Orient-v0",
        description="Tilt a pair of spheres by the distance of its traps, until its end is as high as wanted.",
        scene=scenes.without_contact(scenes.load("strategy_a")),
        hands=(Hand(name="left", traps=(LEFT,), axes="x"), Hand(name="right", traps=(RIGHT,), axes="x")),
        observations=(
            own.raised(trap=RIGHT),
            own.wanted_rise(),
            t.trap_spread(trap=LEFT, second=RIGHT, axes="x"),
            t.trap_offset(trap=LEFT, axes="xz", scale=4.0, name="left_offset"),
            t.trap_offset(trap=RIGHT, axes="xz", scale=4.0, name="right_offset"),
            t.time_left(),
        ),
        rewards=(
            own.rise_error(trap=RIGHT, weight=-0.05),
            own.risen_now(trap=RIGHT, tolerance=TOLERANCE, after=LEAST_TIME, weight=3.0),
            own.slip(distance=LOST, weight=-5.0),
        ),
        ends=(
            own.risen(trap=RIGHT, tolerance=TOLERANCE, after=LEAST_TIME, success=True),
            t.lost(distance=LOST),
        ),
        speed_limit=SPEED_LIMIT,
        time_limit=8.0,
        goal=(0.0, 0.0, RISE[0]),
        goal_half=(0.0, 0.0, RISE[1]),
        expert=SpacingServo,
    )
