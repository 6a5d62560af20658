"""Errors, calibration, targets and baselines on numbers whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.vision.datasets import Robot
from otwarp.vision.networks.baselines import Shown, focus_measures, focus_ridge, nearest_template
from otwarp.vision.networks.data import area_weights
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.networks.metrics import confusion, f1, pose_scores, scores_of, spans, widening
from otwarp.vision.networks.predict import Predictions, covariances
from otwarp.vision.networks.targets import Targets, errors, targets_of, turned_round

COUNT = 20_000


@pytest.mark.quick
def test_a_right_covariance_has_its_coverage() -> None:
    rng = np.random.default_rng(2)
    covariance = np.broadcast_to([[0.04, 0.01], [0.01, 0.09]], (COUNT, 2, 2))
    away = rng.standard_normal((COUNT, 2)) @ np.linalg.cholesky(covariance[0]).T
    found = pose_scores(away, covariance, ("depth", "tilt"))
    for p, share in (("68", 0.68), ("95", 0.95)):
        for value in found["coverage"][p].values():
            assert abs(value - share) < 5.0 * math.sqrt(share * (1.0 - share) / COUNT)
    # squared errors over their number: mean 1, deviation √(2/2N) · √… of a χ² with two degrees over two
    assert abs(found["nees"] - 1.0) < 5.0 / math.sqrt(COUNT)
    entropy = 1.0 + math.log(2.0 * math.pi) + 0.5 * np.linalg.slogdet(covariance[0])[1]
    assert abs(found["nll"] - entropy) < 5.0 / math.sqrt(COUNT)
    assert found["rmse"]["tilt"] == pytest.approx(math.degrees(0.3), rel=0.03)
    # who states half of the deviation is told to double it
    assert widening(away, covariance / 4.0) == pytest.approx((2.0, 2.0), rel=5.0 / math.sqrt(2.0 * COUNT))


@pytest.mark.quick
@pytest.mark.parametrize("worst", [[[1.0, 1.0], [1.0, 1.0]], [[np.nan, 0.0], [0.0, 1.0]], [[np.inf, 0.0], [0.0, 1.0]]])
def test_a_covariance_without_an_inverse_is_refused(worst: list[list[float]]) -> None:
    """As of a training that diverged, which ended in NumPy's LinAlgError, or in NaN."""
    with pytest.raises(InputError, match="of 1 of 3 images has no inverse; allowed: a network that has learnt"):
        pose_scores(np.ones((3, 2)), np.array([np.eye(2), worst, np.eye(2)]), ("depth", "tilt"))


def test_classes_are_counted_as_usual() -> None:
    table = confusion(np.array([0, 1, 1, 2]), np.array([0, 1, 2, 2]), 4)
    assert table.tolist() == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 1, 0], [0, 0, 0, 0]]
    assert f1(table) == pytest.approx((1.0 + 2.0 / 3.0 + 2.0 / 3.0) / 3.0)


def labels() -> dict[str, np.ndarray]:
    depth = np.tile(np.linspace(-2.0, 2.0, 5), 2)
    return {"pose": np.repeat([0, 1], 5), "tilt": np.repeat([0.0, 30.0], 5), "tilt_class": np.repeat([0, 1], 5),
            "yaw": np.zeros(10), "x": np.zeros(10), "y": np.linspace(-0.1, 0.1, 10), "depth": depth,
            "depth_normalized": (depth + 2.0) / 4.0}  # fmt: skip


SYMMETRY = {"axial": False, "order": 1, "flip": False, "spherical": False, "rotations": []}


def test_normalised_depths_become_metric_by_the_sweep() -> None:
    index = np.arange(10)
    assert np.allclose(spans(labels(), index), 4.0)
    targets = targets_of(labels(), index, symmetry=SYMMETRY, classes=np.array([0.0, 30.0]))
    assert targets.names == ("y", "depth", "tilt") and targets.others == {"x": 0.0, "yaw": 0.0}
    said = Predictions(scores=np.eye(2)[labels()["tilt_class"]], depth=labels()["depth_normalized"] + 0.05)
    found = scores_of(said, targets, labels(), index)
    assert found["accuracy"] == found["f1"] == 1.0
    assert found["depth_normalized_rmse"] == pytest.approx(0.05) and found["depth_um_rmse"] == pytest.approx(0.2)


def body(*spheres: tuple[float, float, float], radius: float = 0.5) -> dict:
    place = np.array(spheres)
    robot = Robot.of_solids(
        place, place, np.full(len(place), radius), np.full(len(place), 1.5), axis=np.array([1.0, 0, 0])
    )
    return robot.symmetry()


def test_a_robot_that_may_be_turned_round_is_known_as_such() -> None:
    dumbbell = body((-1, 0, 0), (1, 0, 0))
    assert turned_round(dumbbell, False)
    arrow = body((-1, 0, 0), (1, 0, 0), (0.2, 0.9, 0))
    assert not turned_round(arrow, False)
    # a bow in the plane of axis and light: turned about the light it looks the same only where it also rolls
    bow = body((-1, 0, 0), (1, 0, 0), (0, 0, 0.9))
    assert turned_round(bow, False) and turned_round(bow, True)
    flat = body((-1, 0, 0), (1, 0, 0), (0, 0.9, 0))
    assert not turned_round(flat, False) and turned_round(flat, True)
    names = ("tilt", "yaw")
    away = errors(np.array([[-0.2, 3.1]]), np.array([[0.2, -0.05]]), names, mirrored=True)
    assert np.allclose(away, [[0.0, 3.1 - math.pi + 0.05]])
    assert abs(errors(np.array([[-0.2, 3.1]]), np.array([[0.2, -0.05]]), names, mirrored=False)[0, 0]) == pytest.approx(
        0.4
    )


def test_axes_are_compared_as_directions() -> None:
    targets = Targets(
        names=("tilt", "yaw"), offset=(0, 0), scale=(1, 1), others={"x": 0, "y": 0, "depth": 0}, mirrored=True
    )
    upright = {**labels(), "tilt": np.full(10, 90.0)}
    said = Predictions(mean=np.stack([np.full(10, np.radians(89.0)), np.linspace(0, 3, 10)], 1),
                       covariance=np.broadcast_to(np.eye(2), (10, 2, 2)))  # fmt: skip
    # whatever the azimuth of an upright axis is
    assert scores_of(said, targets, upright, np.arange(10))["axis_rmse_deg"] == pytest.approx(1.0, rel=1e-6)


def test_factors_become_covariances_of_physical_quantities() -> None:
    factor = np.array([[[2.0, 0.0], [0.7, 0.5]]])
    scale, widen = np.array([0.5, 3.0]), np.array([1.0, 2.0])
    spread = np.diag(scale * widen)
    assert np.allclose(covariances(factor, scale, widen)[0], spread @ np.linalg.inv(factor[0] @ factor[0].T) @ spread)
    made = Estimate.of(("depth", "tilt"), np.array([1.0, 0.2]), np.array([[0.04, 0.01], [0.01, 0.09]]),
                       {"x": 0.1, "y": 0.0, "yaw": 0.5})  # fmt: skip
    assert made.mean.tolist() == [0.1, 0.0, 1.0, 0.2, 0.5] and made.known == ("depth", "tilt")
    assert made.covariance[2, 3] == 0.01 and made.covariance[0, 0] == np.inf


def test_resizing_keeps_means() -> None:
    for count, wanted in ((224, 64), (64, 64), (64, 48)):
        weights = area_weights(count, wanted)
        assert np.allclose(weights.sum(1), 1.0) and np.allclose(weights.sum(0), wanted / count)
    assert np.array_equal(area_weights(7, 7), np.eye(7))
    assert np.allclose(area_weights(3, 6).sum(1), 1.0)


def shown(rng: np.random.Generator, count: int) -> Shown:
    """Discs that are wider the farther they are out of focus, of two classes of brightness."""
    depth, kind = rng.random(count), rng.integers(2, size=count)
    y, x = np.mgrid[-16:16, -16:16]
    width = 2.0 + 5.0 * depth
    images = (80.0 + 60.0 * kind)[:, None, None] * np.exp(
        -(x**2 + y**2)[None] / (2.0 * width[:, None, None] ** 2)
    ) + 40.0
    images += 2.0 * rng.standard_normal(images.shape)
    return Shown(np.clip(images, 0, 255).astype(np.uint8), kind, depth, depth[:, None] * 3.0)


def test_baselines_find_what_is_plain_to_see() -> None:
    rng = np.random.default_rng(4)
    train, test = shown(rng, 400), shown(rng, 60)
    for baseline in (nearest_template, focus_ridge):
        again = baseline(train, test.images, 2)
        assert again.depth is not None and again.mean is not None and again.scores is not None
        assert np.sqrt(np.mean((again.depth - test.depth) ** 2)) < 0.08
        assert np.sqrt(np.mean((again.mean[:, 0] - 3.0 * test.depth) ** 2)) < 0.24
        if baseline is focus_ridge:
            assert np.mean(np.argmax(again.scores, 1) == test.tilt_class) > 0.95
    # the measures of an image do not depend on what is beside it
    assert np.allclose(focus_measures(test.images)[:5], focus_measures(test.images[:5]), rtol=1e-5, atol=1e-6)
    exact = nearest_template(train, train.images[:20], 2)
    assert exact.depth is not None and np.array_equal(exact.depth, train.depth[:20])
