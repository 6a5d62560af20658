"""Tasks that are decided before they begin, as `otwarp.record.monitor.Monitor` would judge their first frames."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from otwarp.scene.description import Body, Goal, Obstacle
from otwarp.scene.finding import Finding
from otwarp.scene.meshes import inside_mesh, nearest_distance
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.plausibility.holding import Trapped, holds
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import conjugate, rotate

_TOUCH = 0.1
"""How deep a cell at its goal may be pressed into an obstacle, relative to its radius."""


def decided_tasks(scene: Scene) -> Iterator[Finding]:
    """Warnings about a goal that is met, lost or out of the way from the start."""
    goal, bodies = scene.goal, {body.prim: body for body in scene.bodies}
    if goal is None or goal.cell not in bodies or any(robot not in bodies for robot in goal.robots):
        return
    cell, robots = bodies[goal.cell], [bodies[robot] for robot in goal.robots]
    yield from _met(goal, cell)
    yield from _cell_lost(goal, cell, robots)
    yield from _robots_lost(scene, goal, robots)
    yield from _walled_in(goal, cell, scene.obstacles)


def _met(goal: Goal, cell: Body) -> Iterator[Finding]:
    away = float(np.linalg.norm(np.subtract(cell.position, goal.position)))
    if away <= goal.tolerance:
        message = f"the task is delivered at t = 0: {cell.prim} starts {away:.3g} µm from the goal"
        yield Finding(prim=goal.prim, message=f"{message}, tolerance {goal.tolerance:g} µm")


def _cell_lost(goal: Goal, cell: Body, robots: list[Body]) -> Iterator[Finding]:
    middle = np.mean([robot.position for robot in robots], axis=0)
    off = float(np.linalg.norm(cell.position - middle))
    if off > goal.cell_lost_distance:
        message = f"the task is lost at t = 0: {cell.prim} starts {off:.3g} µm from the midpoint of its robots"
        yield Finding(prim=goal.prim, message=f"{message}; ot:goal:cellLostDistance is {goal.cell_lost_distance:g} µm")


def _robots_lost(scene: Scene, goal: Goal, robots: list[Body]) -> Iterator[Finding]:
    """Robots that no trap holds, or whose lit traps are too far from what they hold."""
    traps = list(zip(scene.traps, holds(scene, Trapped.of(scene)), strict=True))
    for robot in robots:
        mine = [(trap, hold) for trap, hold in traps if hold is not None and scene.bodies[hold.body] is robot]
        bright = [(trap, hold) for trap, hold in mine if trap.power.at(0.0)[0] > 0.0]
        if not mine:
            yield Finding(prim=goal.prim, message=f"no trap holds {robot.prim} at t = 0, which is to carry {goal.cell}")
        elif not bright:
            yield Finding(prim=goal.prim, message=f"the task is lost at t = 0: all traps of {robot.prim} are dark")
        far = max(bright, key=lambda pair: pair[1].gap, default=None)
        if far is not None and far[1].gap > goal.lost_distance:
            message = f"the task is lost at t = 0: {far[0].prim} starts {far[1].gap:.3g} µm from its sphere"
            yield Finding(prim=goal.prim, message=f"{message}; ot:goal:lostDistance is {goal.lost_distance:g} µm")


def _walled_in(goal: Goal, cell: Body, obstacles: tuple[Obstacle, ...]) -> Iterator[Finding]:
    """A goal that the cell cannot come close to, because an obstacle at rest is in the way."""
    radius = cell.spheres[0].radius
    for obstacle in obstacles:
        if obstacle.position.animated or obstacle.orientation.animated or not cell.colliding:
            continue
        needed = (1.0 - _TOUCH) * radius - goal.tolerance
        free = _clearance(obstacle, np.array(goal.position), radius)
        if free < needed:
            message = f"{cell.prim} cannot come within {goal.tolerance:g} µm of the goal: {obstacle.prim} is"
            where = f"{free:.3g} µm from it" if free > 0.0 else "around it"
            yield Finding(prim=goal.prim, message=f"{message} {where}, the cell's radius is {radius:g} µm")


def _clearance(obstacle: Obstacle, point: np.ndarray, far: float) -> float:
    """Distance of a point from the surface of an obstacle at the start, negative inside, inf beyond `far` [µm]."""
    turn = obstacle.orientation.at(0.0)
    local = rotate(conjugate(turn / np.linalg.norm(turn)), point - obstacle.position.at(0.0))[None]
    distance = SHAPES[obstacle.shape].distance
    if distance is not None:
        return float(distance(local, np.array(obstacle.size))[0])
    mesh = obstacle.vertices, obstacle.triangles
    return -far if inside_mesh(local, *mesh)[0] else float(nearest_distance(local, np.array([far]), *mesh)[0])
