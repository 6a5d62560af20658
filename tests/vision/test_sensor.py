"""Grey levels: noise has the cumulants of photoelectrons and reading, depends on its keys alone, and levels are whole.

Seeds are fixed; a mean fails at five standard errors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from otwarp.vision.sensor import FEW, Sensor

pytestmark = pytest.mark.quick

SIGMAS = 5.0
COUNT = 10**6


def recorded(light: float, seed: int = 5, **given: Any) -> np.ndarray:
    """(COUNT) of full scale, of a sensor whose steps are far finer than its noise."""
    levels = Sensor(brightness=1.0, bits=16, **given).levels(np.full((1000, COUNT // 1000), light), seed=seed)
    return levels.ravel() / 65535.0


@pytest.mark.parametrize(("light", "electrons", "noise"), [
    (0.35, 10000.0, 0.01), (0.35, 10000.0, 0.0), (0.4, 1000.0, 0.001), (0.5, 1.2 * FEW / 0.5, 0.0),
    (0.5, 0.8 * FEW / 0.5, 0.0), (0.2, 100.0, 0.02),
])  # fmt: skip
def test_noise_has_the_cumulants_of_electrons_and_reading(light: float, electrons: float, noise: float) -> None:
    """Mean λ, variance λ + σ² and third cumulant λ, above and below the mean from which one normal number does."""
    got = recorded(light, electrons=electrons, noise=noise) * electrons
    mean, variance = light * electrons, light * electrons + (noise * electrons) ** 2
    away = got - mean
    assert abs(away.mean()) < SIGMAS * (variance / COUNT) ** 0.5 + 0.5 * electrons / 65535
    assert away.var() == pytest.approx(variance, rel=SIGMAS * (2.5 / COUNT) ** 0.5 + 1e-3)
    assert (away**3).mean() == pytest.approx(mean, abs=SIGMAS * (25.0 * variance**3 / COUNT) ** 0.5)


def test_few_electrons_are_poisson() -> None:
    from scipy.stats import chisquare, poisson

    got = np.rint(recorded(0.1, electrons=40.0, noise=0.0) * 40.0).astype(int)
    seen = np.bincount(got, minlength=13)[:13]
    expected = poisson.pmf(np.arange(13), 4.0) * COUNT
    assert chisquare(seen, expected * seen.sum() / expected.sum()).pvalue > 1e-6


def test_without_reading_noise_electrons_are_whole() -> None:
    got = recorded(0.5, electrons=600.0, noise=0.0) * 600.0
    assert np.abs(got - np.rint(got)).max() < 0.6 * 600.0 / 65535 + 1e-3


def test_levels_depend_on_their_keys_alone() -> None:
    sensor, light = Sensor(nonuniformity=0.02), np.linspace(0.5, 1.5, 64 * 64).reshape(64, 64)
    first = sensor.levels(light, seed=3, image=7)
    assert first.dtype == np.uint8
    assert np.array_equal(first, sensor.levels(light.astype(np.float32), seed=3, image=7))
    assert not np.array_equal(first, sensor.levels(light, seed=3, image=8))
    assert not np.array_equal(first, sensor.levels(light, seed=4, image=7))
    # version 2 of the noise: whoever changes these numbers changes NOISE
    assert Sensor().levels(np.ones((2, 4)), seed=1, image=2).tolist() == [[86, 89, 95, 84], [90, 89, 88, 93]]


def test_without_noise_levels_are_the_light() -> None:
    light = np.array([[0.0, 0.5, 1.0, 4.0]])
    quiet: dict[str, Any] = {"electrons": np.inf, "noise": 0.0}
    assert Sensor(brightness=0.5, **quiet).levels(light).tolist() == [[0, 64, 128, 255]]
    assert Sensor(brightness=0.5, gamma=2.0, **quiet).levels(light).tolist() == [[0, 128, 180, 255]]
    assert Sensor(brightness=0.5, bits=12, **quiet).levels(light).tolist() == [[0, 1024, 2048, 4095]]
    # numbers beyond float32, and no light at all
    assert Sensor(brightness=0.5, electrons=1e300, noise=0.0).levels(light).tolist() == [[0, 64, 128, 255]]
    assert not Sensor(noise=0.0).levels(np.zeros((4, 4))).any()


def test_pixels_that_differ_do_so_in_every_image() -> None:
    sensor = Sensor(nonuniformity=0.05, electrons=np.inf, noise=0.0, bits=16)
    first, last = (sensor.levels(np.ones((32, 32)), seed=3, image=n) for n in (1, 2))
    assert np.array_equal(first, last)
    assert first.std() / first.mean() == pytest.approx(0.05, rel=0.1)
