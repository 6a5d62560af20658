"""Poses of rendered images: found again by templates, with a covariance that says how well."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Camera, Scene, Sphere
from otwarp.vision.fourier import Fourier
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.specimen import Specimen
from otwarp.vision.tracking.matching import Matcher, TemplateErrors, with_errors
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.templates import Templates, posed
from otwarp.vision.view import microscope_of, sensor_of

SIZE = 64
HOW = Rendering(rings=1, thickness=0.25, margin=1.0)
NAME = "/World/dumbbell"
ENDS = [
    Sphere(prim=f"{NAME}/{n}", offset=(x, 0.0, 0.0), radius=r) for n, x, r in (("big", 0.9, 0.8), ("small", -0.9, 0.6))
]
SCENE = Scene(
    bodies=(Body(prim=NAME, spheres=tuple(ENDS)),), camera=Camera(prim="/World/camera", pixel_size=0.11, frame=(20, 20))
)
SHAPE = Shape.of(SCENE, NAME, np.zeros(3))


def photograph(pose: np.ndarray, seed: int) -> np.ndarray:
    """(SIZE, SIZE) grey levels of the body at x, y, depth, tilt, yaw."""
    x, y, depth, tilt, yaw = pose
    still = posed(SCENE, NAME, SHAPE, tilt)
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    start, end = (e @ turn.T + [x, y, depth] for e in (still.start, still.end))
    specimen = Specimen(start, end, still.radius, still.index)
    light = expose(specimen, microscope_of(SCENE), SIZE, rendering=HOW, fourier=Fourier("cpu"))
    return sensor_of(SCENE).levels(light.images([0.0])[0], seed=seed)


def poses(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high = np.array([-0.2, -0.2, -0.5, -0.3, -math.pi]), np.array([0.2, 0.2, 0.5, 0.3, math.pi])
    return rng.uniform(low, high, (count, 5))


@pytest.fixture(scope="module")
def matcher() -> Matcher:
    templates = Templates.of_body(
        SCENE, NAME, SHAPE, size=SIZE, depths=(-0.75, 0.75), tilts=(-0.4, 0.4), rendering=HOW, device="cpu"
    )
    known = poses(8, 5)
    return with_errors(Matcher(templates), known, np.array([photograph(p, n) for n, p in enumerate(known)]))


@pytest.mark.thorough
@pytest.mark.quick
def test_poses_are_found_again_without_a_guess(matcher: Matcher) -> None:
    """x and y to 10 nm, depth to 40 nm, tilt to 2°, yaw to 1°, and within what the covariance says."""
    squares = []
    for n, pose in enumerate(poses(6, 9)):
        match = matcher.estimate(photograph(pose, 100 + n))
        off = match.estimate.mean - pose
        off[4] = (off[4] + math.pi) % (2.0 * math.pi) - math.pi
        assert np.all(np.abs(off) < [0.01, 0.01, 0.04, 0.04, 0.02])
        assert match.correlation > 0.8
        squares.append(float(off @ np.linalg.solve(match.estimate.covariance, off)) / 5.0)
    # 30 degrees of freedom: √(2/30) is 0.26; of eight images the covariance itself is known to a quarter
    assert 0.1 < np.mean(squares) < 1.0 + 5.0 * 0.26 + 1.0


@pytest.mark.quick
def test_errors_are_those_of_poses_nearby() -> None:
    """Measured 1 nm at one tilt and 10 nm at another: there so much, in between some of both, nowhere less."""
    depth, tilt = np.zeros(8), np.repeat([0.0, 1.0], 4)
    squares = np.repeat([[1e-3], [1e-2]], 4, axis=0) ** 2 * np.ones(5)
    errors = TemplateErrors(depth, tilt, squares)
    flat, between, steep = (np.sqrt(errors.variance(0.0, t)) for t in (0.0, 0.5, 1.0))
    # a prior of 0.3 in 4.3 of a mean square of 50.5 nm² is 3.5 nm²
    assert np.all((flat > 1e-3) & (flat < 2.3e-3)) and np.all((steep > 9.5e-3) & (steep < 1e-2))
    assert np.all((between > 6e-3) & (between < 8e-3))
    # far from all of them the mean of all counts
    assert np.allclose(errors.variance(0.0, 9.0), squares.mean(axis=0) + 1e-8)


@pytest.mark.quick
def test_derivatives_of_an_image_are_those_of_its_pose(matcher: Matcher) -> None:
    pose, step = np.array([0.05, -0.1, 0.12, 0.11, 0.7]), 1e-4
    _, slopes = matcher.templates.image((SIZE, SIZE), *pose)
    for k in range(5):
        ends = [matcher.templates.image((SIZE, SIZE), *(pose + sign * step * np.eye(5)[k]))[0] for sign in (1, -1)]
        right = (ends[0] - ends[1]) / (2.0 * step)
        # by x, y and yaw from differences of pixels, which waves of a few pixels' length blur
        assert np.sqrt(np.mean((slopes[k] - right) ** 2) / np.mean(right**2)) < (1e-3 if k in (2, 3) else 0.1)


@pytest.mark.quick
def test_templates_that_cannot_be_are_refused() -> None:
    for options, what in (
        ({"depths": (1.0, -1.0), "tilts": (0.0, 0.1)}, "depths of the templates are 1 to -1"),
        ({"depths": (0.0, math.nan), "tilts": (0.0, 0.1)}, "depths of the templates"),
        ({"depths": (-900.0, 900.0), "tilts": (-1.0, 1.0)}, "allowed: up to 4000 templates"),
    ):
        with pytest.raises(InputError, match=what):
            Templates.of_body(SCENE, NAME, SHAPE, size=SIZE, device="cpu", **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="body is /World/none"):
        Templates.of_body(SCENE, "/World/none", SHAPE, size=SIZE, depths=(0.0, 1.0), tilts=(0.0, 0.1))
