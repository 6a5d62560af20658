"""CellDelivery: two robots squeeze a cell between their dishes and carry it past pillars and moving cubes to a goal.

What each hand moves are the three traps of its robot, together. The pair starts as the scene has it, the cell seated.
"""

from __future__ import annotations

from typing import Literal

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.delivery import Carrier
from otwarp.envs.task import Hand, Shift, Task
from otwarp.envs.tasks import terms as own
from otwarp.errors import InputError

CELL, LEFT, RIGHT = "/World/cell", "/World/Robots/left", "/World/Robots/right"
TRAPS = {side: tuple(f"/World/Traps/{side}_{e}" for e in ("handle_left", "hub", "handle_right"))
         for side in ("left", "right")}  # fmt: skip
OBSTACLES = tuple(
    f"/World/Obstacles/{name}" for name in ("pillar_1", "pillar_2", "cube_1", "cube_2", "cube_3", "cube_4")
)
CUBES = OBSTACLES[2:]
SPEED_LIMIT = 30.0
"""Of a hand [µm/s]."""
ANYWHERE = Shift(bodies=(CELL, LEFT, RIGHT), traps=TRAPS["left"] + TRAPS["right"],
                 half=(65.0, 31.0, 0.0), middle=(57.0, 26.0, 0.0))  # fmt: skip
"""Starts all over the channel; where an obstacle is, the episode is over after its first period."""


def task(start: Literal["scene", "anywhere"] = "scene") -> Task:
    """The task.

    Args:
        start: Where the pair starts: as the scene has it, or anywhere in the channel, to learn from what comes later.

    Raises:
        InputError: Another start.
    """
    if start not in ("scene", "anywhere"):
        raise InputError(f"start of otwarp/CellDelivery-v0 is {start!r}; allowed: scene, anywhere")
    scene = scenes.load("cell_delivery")
    assert scene.goal is not None
    goal = scene.goal
    return Task(
        name="otwarp/CellDelivery-v0",
        description="Carry a cell between two robots past pillars and moving cubes to the goal, and touch nothing.",
        scene=scene,
        hands=tuple(Hand(name=side, traps=traps) for side, traps in TRAPS.items()),
        observations=(
            t.goal_offset(body=CELL, axes="xy", scale=60.0),
            t.body_position(body=CELL, axes="xy", scale=60.0),
            t.body_velocity(body=CELL, axes="xy", scale=20.0),
            t.body_offset(body=CELL, other=LEFT, axes="xy", name="left_offset"),
            t.body_offset(body=CELL, other=RIGHT, axes="xy", name="right_offset"),
            t.body_axis(body=LEFT, axis=(1.0, 0.0, 0.0), axes="xy", name="left_axis"),
            t.body_axis(body=RIGHT, axis=(1.0, 0.0, 0.0), axes="xy", name="right_axis"),
            *(t.trap_offset(trap=traps[1], axes="xy", name=f"{side}_hub") for side, traps in TRAPS.items()),
            t.trap_spread(trap=TRAPS["left"][1], second=TRAPS["right"][1], axes="xy", scale=20.0),
            *(t.obstacle_offset(body=CELL, obstacle=p, axes="xy", scale=20.0, name=_short(p)) for p in OBSTACLES),
            *(t.obstacle_velocity(obstacle=p, axes="xy", name=f"{_short(p)}_velocity") for p in CUBES),
            t.contact_load(body=CELL),
            t.time_left(scale=20.0),
        ),
        rewards=(
            t.progress(body=CELL, weight=0.1),
            # a whole episode of it costs less than losing the cell at once, or that would be what is learnt first
            t.passing(weight=-0.02),
            t.arrival(body=CELL, radius=goal.tolerance, weight=10.0),
            *(own.crash(body=body, weight=-1.0, name=f"crash_{_short(body)}") for body in (CELL, LEFT, RIGHT)),
            own.slip(distance=goal.lost_distance, weight=-1.0),
            own.dropped(cell=CELL, left=LEFT, right=RIGHT, distance=goal.cell_lost_distance, weight=-1.0),
        ),
        ends=(
            t.reached(body=CELL, radius=goal.tolerance, success=True),
            t.left_behind(cell=CELL, left=LEFT, right=RIGHT, distance=goal.cell_lost_distance),
            t.lost(distance=goal.lost_distance),
            *(t.collided(body=body, name=f"collided_{_short(body)}") for body in (CELL, LEFT, RIGHT)),
        ),
        speed_limit=SPEED_LIMIT,
        shifts=(ANYWHERE,) if start == "anywhere" else (),
        time_limit=20.0,
        expert=Carrier,
    )


def _short(prim: str) -> str:
    return prim.rsplit("/", 1)[-1]
