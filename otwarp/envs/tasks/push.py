"""Push: a robot in one trap pushes a cell, which nothing holds, to a goal."""

from __future__ import annotations

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.push import Pusher
from otwarp.envs.task import Hand, Shift, Task
from otwarp.envs.tasks import terms as own

ROBOT, CELL, TRAP = "/World/robot", "/World/cell", "/World/trap"
SPEED_LIMIT = 25.0
"""Of the trap [µm/s]."""


def task() -> Task:
    """The task."""
    scene = scenes.load("push")
    assert scene.goal is not None
    near, far, apart = scene.goal.tolerance, scene.goal.lost_distance, scene.goal.cell_lost_distance
    return Task(
        name="otwarp/Push-v0",
        description="Push a cell to the goal with a robot that does not hold it; do not lose robot or cell.",
        scene=scene,
        hands=(Hand(name="hand", traps=(TRAP,)),),
        observations=(
            t.body_offset(body=ROBOT, other=CELL, axes="xy"),
            t.goal_offset(body=CELL, axes="xy", scale=20.0),
            t.body_position(body=ROBOT, axes="xy"),
            t.body_velocity(body=ROBOT, axes="xy", scale=20.0),
            t.trap_offset(trap=TRAP, axes="xy", scale=2.0),
        ),
        rewards=(
            t.progress(body=CELL, weight=0.1),
            own.approach(body=ROBOT, other=CELL, weight=0.02),
            t.passing(weight=-0.1),
            t.arrival(body=CELL, radius=near, weight=5.0),
            own.slip(distance=far, weight=-1.0),
            own.parting(body=ROBOT, other=CELL, distance=apart, weight=-1.0),
        ),
        ends=(
            t.reached(body=CELL, radius=near, success=True),
            t.lost(distance=far),
            own.parted(body=ROBOT, other=CELL, distance=apart),
        ),
        speed_limit=SPEED_LIMIT,
        time_limit=20.0,
        shifts=(
            Shift(bodies=(ROBOT,), traps=(TRAP,), half=(2.0, 10.0, 0.0)),
            Shift(bodies=(CELL,), half=(2.0, 6.0, 0.0)),
        ),
        goal_half=(6.0, 12.0, 0.0),
        expert=Pusher,
    )
