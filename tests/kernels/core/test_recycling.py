"""Who has left, and where one may come in, against NumPy with the same words of Philox."""

from __future__ import annotations

import dataclasses

import numpy as np
import warp as wp

from otwarp.kernels.core.random import Stream
from otwarp.kernels.core.recycling import TRIES, entry_place, has_left
from otwarp.kernels.core.types import ModelData
from otwarp.scene import Scene, Settings
from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.inlets import pack_inlets
from tests.reference import philox
from tests.simulation.setups import sphere_body

SETTINGS = Settings(
    domain_low=(-5.0, 0.0, -1.0), domain_high=(5.0, 0.0, 2.0), inlet_low=(-5.0, -3.0, 0.0), inlet_high=(-4.0, 3.0, 0.0)
)
SEED, NUMBER, STEP = 9, 3, (1 << 33) + 5


@wp.kernel(enable_backward=False)
def both(model: ModelData, point: wp.array(dtype=wp.vec3), step: wp.int64, out: wp.array(dtype=wp.vec4)):
    """Where body i mod 2 comes in at its i-th try, and whether it has left from a point."""
    i = wp.tid()
    place = entry_place(model, 3, i % 2, step, i)
    out[i] = wp.vec4(place[0], place[1], place[2], wp.where(has_left(model, i % 2, point[i]), 1.0, 0.0))


def test_as_on_the_host(device):
    count = 2 * int(TRIES)
    points = np.random.default_rng(3).uniform(-8.0, 8.0, (count, 3)) * (1.0, 1.0, 0.3)
    points = points.astype(np.float32)
    bodies = (sphere_body("Robot"), sphere_body("Cell", kind="cell"))
    model = ModelData()
    model.seed = wp.uint32(SEED)
    model.inlets, kept = pack_inlets(Scene(bodies=bodies, settings=SETTINGS), Place(device))
    out = wp.zeros(count, dtype=wp.vec4, device=device)
    wp.launch(
        both, count, [model, wp.array(points, dtype=wp.vec3, device=device), wp.int64(STEP)], [out], device=device
    )
    found, body = out.numpy(), np.arange(count) % 2
    step = STEP * int(TRIES) + np.arange(count)
    words = philox.noise_words(seed=SEED, stream=Stream.ENTRY, step=step, world=np.full(count, NUMBER), body=body)
    low, high = np.array(SETTINGS.inlet_low), np.array(SETTINGS.inlet_high)
    expected = low + (words[:, :3] + 0.5) * 2.0**-32 * (high - low)
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-6)
    x, z = points[:, 0], points[:, 2]
    outside = (np.abs(x) > 5.0) | (z < -1.0) | (z > 2.0)
    assert np.array_equal(found[:, 3] > 0.0, outside & (body == 1)) and 3 < found[:, 3].sum() < count / 2 - 3
    assert len(kept) == 1


def test_no_domain_no_inlet(device):
    place = Place(device)
    assert pack_inlets(Scene(settings=Settings()), place)[0].shape == (0,)
    again = dataclasses.replace(SETTINGS, domain_high=SETTINGS.domain_low)
    assert pack_inlets(Scene(settings=again), place)[0].shape == (0,)
