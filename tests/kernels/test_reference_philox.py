"""The NumPy twin of the random numbers: known answers, independence of shape, moments."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.philox import noise_words, normals, philox4x32, uniforms

# Known-answer vectors of the Random123 distribution (Salmon et al. 2011).
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def words(text: str) -> np.ndarray:
    return np.array([int(w, 16) for w in text.split()], dtype=np.uint32)


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_known_answers(counter, key, answer):
    np.testing.assert_array_equal(philox4x32(words(counter), words(key)), words(answer))


def test_vectorised_equals_one_by_one():
    counters, keys = np.stack([words(c) for c, _, _ in KNOWN]), np.stack([words(k) for _, k, _ in KNOWN])
    np.testing.assert_array_equal(philox4x32(counters, keys), np.stack([words(a) for _, _, a in KNOWN]))


def test_counter_layout():
    step = (3 << 32) + 7
    expected = philox4x32(np.array([7, 3, 11, 13]), np.array([5, 2]))
    np.testing.assert_array_equal(noise_words(seed=5, stream=2, step=step, world=11, body=13), expected)


def test_uniforms_never_reach_zero_or_one():
    u = uniforms(np.array([0, 2**32 - 1], dtype=np.uint32))
    assert u[0] == 2.0**-33
    assert u[1] == 1.0 - 2.0**-33


def test_box_muller_by_hand():
    x = np.array([[2**30, 0, 2**31, 2**30]], dtype=np.uint32)
    u = (x[0] + 0.5) / 2**32
    r0, r1 = np.sqrt(-2 * np.log(u[0])), np.sqrt(-2 * np.log(u[2]))
    expected = [r0 * np.cos(2 * np.pi * u[1]), r0 * np.sin(2 * np.pi * u[1])]
    expected += [r1 * np.cos(2 * np.pi * u[3]), r1 * np.sin(2 * np.pi * u[3])]
    np.testing.assert_allclose(normals(x)[0], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("along", ["step", "world", "body"])
def test_deviates_are_standard_and_uncorrelated(along):
    n = 50_000
    arguments = {"step": 0, "world": 0, "body": 0} | {along: np.arange(n)}
    x = normals(noise_words(seed=7, stream=0, **arguments))
    spread = 5 / np.sqrt(n)  # five standard errors; the sample is fixed, so this either holds or not
    assert np.abs(x.mean(axis=0)).max() < spread
    assert np.abs(np.cov(x.T) - np.eye(4)).max() < spread * np.sqrt(2)
    assert np.abs((x**4).mean(axis=0) - 3).max() < spread * np.sqrt(96)
    lagged = (x[1:, :, None] * x[:-1, None, :]).mean(axis=0)  # neighbours, also across the four deviates
    assert np.abs(lagged).max() < spread


def test_streams_and_seeds_differ():
    base = noise_words(seed=1, stream=0, step=np.arange(100), world=0, body=0)
    for other in ({"seed": 2, "stream": 0}, {"seed": 1, "stream": 1}):
        assert not np.any(noise_words(**other, step=np.arange(100), world=0, body=0) == base)
