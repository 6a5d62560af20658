"""The random streams know nothing of each other: every purpose of `Stream`, and every neighbour of a counter.

Deviates are drawn on the device by the functions that the kernels use. A correlation coefficient of n independent pairs
of standard normal deviates has the standard error 1/√n. Also squares are compared (volatility that goes together shows
in no linear correlation), and all single bits of the words.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.noise import six_deviates_term
from otwarp.kernels.core.random import Stream, gaussian_pair, noise_words, vec4u
from otwarp.kernels.core.types import vec6

SEED = 20
COUNT = 1 << 18

Draws = tuple[np.ndarray, np.ndarray]
"""Words and deviates."""


@wp.kernel(enable_backward=False)
def draw(
    seed: wp.uint32,
    stream: wp.uint32,
    step: wp.array(dtype=wp.int64),
    world: wp.array(dtype=int),
    body: wp.array(dtype=int),
    words: wp.array(dtype=vec4u),
    deviates: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    w = noise_words(seed, stream, step[i], world[i], body[i])
    words[i] = w
    a = gaussian_pair(w[0], w[1])
    b = gaussian_pair(w[2], w[3])
    deviates[i] = wp.vec4(a[0], a[1], b[0], b[1])


def drawn(device: str, stream: int, step, world, body, *, seed: int = SEED) -> Draws:
    """(n, 4) words and (n, 4) deviates; counters broadcast."""
    step, world, body = np.broadcast_arrays(*(np.asarray(v, dtype=np.int64) for v in (step, world, body)))
    n = step.size
    words, deviates = wp.empty(n, dtype=vec4u, device=device), wp.empty(n, dtype=wp.vec4, device=device)
    inputs = [
        wp.uint32(seed),
        wp.uint32(stream),
        wp.array(step.ravel(), dtype=wp.int64, device=device),
        wp.array(world.ravel().astype(np.int32), dtype=int, device=device),
        wp.array(body.ravel().astype(np.int32), dtype=int, device=device),
        words,
        deviates,
    ]
    wp.launch(draw, dim=n, inputs=inputs, device=device)
    return words.numpy(), deviates.numpy().astype(float)


def bits(words: np.ndarray) -> np.ndarray:
    """(n, 128) ±1."""
    planes = (words[:, :, None] >> np.arange(32, dtype=np.uint32)) & np.uint32(1)
    return 2.0 * planes.reshape(len(words), 128) - 1.0


def crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Correlation of every column of a with every one of b, both of mean 0 and variance 1 by their law."""
    return a.T @ b / len(a)


def check(expect_law, name: str, pairs: list[tuple[Draws, Draws]]) -> None:
    """Deviates, their squares and the bits of pairs of sets of draws."""
    error = 1.0 / np.sqrt(COUNT)
    linear = [crossed(one[1], other[1]) for one, other in pairs]
    squares = [crossed(*((x * x - 1.0) / np.sqrt(2.0) for _, x in pair)) for pair in pairs]
    part = COUNT // 8
    planes = [crossed(bits(one[0][:part]), bits(other[0][:part])) for one, other in pairs]
    expect_law(f"{name}: ⟨ξ ξ'⟩", linear, 0.0, error)
    expect_law(f"{name}: ⟨(ξ² − 1)(ξ'² − 1)⟩/2", squares, 0.0, error)
    # so many that the largest is no test: the mean square of 128² per pair, each of variance 1/n
    square = part * np.mean(np.square(planes))
    expect_law(f"{name}: n⟨b b'⟩² of all bits of the words", square, 1.0, np.sqrt(2.0 / np.size(planes)))


@pytest.mark.parametrize(("first", "second"), itertools.combinations(Stream, 2))
def test_streams_are_uncorrelated(expect_law, device, first, second):
    """Draws of two purposes for the same step, world and body.

    Source: Salmon, Moraes, Dror & Shaw 2011, doi:10.1145/2063384.2063405, for keys that differ in one word.
    """
    counters = np.arange(COUNT) // 512, np.arange(COUNT) % 512, 3
    pair = drawn(device, first, *counters), drawn(device, second, *counters)
    check(expect_law, f"{first.name} and {second.name}", [pair])


NEIGHBOURS = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1 << 32, 0, 0, 0), (0, 0, 0, 1))
"""What is added to step, world, body and seed."""


@pytest.mark.parametrize("stream", Stream)
def test_neighbours_are_uncorrelated(expect_law, device, stream):
    """Draws of one purpose for the next step, world, body or seed, and for the step 2³² later.

    Source: Salmon, Moraes, Dror & Shaw 2011, doi:10.1145/2063384.2063405.
    """
    # even numbers, so that no draw is among its neighbours'
    step, world, body = np.arange(COUNT) // 512 * 2, np.arange(COUNT) % 512 * 2, 4
    here = drawn(device, stream, step, world, body)
    pairs = [
        (here, drawn(device, stream, step + later, world + beside, body + other, seed=SEED + key))
        for later, beside, other, key in NEIGHBOURS
    ]
    check(expect_law, f"{stream.name} and its neighbours", pairs)


@pytest.mark.parametrize("stream", Stream)
def test_each_stream_is_standard_normal(expect_law, device, stream):
    """Moments up to the fourth, and the four deviates of a draw among each other.

    Source: Box & Muller 1958, doi:10.1214/aoms/1177706645; variances of moments of a normal law: 1, 2, 15, 96 over n.
    """
    x = drawn(device, stream, np.arange(COUNT), 0, 0)[1]
    for power, moment, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        expect_law(f"{stream.name}: ⟨ξ^{power}⟩", (x**power).mean(axis=0), moment, np.sqrt(variance / COUNT))
    expect_law.tensor(f"{stream.name}: ⟨ξ_i ξ_j⟩", crossed(x, x), np.eye(4), np.sqrt((1.0 + np.eye(4)) / COUNT))


def test_six_deviates_of_a_body(expect_law, device):
    """Those of a rigid body, of two streams, are uncorrelated as the step takes them.

    Source: as above; `otwarp.kernels.core.noise` takes four from BROWNIAN_A and two from BROWNIAN_B.
    """
    six = six_deviates_term("gaussian")

    @wp.kernel(module="unique", enable_backward=False)
    def draw_six(out: wp.array(dtype=vec6)):
        i = wp.tid()
        out[i] = six(wp.uint32(20), wp.int64(i), 5, 1)

    out = wp.empty(COUNT, dtype=vec6, device=device)
    wp.launch(draw_six, dim=COUNT, inputs=[out], device=device)
    x = out.numpy().astype(float)
    expect_law.tensor("⟨ξ_i ξ_j⟩ of six", crossed(x, x), np.eye(6), np.sqrt((1.0 + np.eye(6)) / COUNT))
    expect_law.tensor("the same from step to step", crossed(x[:-1], x[1:]), 0.0 * np.eye(6), np.sqrt(1.0 / COUNT))
