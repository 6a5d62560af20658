"""The four laws of traps on the device against their twins."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import ModelData
from otwarp.kernels.optics.traps import trap_force_term
from otwarp.simulation.model import Model
from tests.kernels.optics.test_traps import AXIAL, FITTED, MODELS, RADIAL, ROUNDING, SCENE, TRAPS
from tests.kernels.samples import evaluate, on_device
from tests.reference import traps

_, prepare, force_of, _ = trap_force_term(MODELS)


@pytest.fixture(scope="module")
def model(device) -> Model:
    return Model.build(SCENE, device=device)


@wp.kernel(enable_backward=False)
def probe_force(
    model: ModelData,
    trap: wp.array(dtype=int),
    away: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    out: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    law = prepare(model.traps, 0, trap[i], radius[i], 0)
    out[i] = force_of(model.traps, law, away[i])


def displacements(rng: np.random.Generator, n: int, radius: np.ndarray) -> np.ndarray:
    """(n, 3): random ones, and ones a little inside and outside every branch of the laws, scaled or not."""
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    edges = np.array([RADIAL.threshold, RADIAL.cutoff, AXIAL.threshold, AXIAL.cutoff])
    length = rng.uniform(0, 2.6, n)
    at_edge = rng.random(n) < 0.5
    scaled = np.where(rng.random(n) < 0.5, radius / FITTED, 1.0)
    length = np.where(at_edge, rng.choice(edges, n) * scaled * (1 + rng.choice([-1e-5, 1e-5], n)), length)
    return (way * length[:, None]).astype(np.float32)


def test_every_law_is_that_of_the_twin(model, device):
    rng, n = np.random.default_rng(0), 4000
    index = rng.integers(0, len(TRAPS), n)
    radius = rng.uniform(0.5, 2.5, n).astype(np.float32)
    away = displacements(rng, n, radius)
    # on the axis and at the trap itself
    away[:20] *= 0.0
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    (got,) = evaluate(probe_force, n, inputs, [wp.vec3], device)
    expected = []
    for i, d, r in zip(index, away.astype(float), radius.astype(float), strict=True):
        t = dataclasses.replace(TRAPS[i], equilibrium=0.0)
        expected.append(traps.sphere_force(t, np.zeros(3), 1.0, d, r))
    expected = np.array(expected)
    assert np.abs(expected).max(axis=0).min() > 0.3  # pN per mW: the samples do feel the traps
    np.testing.assert_array_equal(got[:20], 0.0)
    error = np.abs(got - expected).max(axis=1)
    # beyond a cutoff the components across and along are compared with it after rounding: none lies that near here
    assert error.max() < ROUNDING * np.abs(expected).max()


def test_force_is_zero_from_the_cutoff_on(model, device):
    """F(d) for d just below the cutoff is the branch's value, at and beyond it zero (harmonic: K·d, then zero)."""
    below, at = np.nextafter(np.float32(1.5), np.float32(0)), np.float32(1.5)
    away = np.array([[below, 0, 0], [at, 0, 0], [2 * at, 0, 0]] * 2, dtype=np.float32)
    index = np.array([0, 0, 0, 2, 2, 2])
    radius = np.full(6, FITTED, dtype=np.float32)
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    (got,) = evaluate(probe_force, 6, inputs, [wp.vec3], device)
    np.testing.assert_array_equal(got[[1, 2, 4, 5]], 0.0)
    assert got[0, 0] == pytest.approx(-1.5 * 20 / 20, rel=1e-6)
    assert got[3, 0] == pytest.approx(-(3.0 / 1.5**2 - 1.0) / 20, rel=1e-5)
