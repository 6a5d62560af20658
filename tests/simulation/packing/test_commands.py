"""Commands that vary within a step: moments of samples, and what the stages of a scheme make of them."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.integrate.schemes import EARLY
from otwarp.simulation.packing.commands import Course, interpolated, staged

HEUN = INTEGRATORS["heun"]
STEP = 0.01


def circle(times: np.ndarray, rate: float = 60.0, power: float = 5.0) -> np.ndarray:
    """(k, 4) focus on a circle of 0.5 µm, and power."""
    angle = 2.0 * np.pi * rate * times
    return np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0 * times, np.full(len(times), power)], axis=1)


def blinking(times: np.ndarray) -> np.ndarray:
    """(k, 4): power and place change together, as of a beam that is shared out among two places."""
    phase = (times / 0.0037) % 1.0
    power = np.where(phase < 0.6, 8.0, np.where(phase < 0.8, 0.0, 3.0))
    place = np.where(phase < 0.7, 0.0, 0.4)
    return np.stack([place, -place, 0.0 * times, power], axis=1)


@pytest.mark.parametrize("command", [circle, blinking])
def test_moments_are_those_of_the_samples(command):
    """Against sums over 20 000 places in each step; samples that do not fall on steps."""
    times = np.sort(np.concatenate([np.arange(0.0, 0.2, 0.00037), [0.0501, 0.0502]]))
    values = command(times)
    course = Course.of(times, values, STEP)
    np.testing.assert_array_equal(course.step, np.arange(20))
    tau = (np.arange(20_000) + 0.5) / 20_000 - 0.5
    for k in (0, 5, 12):
        c = interpolated(times, values, (course.step[k] + 0.5 + tau) * STEP)
        p = c[:, 3:]
        for found, value in ((course.mean, c), (course.moment, c * tau[:, None]), (course.square, c * c),
                             (course.joint[0], p * c), (course.joint[1], p * c * tau[:, None])):  # fmt: skip
            np.testing.assert_allclose(found[k], value.mean(axis=0), atol=1e-5 * np.abs(value).max())


def test_long_tracks_keep_their_digits():
    """The last second of ten minutes at 1 kHz has the moments of the first; sums over the track would lose seven."""
    times = np.arange(0.0, 600.0, 1e-3)
    course = Course.of(times, circle(times), 1.0 / 64.0)
    first, last = slice(0, 64), slice(599 * 64, 600 * 64 - 2)
    np.testing.assert_allclose(course.moment[last], course.moment[first][:-2], atol=1e-9)
    np.testing.assert_allclose(course.mean[last], course.mean[first][:-2], atol=1e-9)


@pytest.mark.parametrize("scheme", INTEGRATORS.values(), ids=INTEGRATORS)
def test_two_stages_have_the_mean_of_the_course(scheme):
    """Mean force at rest ∫P c dτ and mean power; powers between those that occur."""
    times = np.arange(0.0, 0.2, 0.00037)
    for command in (circle, blinking):
        course = Course.of(times, command(times), STEP)
        first, last = course.lines(scheme)
        power = 0.5 * (first[:, 3] + last[:, 3])
        np.testing.assert_allclose(power, course.mean[:, 3], rtol=1e-12)
        pull = 0.5 * (first[:, :3] * first[:, 3:] + last[:, :3] * last[:, 3:])
        np.testing.assert_allclose(pull, course.joint[0][:, :3], atol=1e-12)
        assert np.all((np.minimum(first, last) >= course.low - 1e-12)[:, 3])
        assert np.all((np.maximum(first, last) <= course.high + 1e-12)[:, 3])


@pytest.mark.parametrize("scheme", ["heun", "exponential"])
def test_lines_stay_lines(scheme):
    """What is straight within the steps is not touched; of a line the stages are its ends, up to rounding."""
    times = np.array([0.0, 0.3, 0.71])
    values = np.array([[0.0, 0, 0, 5.0], [3.0, 1.0, 0, 5.0], [3.0, 1.0, 2.0, 5.0]])
    course = Course.of(times, values, 0.1)
    first, last = course.lines(INTEGRATORS[scheme])
    np.testing.assert_allclose(first[0], course.first[0], atol=1e-12)
    np.testing.assert_allclose(last[0], course.last[0], atol=1e-12)
    assert staged(times[:2], values[:2], 0.1, INTEGRATORS[scheme]) is None


def test_staged_samples_are_read_as_the_stages_read_them():
    """The first stage finds the start of its own line, the second its end; steps that are straight are as before."""
    times = np.concatenate([[0.0, 0.1], np.arange(0.1, 0.15, 0.0007)[1:], [0.3, 0.5]])
    values = circle(times)
    values[times >= 0.15] = circle(np.array([0.15]))
    moments, seen = staged(times, values, STEP, HEUN)
    assert np.all(np.diff(moments) >= 0.0)
    course = Course.of(times, values, STEP)
    lines = dict(zip(course.step.tolist(), zip(*course.lines(HEUN), course.bent, strict=True), strict=True))

    def looked_up(time: float) -> np.ndarray:
        """As `find_key` and `key_weight`."""
        k = int(np.clip(np.searchsorted(moments, time, side="right") - 1, 0, len(moments) - 2))
        w = np.clip((time - moments[k]) / (moments[k + 1] - moments[k]), 0.0, 1.0)
        return (1.0 - w) * seen[k] + w * seen[k + 1]

    bends = 0
    for n in range(60):
        ends = n * STEP, n * STEP + (1.0 - EARLY) * STEP
        first, last, bent = lines.get(n, (None, None, False))
        bends += bool(bent)
        expected = (first, last) if bent else interpolated(times, values, np.array(ends))
        for time, value in zip(ends, expected, strict=True):
            np.testing.assert_allclose(looked_up(time), value, atol=3e-5)
    assert bends >= 4
