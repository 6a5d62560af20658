"""Linear interpolation of time samples on the device against NumPy's."""

import numpy as np
import warp as wp

from otwarp.kernels.core.keyframes import find_key, key_weight
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


def test_weights_stay_exact_late_in_a_run(device):
    """After 10⁷ s a float32 time would be off by a second."""
    times = 1e7 + np.array([0.0, 1e-3, 2e-3])
    asked = 1e7 + np.array([2.5e-4, 1.75e-3])
    arrays = [wp.array(times, dtype=wp.float64, device=device), wp.array([0.0, 1.0, 3.0], dtype=float, device=device)]
    given = [*arrays, 0, 2, wp.array(asked, dtype=wp.float64, device=device)]
    (got,) = evaluate(interpolate, 2, given, [float], device)
    np.testing.assert_allclose(got, [0.25, 2.5], rtol=1e-5)
