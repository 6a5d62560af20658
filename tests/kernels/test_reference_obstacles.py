"""The NumPy twins of obstacles, flow and key frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Flow
from tests.reference.flow import flow_at
from tests.reference.keyframes import interpolate, interpolate_rotation
from tests.reference.obstacles import SHAPES, signed_distance
from tests.reference.rotations import exponential, matrix, multiply

SIZES = {
    "plane": np.zeros(3),
    "box": np.array([1.0, 0.6, 0.8]),
    "sphere": np.array([1.1, 0, 0]),
    "cylinder": np.array([0.7, 0.9, 0]),
    "capsule": np.array([0.5, 0.8, 0]),
}
POINTS = np.random.default_rng(0).uniform(-2, 2, size=(60, 3))


def inside(shape: str, p: np.ndarray) -> bool:
    """Membership straight from the definition of each shape."""
    s = SIZES[shape]
    return {
        "plane": p[2] < 0,
        "box": bool(np.all(np.abs(p) < s)),
        "sphere": p @ p < s[0] ** 2,
        "cylinder": p[0] ** 2 + p[1] ** 2 < s[0] ** 2 and abs(p[2]) < s[1],
        "capsule": p[0] ** 2 + p[1] ** 2 + max(abs(p[2]) - s[1], 0) ** 2 < s[0] ** 2,
    }[shape]


@pytest.mark.parametrize("shape", SHAPES)
def test_sign_says_inside(shape):
    answers = [inside(shape, p) for p in POINTS]
    assert any(answers)
    assert not all(answers)
    for p, answer in zip(POINTS, answers, strict=True):
        assert (SHAPES[shape](p, SIZES[shape])[0] < 0) == answer


@pytest.mark.parametrize("shape", SHAPES)
def test_normal_is_the_gradient(shape):
    h = 1e-6
    for p in POINTS:  # almost surely none on an edge of the medial axis
        _, normal = SHAPES[shape](p, SIZES[shape])
        slope = [
            (SHAPES[shape](p + h * e, SIZES[shape])[0] - SHAPES[shape](p - h * e, SIZES[shape])[0]) / (2 * h)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(normal, slope, atol=1e-5)
        assert np.linalg.norm(normal) == pytest.approx(1)


@pytest.mark.parametrize("shape", SHAPES)
def test_going_back_along_the_normal_ends_on_the_surface(shape):
    for p in POINTS:
        distance, normal = SHAPES[shape](p, SIZES[shape])
        assert SHAPES[shape](p - distance * normal, SIZES[shape])[0] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("shape", "point", "distance", "normal"),
    [
        ("box", (0, 0, 0), -0.6, (0, 1, 0)),
        ("sphere", (0, 0, 0), -1.1, (0, 0, 1)),
        ("capsule", (0, 0, 0.3), -0.5, (1, 0, 0)),
        ("cylinder", (0, 0, 0.5), -0.4, (0, 0, 1)),
        ("cylinder", (0, 0, -1.9), 1.0, (0, 0, -1)),
        ("cylinder", (1.0, 0, 1.3), 0.5, (0.6, 0, 0.8)),
        ("box", (1.3, 1.0, 0), 0.5, (0.6, 0.8, 0)),
    ],
)
def test_points_by_hand(shape, point, distance, normal):
    d, n = SHAPES[shape](np.array(point, dtype=float), SIZES[shape])
    assert d == pytest.approx(distance)
    np.testing.assert_allclose(n, normal, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_pose_moves_the_shape_and_nothing_else(shape):
    q, position = exponential(np.array([0.3, 1.1, -0.5])), np.array([4.0, -2.0, 1.0])
    for p in POINTS[:10]:
        local = SHAPES[shape](p, SIZES[shape])
        moved = signed_distance(shape, SIZES[shape], position, q, position + matrix(q) @ p)
        assert moved[0] == pytest.approx(local[0])
        np.testing.assert_allclose(moved[1], matrix(q) @ local[1], atol=1e-12)


FLOWS = [
    Flow(prim="/F", kind="uniform", speed=3.0),
    Flow(prim="/F", kind="shear", shear_rate=0.7),
    Flow(prim="/F", kind="poiseuille", speed=5.0, half_height=4.0),
]


@pytest.mark.parametrize("flow", FLOWS, ids=lambda f: f.kind)
def test_angular_velocity_is_half_the_curl_and_flow_is_incompressible(flow):
    q = exponential(np.array([0.5, -0.2, 0.9]))
    flow = dataclasses.replace(flow, origin=(1.0, 2.0, 3.0), orientation=tuple(q))
    h = 1e-5
    for p in POINTS[:10] + np.array([1.0, 2.0, 3.0]):
        gradient = np.stack([(flow_at(flow, p + h * e)[0] - flow_at(flow, p - h * e)[0]) / (2 * h) for e in np.eye(3)])
        curl = [
            gradient[1, 2] - gradient[2, 1], gradient[2, 0] - gradient[0, 2], gradient[0, 1] - gradient[1, 0]
        ]  # fmt: skip
        np.testing.assert_allclose(flow_at(flow, p)[1], 0.5 * np.array(curl), atol=1e-8)
        assert np.trace(gradient) == pytest.approx(0, abs=1e-8)


def test_profiles_by_hand():
    uniform, shear, channel = FLOWS
    p = np.array([7.0, -3.0, 2.0])
    np.testing.assert_allclose(flow_at(uniform, p)[0], [3, 0, 0])
    np.testing.assert_allclose(flow_at(shear, p)[0], [1.4, 0, 0])
    np.testing.assert_allclose(flow_at(shear, p)[1], [0, 0.35, 0])
    np.testing.assert_allclose(flow_at(channel, p)[0], [5 * 0.75, 0, 0])
    np.testing.assert_allclose(flow_at(channel, np.array([0, 0, 4.0]))[0], 0)
    np.testing.assert_array_equal(flow_at(channel, np.array([0, 0, 4.1])), 0)


TIMES = np.array([1.0, 2.0, 4.0])
VALUES = np.array([[0.0, 0], [1, 10], [5, -10]])


def test_keyframes():
    np.testing.assert_array_equal(interpolate(TIMES, VALUES, 0.0), VALUES[0])
    np.testing.assert_array_equal(interpolate(TIMES, VALUES, 9.0), VALUES[2])
    np.testing.assert_allclose(interpolate(TIMES, VALUES, 2.5), [2, 5])
    np.testing.assert_allclose(interpolate(TIMES, VALUES, 2.0), VALUES[1])
    np.testing.assert_array_equal(interpolate(TIMES[:1], VALUES[:1], 3.0), VALUES[0])
    for t in np.linspace(0.5, 4.5, 41):
        expected = [np.interp(t, TIMES, column) for column in VALUES.T]
        np.testing.assert_allclose(interpolate(TIMES, VALUES, t), expected, atol=1e-12)


def test_rotations_stay_on_the_arc():
    """Half way between two rotations about one axis is the mean angle; elsewhere the axis is kept, the norm is 1."""
    first, last = exponential(np.array([0, 0, 0.2])), exponential(np.array([0, 0, 1.4]))
    times, keys = np.array([0.0, 2.0]), np.array([first, last])
    np.testing.assert_allclose(interpolate_rotation(times, keys, 1.0), exponential(np.array([0, 0, 0.8])))
    q = interpolate_rotation(times, keys, 0.3)
    assert np.linalg.norm(q) == pytest.approx(1)
    np.testing.assert_array_equal(q[:2], 0)
    turn = exponential(np.array([0.7, 0.1, 0.0]))
    turned = np.array([multiply(turn, first), multiply(turn, last)])
    np.testing.assert_allclose(interpolate_rotation(times, turned, 0.3), multiply(turn, q), atol=1e-14)


def test_faxen_is_the_mean_over_the_surface():
    """Six points on a sphere integrate quadratic profiles exactly."""
    channel = FLOWS[2]
    p, a = np.array([7.0, -3.0, 1.0]), 0.8
    mean = np.mean([flow_at(channel, p + s * a * e)[0] for s in (-1, 1) for e in np.eye(3)], axis=0)
    np.testing.assert_allclose(flow_at(channel, p, a)[0], mean, rtol=1e-12)
    assert flow_at(channel, np.zeros(3), 0.2 * channel.half_height)[0][0] == pytest.approx(0.98667 * 5, rel=1e-5)
