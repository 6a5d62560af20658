"""The Cramér–Rao bound against closed forms, and the renderer's slopes against larger differences."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from otwarp.vision.networks.bound import bound, fisher_information, pixel_variance
from otwarp.vision.sensor import Sensor


def spot(x: float, width: float, pixel: float, count: int) -> np.ndarray:
    """(count, count) a Gaussian spot of peak 1."""
    place = (np.arange(count) - count // 2) * pixel
    return np.exp(-((place[None, :] - x) ** 2 + place[:, None] ** 2) / (2.0 * width**2))


@pytest.mark.quick
def test_a_spot_of_light_is_known_as_well_as_its_photons_allow() -> None:
    """σ/√N in each direction for N photons without background (Ober et al. 2004, doi:10.1016/S0006-3495(04)74193-4)."""
    width, pixel, step = 0.8, 0.05, 1e-4
    sensor = Sensor(brightness=0.5, electrons=2000.0, noise=0.0, bits=16)
    light = spot(0.0, width, pixel, 201)
    slopes = np.stack([(spot(step, width, pixel, 201) - spot(-step, width, pixel, 201)) / (2 * step), light])
    found = bound(fisher_information(light, slopes, sensor))
    photons = sensor.brightness * sensor.electrons * light.sum()
    # the rounding of 16 bits and the ends of the array cost less than a per mille
    assert math.sqrt(found[0, 0]) == pytest.approx(width / math.sqrt(photons), rel=1e-3)
    # the brightness of the spot: a relative error of 1/√N, independent of where it is
    assert math.sqrt(found[1, 1]) == pytest.approx(1.0 / math.sqrt(photons), rel=1e-3)
    assert abs(found[0, 1]) < 1e-6 * math.sqrt(found[0, 0] * found[1, 1])


def test_with_even_noise_the_bound_is_that_of_least_squares() -> None:
    sensor = Sensor(brightness=1.0, electrons=math.inf, noise=0.02, bits=16)
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((3, 8, 9))
    found = bound(fisher_information(np.full((8, 9), 0.4), slopes, sensor))
    design = slopes.reshape(3, -1)
    assert np.allclose(found, 0.02**2 * np.linalg.inv(design @ design.T), rtol=1e-5)


def test_saturated_pixels_and_useless_parameters_say_nothing() -> None:
    sensor = Sensor(brightness=0.5, electrons=1000.0, noise=0.01)
    assert pixel_variance(np.array([0.3, 1.2]), sensor)[1] == np.inf
    light = np.array([[1.0, 3.0]])
    information = fisher_information(light, np.ones((2, 1, 2)) * [[[1.0]], [[0.0]]], sensor)
    assert information[0, 0] == pytest.approx(0.25 / pixel_variance(np.array(0.5), sensor))
    assert np.all(np.isinf(bound(information)))
    assert bound(information[:1, :1])[0, 0] == pytest.approx(1.0 / information[0, 0])


def test_variance_is_that_of_the_sensor() -> None:
    """Of 40,000 recordings; the standard error of a variance from n of them is √(2/n) of it."""
    for sensor in (Sensor(electrons=500.0, noise=0.02), Sensor(electrons=3000.0, noise=0.004, gamma=2.2)):
        light, count = 0.7, 40_000
        levels = sensor.levels(np.full((200, 200), light), seed=3).astype(float) / 255.0
        linear = levels**sensor.gamma
        expected = float(pixel_variance(np.array(sensor.brightness * light), sensor))
        assert linear.var() == pytest.approx(expected, rel=5.0 * math.sqrt(2.0 / count) + 0.01)


def test_slopes_of_a_data_set_are_those_of_its_images(smoke: Path) -> None:
    from otwarp.vision.datasets import open_dataset
    from otwarp.vision.datasets.shots import pose_intensities
    from otwarp.vision.fourier import Fourier
    from otwarp.vision.networks import bound as module

    data, fourier = open_dataset(smoke), Fourier("cpu")
    labels = module.labels_from(data)
    rows = np.array([85, 100])
    levels = [labels.sensor(int(r)).levels(page, seed=labels.spec.seed, image=int(r))
              for r, page in zip(rows, pose_intensities(labels, 2, fourier, rows), strict=True)]  # fmt: skip
    assert np.array_equal(data.images(rows), levels)  # the data set, rendered again from its manifest
    seen = module.views(labels, 2, rows, ("x", "depth", "tilt"), fourier)
    assert seen.intensity.shape == (2, 64, 64) and seen.slopes.shape == (2, 3, 64, 64)
    # a shift by a whole pixel moves the image by one: the slope is the negative difference along x, to second order
    inside = seen.intensity[:, 8:-8, :]
    across = -(np.roll(inside, -1, 2) - np.roll(inside, 1, 2)) / (2 * 0.125)
    ours = seen.slopes[:, 0, 8:-8, :]
    part = (slice(None), slice(None), slice(8, -8))
    assert np.corrcoef(across[part].ravel(), ours[part].ravel())[0, 1] > 0.99
    for step in (0.25, 1.0):
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(module.STEPS, "tilt", step)
            other = module.views(labels, 2, rows, ("tilt",), fourier).slopes[:, 0]
        # slices of 0.1 µm are smoothed at their borders, so that slopes hardly depend on the step
        assert np.sqrt(np.mean((other - seen.slopes[:, 2]) ** 2)) < 0.1 * np.sqrt(np.mean(other**2))
    which, variance = module.bounds(data, np.arange(80, 120), ("x", "y", "depth", "tilt"), poses=1, device="cpu")
    assert np.array_equal(which, np.arange(80, 120)) and np.all(np.isfinite(variance)) and np.all(variance > 0.0)
