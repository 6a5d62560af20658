"""Linear interpolation of time samples on the device against NumPy's."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.keyframes import find_key, find_key_from, key_weight
from tests.kernels.samples import evaluate


@wp.kernel(enable_backward=False)
def interpolate(
    times: wp.array(dtype=wp.float64),
    values: wp.array(dtype=float),
    first: int,
    last: int,
    time: wp.array(dtype=wp.float64),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    key = find_key(times, first, last, time[i])
    weight = key_weight(times, key, time[i])
    out[i] = (1.0 - weight) * values[key] + weight * values[key + 1]


def test_interpolation_is_that_of_numpy(device):
    """Between the samples, at them, and constant outside; the range is one trap's among others' samples."""
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(0.0, 10.0, 40))
    values = rng.normal(size=40).astype(np.float32)
    first, last = 7, 31
    asked = np.concatenate([rng.uniform(-2.0, 12.0, 500), times[first : last + 1]])
    arrays = [wp.array(times, dtype=wp.float64, device=device), wp.array(values, dtype=float, device=device)]
    given = [*arrays, first, last, wp.array(asked, dtype=wp.float64, device=device)]
    (got,) = evaluate(interpolate, len(asked), given, [float], device)
    expected = np.interp(asked, times[first : last + 1], values[first : last + 1])
    # float32 weights and values of order 1
    np.testing.assert_allclose(got, expected, atol=1e-6)


@wp.kernel(enable_backward=False)
def look_up(
    times: wp.array(dtype=wp.float64), first: int, last: int, time: wp.array(dtype=wp.float64),
    out: wp.array(dtype=int),
):  # fmt: skip
    i = wp.tid()
    out[i] = find_key(times, first, last, time[i])


RNG = np.random.default_rng(4)
LADDERS = {
    "even": np.linspace(0.0, 5.0, 257),
    "more than float32 counts": 0.25 * np.arange(2**25 + 3, dtype=float),
    "late": 1e7 + 1e-3 * np.arange(100),
    "uneven": np.cumsum(RNG.lognormal(0.0, 3.0, 300)),
    "jumps": np.repeat(np.linspace(0.0, 1.0, 20), 2),
    "two": np.array([1.0, 3.0]),
    "closer than float32 tells": 1e-48 * np.arange(50),
    "no time between": np.array([2.0, 2.0, 2.0]),
}


@pytest.mark.parametrize("times", LADDERS.values(), ids=LADDERS.keys())
def test_a_key_is_that_of_a_search(times, device):
    """At the samples, a little before and after, between them and outside: guessed or not."""
    some = RNG.choice(times, 300)
    asked = np.concatenate([some, np.nextafter(some, -np.inf), np.nextafter(some, np.inf),
                            RNG.uniform(times[0] - 1.0, times[-1] + 1.0, 300)])  # fmt: skip
    last = len(times) - 1
    given = [wp.array(times, dtype=wp.float64, device=device), 0, last]
    (got,) = evaluate(look_up, len(asked), [*given, wp.array(asked, dtype=wp.float64, device=device)], [int], device)
    np.testing.assert_array_equal(got, np.clip(np.searchsorted(times, asked, side="right") - 1, 0, last - 1))


def test_weights_stay_exact_late_in_a_run(device):
    """After 10⁷ s a float32 time would be off by a second."""
    times = 1e7 + np.array([0.0, 1e-3, 2e-3])
    asked = 1e7 + np.array([2.5e-4, 1.75e-3])
    arrays = [wp.array(times, dtype=wp.float64, device=device), wp.array([0.0, 1.0, 3.0], dtype=float, device=device)]
    given = [*arrays, 0, 2, wp.array(asked, dtype=wp.float64, device=device)]
    (got,) = evaluate(interpolate, 2, given, [float], device)
    np.testing.assert_allclose(got, [0.25, 2.5], rtol=1e-5)


@wp.kernel(enable_backward=False)
def look_on(
    times: wp.array(dtype=wp.float64), first: int, last: int, time: wp.array(dtype=wp.float64),
    key: wp.array(dtype=int), out: wp.array(dtype=int),
):  # fmt: skip
    i = wp.tid()
    out[i] = find_key_from(times, key[i], first, last, time[i])


def test_a_key_is_found_from_wherever_one_looks(device):
    """Times that went on by nothing, a little or a lot, and back; the empty piece looks from key 0."""
    rng = np.random.default_rng(1)
    times = np.sort(rng.uniform(0.0, 10.0, 40))
    first, last = 7, 31
    asked = np.concatenate([rng.uniform(-2.0, 12.0, 400), times[first : last + 1]])
    keys = rng.integers(first, last, len(asked))
    keys[:50] = 0
    given = [wp.array(times, dtype=wp.float64, device=device), first, last]
    given += [wp.array(asked, dtype=wp.float64, device=device), wp.array(keys, dtype=int, device=device)]
    (got,) = evaluate(look_on, len(asked), given, [int], device)
    expected = np.clip(np.searchsorted(times, asked, side="right") - 1, first, last - 1)
    np.testing.assert_array_equal(got, expected)
