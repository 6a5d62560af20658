"""Philox4x32-10 and the Gaussian deviates of the thermal noise.

Salmon, Moraes, Dror, Shaw, SC11 (2011), doi:10.1145/2063384.2063405. Box & Muller 1958, doi:10.1214/aoms/1177706645.
"""

from __future__ import annotations

import numpy as np

MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
WEYL = (0x9E3779B9, 0xBB67AE85)  # golden ratio and √3 − 1
ROUNDS = 10
WORD = np.uint64(0xFFFFFFFF)


def philox4x32(counter: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Four words per counter and key.

    Args:
        counter: (..., 4) integers below 2³².
        key: (..., 2) integers below 2³².

    Returns:
        (..., 4) uint32.
    """
    counter, key = np.asarray(counter, dtype=np.uint64), np.asarray(key, dtype=np.uint64)
    shape = np.broadcast_shapes(counter.shape[:-1], key.shape[:-1])
    c0, c1, c2, c3 = (np.broadcast_to(counter[..., i], shape) for i in range(4))
    k0, k1 = (np.broadcast_to(key[..., i], shape) for i in range(2))
    for _ in range(ROUNDS):
        product0, product1 = c0 * np.uint64(MULTIPLIERS[0]), c2 * np.uint64(MULTIPLIERS[1])
        high0, low0 = product0 >> np.uint64(32), product0 & WORD
        high1, low1 = product1 >> np.uint64(32), product1 & WORD
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
        k0, k1 = (k0 + np.uint64(WEYL[0])) & WORD, (k1 + np.uint64(WEYL[1])) & WORD
    return np.stack([c0, c1, c2, c3], axis=-1).astype(np.uint32)


def uniforms(words: np.ndarray) -> np.ndarray:
    """u = (word + ½)·2⁻³², strictly inside (0, 1)."""
    return (words.astype(np.float64) + 0.5) * 2.0**-32


def normals(words: np.ndarray) -> np.ndarray:
    """(..., 4) standard normal deviates from (..., 4) words, by Box–Muller on (x0, x1) and (x2, x3)."""
    u = uniforms(words)
    radius, angle = np.sqrt(-2.0 * np.log(u[..., 0::2])), 2.0 * np.pi * u[..., 1::2]
    pairs = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return pairs.reshape(words.shape)


def noise_words(*, seed: int, stream: int, step: np.ndarray, world: np.ndarray, body: np.ndarray) -> np.ndarray:
    """(..., 4) words of counter (step low, step high, world, body) and key (seed, stream); arguments broadcast."""
    step, world, body = np.broadcast_arrays(*(np.asarray(v, dtype=np.uint64) for v in (step, world, body)))
    counter = np.stack([step & WORD, step >> np.uint64(32), world, body], axis=-1)
    return philox4x32(counter, np.array([seed & 0xFFFFFFFF, stream]))


def halves(words: np.ndarray) -> np.ndarray:
    """(..., 2n) numbers below 2¹⁶ of (..., n) words, the low half of each before its high half."""
    words = np.asarray(words, dtype=np.uint64)
    pairs = np.stack([words & np.uint64(0xFFFF), words >> np.uint64(16)], axis=-1)
    return pairs.reshape(*words.shape[:-1], -1).astype(np.int64)


def three_point(half: np.ndarray) -> np.ndarray:
    """±a with probability 10923/65536 each, the outermost values of signed 16-bit numbers, else 0; variance 1."""
    signed = np.where(half < 2**15, half, half - 2**16)
    outer = 10923
    value = np.sqrt(2**16 / (2.0 * outer))
    return value * ((signed >= 2**15 - outer).astype(float) - (signed < -(2**15) + outer).astype(float))


def uniform_deviates(half: np.ndarray) -> np.ndarray:
    """65536 equally spaced values about 0, of variance 1, in the order of signed 16-bit numbers."""
    signed = np.where(half < 2**15, half, half - 2**16)
    return (signed + 0.5) / np.sqrt((2.0**32 - 1.0) / 12.0)


WEAK = {"threePoint": three_point, "uniform": uniform_deviates}
