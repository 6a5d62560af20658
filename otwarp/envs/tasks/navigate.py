"""Navigate: a robot in one trap, past pillars and swinging boxes, to a goal that differs from episode to episode."""

from __future__ import annotations

from otwarp.envs import scenes
from otwarp.envs import terms as t
from otwarp.envs.experts.navigate import ShortestPath
from otwarp.envs.task import Hand, Shift, Task
from otwarp.envs.tasks import terms as own

ROBOT, TRAP = "/World/robot", "/World/trap"
PILLARS = tuple(f"/World/Obstacles/pillar_{i}" for i in (1, 2, 3))
BOXES = tuple(f"/World/Obstacles/box_{i}" for i in (1, 2))
SPEED_LIMIT = 60.0
"""Of the trap [µm/s]: a little more than the robot can follow."""


def task() -> Task:
    """The task."""
    scene = scenes.without_contact(scenes.load("navigate"))
    assert scene.goal is not None
    near, far = scene.goal.tolerance, scene.goal.lost_distance
    return Task(
        name="otwarp/Navigate-v0",
        description="Bring a robot in one trap past pillars and swinging boxes to the goal, and touch nothing.",
        scene=scene,
        hands=(Hand(name="hand", traps=(TRAP,)),),
        observations=(
            t.goal_offset(body=ROBOT, axes="xy", scale=40.0),
            t.body_position(body=ROBOT, axes="xy", scale=40.0),
            t.body_velocity(body=ROBOT, axes="xy", scale=40.0),
            t.trap_offset(trap=TRAP, axes="xy", scale=2.0),
            *(t.obstacle_offset(body=ROBOT, obstacle=p, axes="xy", name=_short(p)) for p in PILLARS),
            *(own.middle_offset(body=ROBOT, obstacle=p, axes="xy", name=_short(p)) for p in BOXES),
            *(t.obstacle_velocity(obstacle=p, axes="xy", name=f"{_short(p)}_velocity") for p in BOXES),
        ),
        rewards=(
            t.progress(body=ROBOT, weight=0.1),
            t.nearness(body=ROBOT, margin=2.0, weight=-0.05),
            t.passing(weight=-0.5),
            t.arrival(body=ROBOT, radius=near, weight=5.0),
            own.crash(body=ROBOT, weight=-1.0),
            own.slip(distance=far, weight=-1.0),
        ),
        ends=(t.reached(body=ROBOT, radius=near, success=True), t.collided(body=ROBOT), t.lost(distance=far)),
        speed_limit=SPEED_LIMIT,
        time_limit=10.0,
        shifts=(Shift(bodies=(ROBOT,), traps=(TRAP,), half=(4.0, 18.0, 0.0)),),
        goal_half=(4.0, 18.0, 0.0),
        expert=ShortestPath,
    )


def _short(prim: str) -> str:
    return prim.rsplit("/", 1)[-1]
