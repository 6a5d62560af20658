"""Points of segments on the device against their twin."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.segments import Segment, nearest_t, place_on, segment_slope
from otwarp.kernels.core.types import ObstacleData
from tests.kernels.samples import evaluate, on_device
from tests.reference.segments import point_segment

ROUNDING = 2e-6
"""float32 coordinates of order 3."""


@wp.kernel(enable_backward=False)
def probe(
    centre: wp.array(dtype=wp.vec3),
    half: wp.array(dtype=wp.vec3),
    point: wp.array(dtype=wp.vec3),
    nearest: wp.array(dtype=wp.vec3),
    slope: wp.array(dtype=wp.vec2),
):
    i = wp.tid()
    rod = Segment(centre[i], half[i])
    nearest[i] = place_on(rod, nearest_t(rod, point[i]))
    # the way from a sphere's centre to the point of the rod at t = ½
    slope[i] = segment_slope(ObstacleData(), 0, Segment(point[i], wp.vec3(0.0)), rod, 0.5, 1.0e9)


def test_nearest_points_are_those_of_the_twin(device):
    """Inside the segment, beyond its ends, and of segments without length, which are spheres."""
    rng, n = np.random.default_rng(0), 500
    centre, half, point = (rng.normal(size=(n, 3)).astype(np.float32) for _ in range(3))
    half[:20] = 0.0
    given = on_device(device, (centre, wp.vec3), (half, wp.vec3), (point, wp.vec3))
    nearest, slope = evaluate(probe, n, given, [wp.vec3, wp.vec2], device)
    for c, h, p, at, seen in zip(*(v.astype(float) for v in (centre, half, point)), nearest, slope, strict=True):
        distance, s = point_segment(p, c - h, c + h)
        assert abs(np.linalg.norm(p - at) - distance) < ROUNDING
        if h.any():
            np.testing.assert_allclose(at, c + (2.0 * s - 1.0) * h, atol=5 * ROUNDING)
            way = c + 0.5 * h - p
            assert abs(seen[1] - np.linalg.norm(way)) < ROUNDING
            assert abs(seen[0] - way @ h / np.linalg.norm(way) / np.linalg.norm(h)) < 10 * ROUNDING
