"""How far bodies and obstacles move in one step, as far as contacts must know it beforehand."""

import warp as wp

from otwarp.kernels.contact.contact import Contact, along
from otwarp.kernels.contact.excursion import FARTHEST
from otwarp.kernels.core.faults import finite
from otwarp.kernels.core.medium import thermal_energy_of, viscosity_of
from otwarp.kernels.core.reads import mat66_at
from otwarp.kernels.core.roots import direction_of, length_of, reciprocal, square_root
from otwarp.kernels.core.types import ModelData, Move, Pose


@wp.func
def free_travel(model: ModelData, b: int, move: Move) -> float:
    """How far any point of a body moves in one step at most without contacts [µm]; 0 for a move that is a fault."""
    travel = length_of(move.linear) + length_of(move.angular) * model.body.bound[b]
    return wp.where(finite(move.linear) and finite(move.angular), travel, 0.0)


@wp.func
def closing_of(move_a: Move, move_b: Move, arm_a: wp.vec3, arm_b: wp.vec3, way: wp.vec3) -> float:
    """How far the free moves close the gap between the points at the arms [µm]; `way` leads from b to a."""
    n = direction_of(way)
    return wp.max(along(move_b, arm_b, n) - along(move_a, arm_a, n), 0.0)


@wp.func
def closing_on(move: Move, arm: wp.vec3, normal: wp.vec3) -> float:
    """How far a free move brings the point at the arm nearer to an obstacle [µm]; `normal` leads away from it."""
    return wp.max(-along(move, arm, normal), 0.0)


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
    chord = 2.0 * length_of(wp.vec3(turn[0], turn[1], turn[2]))
    return length_of(later.position - wall.position) + chord * distance


@wp.func
def opening_of(c: Contact, move_a: Move, move_b: Move) -> float:
    """How far the free moves of the bodies, and that of an obstacle, open the gap of a contact [µm]."""
    opening = along(move_a, c.arm_a, c.normal) - wp.dot(c.drift, c.normal)
    if c.b >= 0:
        opening -= along(move_b, c.arm_b, c.normal)
    return opening


@wp.func
def lift_of(c: Contact, move_a: Move, move_b: Move) -> float:
    """How far all moves of a step open the gap of a contact beyond what they do along its normal [µm].

    Of two spheres whose centres are d apart where they touch, a move t across the normal opens the gap by
    d − √(d² − t²) ≈ t²/2d: always more, and with noise by s²/d a step on average, which is a share 2·k·dt/γ of the mean
    gap of two beads that a spring presses together. Likewise by −½ n·(ω × (ω × arm)) less where a body turns.
    """
    way = move_a.linear + wp.cross(move_a.angular, c.arm_a) - c.drift
    bow = wp.cross(move_a.angular, wp.cross(move_a.angular, c.arm_a))
    if c.b >= 0:
        way -= move_b.linear + wp.cross(move_b.angular, c.arm_b)
        bow -= wp.cross(move_b.angular, wp.cross(move_b.angular, c.arm_b))
    across = way - wp.dot(way, c.normal) * c.normal - wp.dot(way, c.ridge) * c.ridge
    square = wp.length_sq(across)
    bent = c.curvature * square * reciprocal(1.0 + square_root(wp.max(1.0 - c.curvature * c.curvature * square, 0.0)))
    return bent + 0.5 * wp.dot(bow, c.normal)


@wp.func
def wander_of(model: ModelData, world: int, b: int) -> float:
    """Largest variance of the thermal displacement of any point of a body along an axis in one step [µm²], about."""
    shape = model.body.shape[b]
    mobility = float(0.0)
    if model.body.rigid[b] != 0:
        m = mat66_at(model.body.mobility, shape)
        bound = model.body.bound[b]
        mobility = wp.max(m[0, 0], wp.max(m[1, 1], m[2, 2]))
        mobility += wp.max(m[3, 3], wp.max(m[4, 4], m[5, 5])) * bound * bound
    else:
        mobility = model.body.translation[shape]
    energy = thermal_energy_of(model, world)
    viscosity = viscosity_of(model, world)
    return 2.0 * energy * mobility * wp.float32(model.time_step) / viscosity


@wp.func
def thermal_reach(variance: float) -> float:
    """Gap that a path of that variance may close and open again within a step [µm]."""
    return FARTHEST * square_root(variance)
