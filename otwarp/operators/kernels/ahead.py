"""Whether an obstacle that moves is about to be in the way, and whether waiting would help.

A simulated operator sees where it was a visual delay ago and how fast, and expects it to go on so. Of going on along
the path and of waiting where the last submovement ends, the one that keeps farther from it is chosen, unless going on
keeps the clearance that the operator wants.
"""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.contact.obstacles import distance_term, moving_pose
from otwarp.kernels.core.types import ModelData
from otwarp.operators.kernels.courses import path_at
from otwarp.operators.kernels.types import AT_A_GLANCE, MindData, Person, TaskData

GLIMPSE = wp.constant(0.1)
"""Seconds over which a speed is seen."""
CLEAR = wp.constant(1.0e6)
"""Gap where nothing is in the way [µm]."""


@wp.func
def never_waits(model: ModelData, task: TaskData, mind: MindData, person: Person, world: int) -> bool:
    """No obstacle of the scene moves: nothing to compare."""
    return False


@functools.lru_cache(maxsize=16)
def waits_term(shapes: tuple[str, ...]) -> Any:
    """`(model, task, mind, person, world) -> bool`: whether an operator waits, for obstacles of these shapes."""
    if not shapes:
        return never_waits
    distance = distance_term(shapes)

    @wp.func
    def gap(model: ModelData, task: TaskData, obstacle: int, center: wp.vec3, turned: wp.quat, way: wp.vec3d,
            body: int, hand: int) -> float:  # fmt: skip
        """Smallest gap [µm] between a carried body that has gone `way` [m] of its hand, and an obstacle there."""
        shift = wp.vec3(task.gain * (task.axes[hand] * way))
        least = float(CLEAR)
        for i in range(model.contact.start[body], model.contact.start[body + 1]):
            sphere = model.contact.sphere[i]
            offset = wp.quat_rotate(task.turned[body], wp.vec3(sphere[0], sphere[1], sphere[2]))
            point = wp.quat_rotate_inv(turned, task.place[body] + shift + offset - center)
            found = distance(model.obstacles, obstacle, point, CLEAR)
            least = wp.min(least, found[3] - sphere[3])
        return least

    @wp.func
    def waits(model: ModelData, task: TaskData, mind: MindData, person: Person, world: int) -> bool:
        """Whether an operator waits: going on would come too close to a moving obstacle, and waiting less so."""
        now = task.period * wp.float64(mind.tick[world] - person.visual_delay)
        glimpse = wp.float64(GLIMPSE)
        going, staying = float(CLEAR), float(CLEAR)
        for m in range(task.moving.shape[0]):
            obstacle = task.moving[m]
            seen = moving_pose(model.obstacles, obstacle, now)
            before = moving_pose(model.obstacles, obstacle, now - glimpse)
            for n in range(AT_A_GLANCE):
                ahead = person.horizon * wp.float64(n + 1) / wp.float64(AT_A_GLANCE)
                passed = wp.float32((task.period * wp.float64(person.visual_delay) + ahead) / glimpse)
                center = seen.position + passed * (seen.position - before.position)
                on = wp.max(mind.aim[world], mind.progress[world] + person.pace * ahead)
                for c in range(task.carried.shape[0]):
                    body, hand = task.carried[c][0], task.carried[c][1]
                    goes = path_at(task.path, hand, task.spacing, on)
                    stays = path_at(task.path, hand, task.spacing, mind.aim[world])
                    going = wp.min(going, gap(model, task, obstacle, center, seen.rotation, goes, body, hand))
                    staying = wp.min(staying, gap(model, task, obstacle, center, seen.rotation, stays, body, hand))
        return going < wp.float32(person.clearance) and staying > going

    return waits
