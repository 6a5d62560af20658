"""How far obstacles move in a step: the drift of each point, and a bound on it."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.travel import obstacle_drift, obstacle_travel
from otwarp.kernels.core.types import Pose
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
