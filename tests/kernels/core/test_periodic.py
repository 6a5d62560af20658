"""Nearest images and crossings against the same in NumPy."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.kernels.core.periodic import kept_in_cell, nearest
from otwarp.kernels.core.types import ModelData, StateData
from otwarp.scene import Scene, Settings
from otwarp.scene.period import in_cell
from otwarp.scene.period import nearest as nearest_image
from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.period import pack_period

ROUNDING = 4e-6
"""Of a coordinate of 30 µm in float32 [µm]."""

SETTINGS = Settings(period=(7.0, 0.0, 11.0), period_center=(1.0, 2.0, -3.0))


@wp.kernel(enable_backward=False)
def both(model: ModelData, state: StateData, point: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=wp.vec3)):
    """Nearest image of each point seen from the origin, and the point put into the cell."""
    i = wp.tid()
    out[0, i] = nearest(model.period, point[i])
    out[1, i] = kept_in_cell(model, state, 0, i, point[i])


def test_as_on_the_host(device):
    points = np.random.default_rng(3).uniform(-30.0, 30.0, (500, 3)).astype(np.float32)
    model, state = ModelData(), StateData()
    model.period = pack_period(Scene(settings=SETTINGS), Place(device))
    state.image = wp.zeros((1, 500), dtype=wp.vec3i, device=device)
    out = wp.zeros((2, 500), dtype=wp.vec3, device=device)
    wp.launch(both, 500, [model, state, wp.array(points, dtype=wp.vec3, device=device)], [out], device=device)
    near, inside = out.numpy().astype(float)
    length = np.array(SETTINGS.period)
    closed = length > 0.0
    assert np.all(np.abs(near[:, closed]) <= 0.5 * length[closed] + ROUNDING)
    assert np.array_equal(near[:, 1], points[:, 1])
    np.testing.assert_allclose(near, nearest_image(points.astype(float), SETTINGS.period), rtol=0.0, atol=ROUNDING)
    host, image = in_cell(points.astype(float), SETTINGS.period, SETTINGS.period_center)
    assert np.array_equal(state.image.numpy()[0], image)
    assert set(image[:, 0]) > {-3, -1, 0, 1, 3}
    np.testing.assert_allclose(inside, host, rtol=0.0, atol=ROUNDING)


def test_the_image_of_the_other_point_is_the_opposite():
    """Of pairs at half a period, too: the third law of contacts rests on it."""
    away = np.array([[3.5, 0.0, 5.5], [-3.5, 1.0, -5.5], [3.6, 0.0, -5.4]])
    assert np.array_equal(nearest_image(-away, SETTINGS.period), -nearest_image(away, SETTINGS.period))
