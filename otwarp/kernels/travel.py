"""How far bodies and obstacles move in one step, as far as contacts must know it beforehand."""

import warp as wp

from otwarp.kernels.contact import along
from otwarp.kernels.faults import finite
from otwarp.kernels.types import ModelData, Move, Pose


@wp.func
def free_travel(model: ModelData, b: int, move: Move) -> float:
    """How far any point of a body moves in one step at most without contacts [µm]; 0 for a move that is a fault."""
    travel = wp.length(move.linear) + wp.length(move.angular) * model.body.bound[b]
    return wp.where(finite(move.linear) and finite(move.angular), travel, 0.0)


@wp.func
def closing_of(move_a: Move, move_b: Move, arm_a: wp.vec3, arm_b: wp.vec3, way: wp.vec3) -> float:
    """How far the free moves close the gap between the points at the arms [µm]; `way` leads from b to a."""
    n = wp.normalize(way)
    return wp.max(along(move_b, arm_b, n) - along(move_a, arm_a, n), 0.0)


@wp.func
def obstacle_drift(wall: Pose, later: Pose, point: wp.vec3) -> wp.vec3:
    """Displacement in one step of the obstacle's material point that is at `point` of its own frame [µm].

    The translation apart, so that an obstacle that does not turn gives it without rounding.
    """
    turned = wp.quat_rotate(later.rotation, point) - wp.quat_rotate(wall.rotation, point)
    return later.position - wall.position + turned


@wp.func
def obstacle_travel(wall: Pose, later: Pose, distance: float) -> float:
    """How far points within `distance` of an obstacle's origin move in one step at most [µm]."""
    turn = wp.quat_inverse(wall.rotation) * later.rotation
    chord = 2.0 * wp.length(wp.vec3(turn[0], turn[1], turn[2]))
    return wp.length(later.position - wall.position) + chord * distance
