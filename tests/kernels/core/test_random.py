"""Random numbers of the device against their twins: bits of the words, digits of the deviates."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.random import (
    GAUSSIAN_TERMS,
    Stream,
    gaussian_pair,
    noise_words,
    philox,
    polar,
    squared_radius,
    vec4u,
)
from tests.reference import philox as twin

BULK = 4e-6
"""Rounding of a float32 deviate: |x| ≤ 6.8 with logarithm, root, angle and cosine good to a few 6e-8 each."""

NEAR_ONE = 5e-4
"""Where u lies within 2⁻⁵ of 1, its spacing of 2⁻²⁴ is felt as √(2·2⁻²⁴) ≈ 3.5e-4 in the radius √(−2 ln u) → 0."""

FAST = 1e-3
"""The same with `fast_math`, where ln u near 1 is good to 4e-7: √(2·4e-7) ≈ 9e-4 in the radius."""

ONE_DIGIT = 2.4e-7
"""Relative: a root on CUDA is good to 2⁻²³, and the logarithm under it to twice that."""

KNOWN = [
    ([0, 0, 0, 0], [0, 0], [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]
"""Known answers of the Random123 distribution (Salmon et al. 2011, doi:10.1145/2063384.2063405)."""


@wp.kernel(enable_backward=False)
def probe_philox(counter: wp.array(dtype=vec4u), key: wp.array2d(dtype=wp.uint32), out: wp.array(dtype=vec4u)):
    i = wp.tid()
    out[i] = philox(counter[i], key[i, 0], key[i, 1])


@wp.kernel(enable_backward=False)
def probe_words(
    step: wp.array(dtype=wp.int64), world: wp.array(dtype=int), body: wp.array(dtype=int), out: wp.array(dtype=vec4u)
):
    i = wp.tid()
    out[i] = noise_words(wp.uint32(4000000001), wp.uint32(1), step[i], world[i], body[i])


@wp.kernel(enable_backward=False)
def probe_gaussian(words: wp.array2d(dtype=wp.uint32), out: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    out[i] = gaussian_pair(words[i, 0], words[i, 1])


@wp.kernel(enable_backward=False)
def probe_parts(word: wp.array(dtype=wp.uint32), square: wp.array(dtype=float), point: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    square[i] = squared_radius(word[i])
    point[i] = polar(3.0, word[i])


def run_philox(counters: np.ndarray, keys: np.ndarray, device: str) -> np.ndarray:
    out = wp.empty(len(counters), dtype=vec4u, device=device)
    counter = wp.array(counters.astype(np.uint32), dtype=vec4u, device=device)
    key = wp.array(keys.astype(np.uint32), dtype=wp.uint32, ndim=2, device=device)
    wp.launch(probe_philox, dim=len(counters), inputs=[counter, key, out], device=device)
    return out.numpy()


def fast_probe() -> wp.Kernel:
    """`probe_gaussian` as `fast_math` has it: the other term, and the module option."""
    term = GAUSSIAN_TERMS[True]

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": True})
    def probe(words: wp.array2d(dtype=wp.uint32), out: wp.array(dtype=wp.vec2)):
        i = wp.tid()
        out[i] = term(words[i, 0], words[i, 1])

    return probe


def run_gaussian(words: np.ndarray, device: str, kernel: wp.Kernel = probe_gaussian) -> np.ndarray:
    out = wp.empty(len(words), dtype=wp.vec2, device=device)
    given = wp.array(words.astype(np.uint32), dtype=wp.uint32, ndim=2, device=device)
    wp.launch(kernel, dim=len(words), inputs=[given, out], device=device)
    return out.numpy().astype(float)


def test_known_answers(device):
    counters, keys, answers = (np.array([row[i] for row in KNOWN], dtype=np.uint32) for i in range(3))
    np.testing.assert_array_equal(run_philox(counters, keys, device), answers)


def test_words_are_those_of_the_twin(device):
    rng = np.random.default_rng(0)
    counters = rng.integers(0, 2**32, size=(5000, 4), dtype=np.uint32)
    keys = rng.integers(0, 2**32, size=(5000, 2), dtype=np.uint32)
    np.testing.assert_array_equal(run_philox(counters, keys, device), twin.philox4x32(counters, keys))


def test_counter_and_key(device):
    """(step low, step high, world, body) and (seed, stream), also beyond 2³² steps and for seeds above 2³¹."""
    rng = np.random.default_rng(1)
    step = np.concatenate([[0, 1, 2**32 - 1, 2**32, 2**40 + 5], rng.integers(0, 2**45, 500)])
    world, body = rng.integers(0, 2**31, len(step)), rng.integers(0, 2**31, len(step))
    out = wp.empty(len(step), dtype=vec4u, device=device)
    inputs = [
        wp.array(step, dtype=wp.int64, device=device),
        wp.array(world, dtype=int, device=device),
        wp.array(body, dtype=int, device=device),
        out,
    ]
    wp.launch(probe_words, dim=len(step), inputs=inputs, device=device)
    expected = twin.noise_words(seed=4000000001, stream=1, step=step, world=world, body=body)
    np.testing.assert_array_equal(out.numpy(), expected)


def test_streams_have_distinct_numbers():
    assert len({int(s) for s in Stream}) == len(Stream.__members__)


def test_deviates_are_those_of_the_twin(device):
    rng = np.random.default_rng(2)
    words = rng.integers(0, 2**32, size=(20_000, 4), dtype=np.uint32)
    expected = twin.normals(words)
    for pair in (slice(0, 2), slice(2, 4)):
        error = np.abs(run_gaussian(words[:, pair], device) - expected[:, pair])
        near_one = twin.uniforms(words[:, pair.start]) > 1.0 - 2.0**-5
        assert error[~near_one].max() < BULK
        assert error.max() < NEAR_ONE


def edge_words(rng: np.random.Generator) -> np.ndarray:
    """Random words, the least and the largest, and those on both sides of every power of two, of √½·2ᵉ and of
    every eighth of a turn.
    """
    exponents = 2.0 ** np.arange(1, 33)
    edges = np.concatenate([exponents, np.sqrt(0.5) * exponents, np.arange(9) * 2.0**29]).astype(np.int64)
    near = (edges[:, None] + np.arange(-3, 4)).ravel()
    near = near[(near >= 0) & (near < 2**32)]
    return np.concatenate([near, np.arange(300), 2**32 - 1 - np.arange(300), rng.integers(0, 2**32, 50_000)])


def test_radius_and_angle_are_those_of_float64(device):
    """Every branch and fold of the two parts that a deviate is made of."""
    word = edge_words(np.random.default_rng(3)).astype(np.uint32)
    square = wp.empty(len(word), dtype=float, device=device)
    point = wp.empty(len(word), dtype=wp.vec2, device=device)
    given = wp.array(word, dtype=wp.uint32, device=device)
    wp.launch(probe_parts, dim=len(word), inputs=[given, square, point], device=device)
    # the word is rounded to float32 on the way, which is not the logarithm's fault
    u = (word.astype(np.float32) + np.float32(0.5)).astype(float) * 2.0**-32
    assert np.all(square.numpy() >= 0.0)
    np.testing.assert_allclose(square.numpy(), -2.0 * np.log(u), rtol=3e-7, atol=1e-30)
    angle = 2.0 * np.pi * (word.astype(float) + 0.5) * 2.0**-32
    exact = 3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(point.numpy(), exact, rtol=0.0, atol=3.0 * 3e-7)


def test_fast_deviates_are_those_of_the_twin(device):
    """Within the documented errors of the instructions on CUDA, and so by far with the library's functions."""
    words = np.random.default_rng(4).integers(0, 2**32, size=(20_000, 4), dtype=np.uint32)
    fast, expected = run_gaussian(words[:, :2], device, fast_probe()), twin.normals(words)[:, :2]
    near_one = twin.uniforms(words[:, 0]) > 1.0 - 2.0**-5
    assert np.abs(fast - expected)[~near_one].max() < BULK
    assert np.abs(fast - expected).max() < FAST


@pytest.mark.parametrize("fast", [False, True])
def test_extreme_words_give_finite_deviates(fast, device):
    edge = np.array([0, 1, 2**31, 2**32 - 1], dtype=np.uint32)
    words = np.array([[a, b] for a in edge for b in edge])
    x = run_gaussian(words, device, fast_probe() if fast else probe_gaussian)
    assert np.all(np.isfinite(x))
    # word 0 is u = 2⁻³³, the largest deviate there is
    assert np.abs(x).max() == pytest.approx(np.sqrt(2 * np.log(2.0**33)), rel=10 * ONE_DIGIT if fast else ONE_DIGIT)
