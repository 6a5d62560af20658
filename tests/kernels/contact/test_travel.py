"""How far obstacles move in a step, and how far motion across a contact lifts its gap."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.travel import closing_of, closing_on, lift_of, obstacle_drift, obstacle_travel, opening_of
from otwarp.kernels.core.rotation import rotate_by
from otwarp.kernels.core.types import Move, Pose
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference.rotations import matrix

ROUNDING = 2e-6
"""float32 coordinates of order 5."""


@wp.kernel(enable_backward=False)
def probe(
    place: wp.array(dtype=wp.vec3),
    turn: wp.array(dtype=wp.quat),
    later: wp.array(dtype=wp.vec3),
    turned: wp.array(dtype=wp.quat),
    point: wp.array(dtype=wp.vec3),
    drift: wp.array(dtype=wp.vec3),
    travel: wp.array(dtype=float),
):
    i = wp.tid()
    now = Pose(place[i], turn[i])
    then = Pose(later[i], turned[i])
    drift[i] = obstacle_drift(now, then, point[i])
    travel[i] = obstacle_travel(now, then, wp.length(point[i]))


def test_points_move_as_the_poses_do_and_no_farther_than_the_bound(device):
    rng, n = np.random.default_rng(0), 300
    place, later, point = (rng.normal(size=(n, 3)).astype(np.float32) for _ in range(3))
    turn, turned = quaternions(rng, n), quaternions(rng, n)
    turned[:50], later[50:100] = turn[:50], place[50:100]
    rows = (place, wp.vec3), (turn, wp.quat), (later, wp.vec3), (turned, wp.quat), (point, wp.vec3)
    drift, travel = evaluate(probe, n, on_device(device, *rows), [wp.vec3, float], device)
    wide = [v.astype(float) for v, _ in rows]
    expected = [y + matrix(r) @ p - x - matrix(q) @ p for x, q, y, r, p in zip(*wide, strict=True)]
    np.testing.assert_allclose(drift, expected, atol=ROUNDING)
    assert np.all(np.linalg.norm(drift, axis=1) <= travel + ROUNDING)
    # an obstacle that does not turn moves every point alike, without rounding
    np.testing.assert_array_equal(drift[:50], (later - place)[:50])


@wp.kernel(enable_backward=False)
def probe_closing(
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    arm: wp.array(dtype=wp.vec3),
    way: wp.array(dtype=wp.vec3),
    onto: wp.array(dtype=float),
    between: wp.array(dtype=float),
):
    """How far a body closes its gap to an obstacle, and to a body that does not move."""
    i = wp.tid()
    move, still = Move(linear[i], angular[i]), Move(wp.vec3(0.0), wp.vec3(0.0))
    onto[i] = closing_on(move, arm[i], wp.normalize(way[i]))
    between[i] = closing_of(move, still, arm[i], wp.vec3(0.0), way[i])


def test_gaps_close_by_what_leads_into_them(device):
    rng, n = np.random.default_rng(4), 300
    rows = [rng.normal(size=(n, 3)).astype(np.float32) for _ in range(4)]
    onto, between = evaluate(probe_closing, n, on_device(device, *((v, wp.vec3) for v in rows)), [float, float], device)
    linear, angular, arm, way = (v.astype(float) for v in rows)
    normal = way / np.linalg.norm(way, axis=1, keepdims=True)
    expected = np.maximum(-np.einsum("ni,ni->n", linear + np.cross(angular, arm), normal), 0.0)
    np.testing.assert_allclose(onto, expected, atol=ROUNDING)
    np.testing.assert_allclose(between, expected, atol=ROUNDING)


@wp.kernel(enable_backward=False)
def probe_lift(
    arm_a: wp.array(dtype=wp.vec3),
    arm_b: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    lift: wp.array(dtype=float),
    truth: wp.array(dtype=float),
):
    """Lift of two touching spheres, and what is right: the part of the opened gap that no move along the normal has."""
    i = wp.tid()
    c = Contact()
    c.b = 1
    c.arm_a = arm_a[i]
    c.arm_b = arm_b[i]
    c.normal = normal[i]
    c.curvature = 0.5
    move_a = Move(linear[i], angular[i])
    move_b = Move(-0.5 * linear[i], 0.3 * angular[i])
    lift[i] = lift_of(c, move_a, move_b)
    # about the reference point of a: centres after the step, less what the moves do along the normal
    turn_a = wp.quat_rotate(rotate_by(wp.quat_identity(), move_a.angular), c.arm_a) - c.arm_a
    turn_b = wp.quat_rotate(rotate_by(wp.quat_identity(), move_b.angular), c.arm_b) - c.arm_b
    way = 2.0 * c.normal + move_a.linear + turn_a - move_b.linear - turn_b
    way -= (opening_of(c, move_a, move_b)) * c.normal
    truth[i] = wp.length(way) - 2.0


def test_a_lift_is_what_the_gap_opens_across_its_normal(device):
    """Two spheres whose centres are 2 µm apart, on bodies that shift and turn: a third of the moves, 27 times the error
    less."""
    rng, n = np.random.default_rng(1), 300
    normal = rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    arms, linear, angular = rng.normal(size=(2, n, 3)), 0.1 * rng.normal(size=(n, 3)), 0.05 * rng.normal(size=(n, 3))
    errors, sizes = [], []
    for share in (1.0, 1.0 / 3.0):
        rows = (*arms, normal, share * linear, share * angular)
        given = on_device(device, *((v.astype(np.float32), wp.vec3) for v in rows))
        lift, truth = evaluate(probe_lift, n, given, [float, float], device)
        errors.append(np.sqrt(np.mean((lift - truth) ** 2)))
        sizes.append(np.sqrt(np.mean(truth**2)))
    assert errors[0] < 0.2 * sizes[0]
    assert errors[1] < errors[0] / 20.0
    assert sizes[1] > sizes[0] / 12.0


@wp.kernel(enable_backward=False)
def probe_flat(ridge: wp.array(dtype=wp.vec3), moved: wp.array(dtype=wp.vec3), lift: wp.array(dtype=float)):
    """Lift of a sphere that moves past an obstacle of curvature ½ along z."""
    i = wp.tid()
    c = Contact()
    c.b = -1
    c.normal = wp.vec3(0.0, 0.0, 1.0)
    c.curvature = 0.5
    c.ridge = ridge[i]
    c.drift = wp.vec3(0.1, 0.0, 0.0)
    lift[i] = lift_of(c, Move(moved[i], wp.vec3(0.0)), Move(wp.vec3(0.0), wp.vec3(0.0)))


def test_nothing_lifts_along_a_ridge_or_with_the_obstacle(device):
    """2 − √(4 − t²) of what is across ridge and normal and relative to the obstacle, exactly."""
    across = 2.0 - np.sqrt(4.0 - 0.3**2)
    cases = [((0, 0, 0), (0.1, 0.3, 5.0), across), ((0, 1, 0), (0.1, 0.3, 0.0), 0.0), ((0, 1, 0), (0.4, 9, 9), across)]
    rows = on_device(device, *((np.array([c[k] for c in cases], dtype=np.float32), wp.vec3) for k in (0, 1)))
    (lift,) = evaluate(probe_flat, len(cases), rows, [float], device)
    np.testing.assert_allclose(lift, [c[2] for c in cases], rtol=1e-5, atol=1e-9)
