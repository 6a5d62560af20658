"""Cheaper noise than Gaussian: every value it can take, its moments, and which words it is made of."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.noise import NOISES, WEAK_TERMS, six_deviates_term, three_deviates_term
from otwarp.kernels.core.random import Stream
from tests.reference import philox as twin

ROUNDING = 3e-7
"""Relative: a deviate is one float32 product of exact or correctly rounded factors, 2⁻²³ and some room."""

SEED = 4000000001
WORLDS, STEPS = 500, 40
MOMENTS = {
    "threePoint": {2: 1.0, 4: 2**16 / (2 * 10923)},
    "uniform": {2: 1.0, 4: 0.6 * (3.0 * 2.0**32 - 7.0) / (2.0**32 - 1.0)},
}
"""Even moments: a² of ±a and 0 with variance 1; those of N = 2¹⁶ equally spaced values, 3(3N² − 7)/(5(N² − 1))."""

WANTED = {"threePoint": {4: (3.0, 4e-5)}, "uniform": {4: (1.8, 1e-9)}}
"""Fourth moments of the exact distributions, and how far 16 bits are from them, relative."""


@functools.lru_cache
def value_probe(deviate: wp.Function) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def probe(half: wp.array(dtype=wp.int32), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = deviate(half[i])

    return probe


@functools.lru_cache
def draw_probe(noise: str, count: int) -> wp.Kernel:
    """Kernel that writes the deviates of (world, step), worlds counted from 7 and steps from near 2³²."""
    term = (three_deviates_term if count == 3 else six_deviates_term)(noise)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(seed: wp.uint32, first: wp.int64, out: wp.array3d(dtype=float)):
        world, k = wp.tid()
        x = term(seed, first + wp.int64(k), world + 7, 3)
        for c in range(count):
            out[world, k, c] = x[c]

    return probe


def draw(noise: str, count: int, device: str, first: int) -> np.ndarray:
    out = wp.empty((WORLDS, STEPS, count), dtype=float, device=device)
    inputs = [wp.uint32(SEED), wp.int64(first), out]
    wp.launch(draw_probe(noise, count), dim=(WORLDS, STEPS), inputs=inputs, device=device)
    return out.numpy().astype(float)


def every_value(noise: str, device: str, below: int) -> np.ndarray:
    """The deviates of all 2¹⁶ upper halves, `below` in the lower ones."""
    word = (np.arange(2**16, dtype=np.uint32) << np.uint32(16)) | np.uint32(below)
    half = wp.array(word.view(np.int32), dtype=wp.int32, device=device)
    out = wp.empty(2**16, dtype=float, device=device)
    wp.launch(value_probe(WEAK_TERMS[noise]), dim=2**16, inputs=[half, out], device=device)
    return out.numpy().astype(float)


@pytest.mark.parametrize("noise", WEAK_TERMS)
def test_every_value_is_that_of_the_twin(noise, device):
    expected = twin.WEAK[noise](np.arange(2**16))
    for below in (0, 1, 0x8000, 0xFFFF):
        np.testing.assert_allclose(every_value(noise, device, below), expected, rtol=ROUNDING, atol=0.0)


@pytest.mark.parametrize("noise", WEAK_TERMS)
def test_moments_over_all_values(noise, device):
    """Odd ones vanish exactly, because the values come in pairs; even ones are those of the distribution."""
    x = every_value(noise, device, 0)
    values, counts = np.unique(np.abs(x), return_counts=True)
    for size, count in zip(values[values > 0.0], counts[values > 0.0], strict=True):
        assert np.count_nonzero(x == size) == np.count_nonzero(x == -size) == count / 2
    for order, expected in MOMENTS[noise].items():
        assert np.mean(x**order) == pytest.approx(expected, rel=order * ROUNDING)
    for order, (exact, bias) in WANTED[noise].items():
        assert MOMENTS[noise][order] == pytest.approx(exact, rel=bias)


@pytest.mark.parametrize("count", [3, 6])
@pytest.mark.parametrize("noise", NOISES)
def test_deviates_come_from_the_words_of_their_step(noise, count, device):
    first = 2**32 - 20
    x = draw(noise, count, device, first)
    world, step = np.meshgrid(np.arange(WORLDS) + 7, first + np.arange(STEPS), indexing="ij")
    words = twin.noise_words(seed=SEED, stream=Stream.BROWNIAN_A, step=step, world=world, body=np.array(3))
    if noise == "gaussian":
        more = twin.noise_words(seed=SEED, stream=Stream.BROWNIAN_B, step=step, world=world, body=np.array(3))
        expected = np.concatenate([twin.normals(words), twin.normals(more)], axis=-1)[..., :count]
        # where a uniform number lies near 1, float32 feels its spacing; test_random measures that
        assert np.quantile(np.abs(x - expected), 0.99) < 4e-6
    else:
        expected = twin.WEAK[noise](twin.halves(words))[..., :count]
        np.testing.assert_allclose(x, expected, rtol=ROUNDING, atol=0.0)


@pytest.mark.parametrize("count", [3, 6])
@pytest.mark.parametrize("noise", NOISES)
def test_deviates_are_independent_of_each_other(noise, count, device):
    """Products of two deviates of one step, of neighbouring steps and of neighbouring worlds average to 0.

    Each product has variance 1, so that the mean of n has a standard error of 1/√n.
    """
    x = draw(noise, count, device, 0)
    pairs = {"within a step": (x, x), "steps": (x[:, 1:], x[:, :-1]), "worlds": (x[1:], x[:-1])}
    for name, (a, b) in pairs.items():
        a, b = a.reshape(-1, count), b.reshape(-1, count)
        mean = a.T @ b / len(a)
        if a.shape[0] == x[..., 0].size:
            mean = mean - np.diag(np.diag(mean))
        assert np.abs(mean).max() < 5.0 / np.sqrt(len(a)), name
