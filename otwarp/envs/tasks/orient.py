"""Orient: a robot is tilted by its two traps until one end is as high as is wanted, which differs by episode.

Strategy A: in equal harmonic traps d apart, softer along the beam, a pair of spheres of length L rests at
cos θ = d/((1 − η)·L). Traps that come too close lose a sphere; those that part too far lay the pair flat, and which end
rises then is chance. Strategy B: of a robot of five elements unequal powers choose the end that rises, that in the
weaker trap, if the traps close quickly; their distance sets how high.
"""

from __future__ import annotations

from typing import Any, Literal

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.servo import POWERS, SpacingServo, TiltServo
from otwarp.envs.task import Hand, Task
from otwarp.envs.tasks import terms as own
from otwarp.errors import InputError

LEFT, RIGHT = "/World/Traps/left", "/World/Traps/right"
SPEED_LIMIT = 2.0
"""Of either trap [µm/s]."""
RISE = {"A": (2.0, 1.5), "B": (0.1, 1.5)}
"""Wanted height of the right sphere above the middle: mean and half width [µm]."""
LOST = {"A": 4.6, "B": 3.8}
"""Distance of a sphere from its trap at which it is lost [µm]."""
TOLERANCE, LEAST_TIME = 0.2, 3.0
"""Of the height [µm]; before which it does not count [s]."""


def task(strategy: Literal["A", "B"] = "A") -> Task:
    """The task.

    Args:
        strategy: `A`, by the distance of equal traps; `B`, by their powers as well.

    Raises:
        InputError: Neither.
    """
    if strategy not in RISE:
        raise InputError(f"strategy of otwarp/Orient-v0 is {strategy!r}; allowed: A, B")
    axis, lost = ("x" if strategy == "A" else "y"), LOST[strategy]
    by_strategy: dict[str, dict[str, Any]] = {
        "A": {
            "scene": scenes.without_contact(scenes.load("strategy_a")),
            "description": "Tilt a pair of spheres by the distance of its traps, until its end is as high as wanted.",
            "expert": SpacingServo,
        },
        "B": {
            "scene": scenes.without_contact(scenes.load("strategy_b")),
            "description": "Tilt a robot by powers and distance of its traps, until its end is as high as wanted.",
            "action": "both",
            "power": POWERS,
            "expert": TiltServo,
        },
    }
    return Task(
        name="otwarp/Orient-v0",
        hands=(Hand(name="left", traps=(LEFT,), axes=axis), Hand(name="right", traps=(RIGHT,), axes=axis)),
        observations=(
            own.raised(trap=RIGHT),
            own.wanted_rise(),
            t.trap_spread(trap=LEFT, second=RIGHT, axes=axis),
            t.trap_offset(trap=LEFT, axes=f"{axis}z", scale=4.0, name="left_offset"),
            t.trap_offset(trap=RIGHT, axes=f"{axis}z", scale=4.0, name="right_offset"),
            t.time_left(),
        ),
        rewards=(
            own.rise_error(trap=RIGHT, weight=-0.05),
            own.risen_now(trap=RIGHT, tolerance=TOLERANCE, after=LEAST_TIME, weight=3.0),
            own.slip(distance=lost, weight=-5.0),
        ),
        ends=(
            own.risen(trap=RIGHT, tolerance=TOLERANCE, after=LEAST_TIME, success=True),
            t.lost(distance=lost),
        ),
        speed_limit=SPEED_LIMIT,
        time_limit=8.0,
        goal=(0.0, 0.0, RISE[strategy][0]),
        goal_half=(0.0, 0.0, RISE[strategy][1]),
        **by_strategy[strategy],
    )
