"""Blocks of noise against the scalar functions: the same bits, whatever the block starts with and whoever reads it."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.noise import NOISES, six_deviates_term, three_deviates_term
from otwarp.kernels.core.types import vec6
from otwarp.kernels.cpu.noise_block import BLOCK, address_of, noise_block_term, six_at, three_at, worlds_block_term

SEED = 4000000001
"""Above 2³¹, so that a sign would show."""

STARTS = [0, 1, 15, 16, 1000, 2**32 - 5, 2**40 + 3]
"""First steps: aligned or not, and across the carry into the high word."""

MANY = 4096
FORMS = [(noise, count) for noise in NOISES for count in (3, 6)]


@wp.struct
class Carrier:
    noise: wp.uint64


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("blocks of noise are for CPUs")


@functools.lru_cache
def block_kernel(noise: str, count: int) -> wp.Kernel:
    """Draws a block per world, somewhere in a buffer, and reads it step by step."""
    block = noise_block_term(noise, count)
    read = three_at if count == 3 else six_at

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(first: wp.int64, world: wp.array(dtype=int), body: int, out: wp.array3d(dtype=float)):
        i = wp.tid()
        buffer = wp.zeros(shape=(wp.static(2 * BLOCK * count),), dtype=wp.float32)
        at = wp.static(BLOCK * count) * (i % 2)
        block(buffer, at, wp.uint32(SEED), first, world[i], body)
        address = address_of(buffer, at)
        steps = int(BLOCK)
        for k in range(steps):
            x = read(address, wp.int64(k))
            for c in range(count):
                out[i, k, c] = x[c]

    return kernel


@functools.lru_cache
def worlds_kernel() -> wp.Kernel:
    """Draws one step of the worlds of a block at once."""
    block = worlds_block_term("gaussian")

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(first: wp.int64, world: wp.array(dtype=int), body: int, out: wp.array3d(dtype=float)):
        k = wp.tid()
        buffer = wp.zeros(shape=(wp.static(BLOCK * 3),), dtype=wp.float32)
        lanes = int(BLOCK)
        for begin in range(0, world.shape[0], BLOCK):
            block(buffer, 0, wp.uint32(SEED), first + wp.int64(k), world[begin])
            for i in range(lanes):
                x = three_at(address_of(buffer, 0), wp.int64(i))
                for c in range(3):
                    out[begin + i, k, c] = x[c]

    return kernel


@functools.lru_cache
def scalar_kernel(noise: str, count: int) -> wp.Kernel:
    term = (three_deviates_term if count == 3 else six_deviates_term)(noise)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(first: wp.int64, world: wp.array(dtype=int), body: int, out: wp.array3d(dtype=float)):
        i = wp.tid()
        steps = int(BLOCK)
        for k in range(steps):
            x = term(wp.uint32(SEED), first + wp.int64(k), world[i], body)
            for c in range(count):
                out[i, k, c] = x[c]

    return kernel


def run(kernel: wp.Kernel, count: int, device: str, *, first: int, world: np.ndarray, body: int) -> np.ndarray:
    """(worlds, steps, count) as bits."""
    out = wp.empty((len(world), BLOCK, count), dtype=float, device=device)
    inputs = [wp.int64(first), wp.array(world, dtype=int, device=device), body, out]
    wp.launch(kernel, dim=len(world), inputs=inputs, device=device)
    return out.numpy().view(np.uint32)


@pytest.mark.parametrize(("noise", "count"), FORMS)
def test_a_block_has_the_bits_of_the_scalar_functions(noise, count, device):
    world = np.random.default_rng(5).integers(0, 2**31, 200)
    block, scalar = block_kernel(noise, count), scalar_kernel(noise, count)
    for first in STARTS:
        for body in (0, 2**31 - 1):
            how = {"first": first, "world": world, "body": body}
            np.testing.assert_array_equal(run(block, count, device, **how), run(scalar, count, device, **how))


def test_a_step_of_many_worlds_has_them_too(device):
    for begin in (0, 2**31 - 64, -32):
        world = np.arange(begin, begin + 3 * BLOCK).astype(np.int32)
        for first in STARTS:
            out = wp.empty((len(world), BLOCK, 3), dtype=float, device=device)
            inputs = [wp.int64(first), wp.array(world, dtype=int, device=device), 0, out]
            wp.launch(worlds_kernel(), dim=BLOCK, inputs=inputs, device=device)
            alone = run(scalar_kernel("gaussian", 3), 3, device, first=first, world=world, body=0)
            np.testing.assert_array_equal(out.numpy().view(np.uint32), alone)


@pytest.mark.parametrize(("noise", "count"), FORMS)
def test_many_blocks_have_the_bits_of_the_scalar_functions(noise, count, device):
    """Enough words for every exponent of the logarithm down to 2⁻¹⁴ and every fold of the angle."""
    world = np.arange(MANY)
    block, scalar = block_kernel(noise, count), scalar_kernel(noise, count)
    how = {"first": 12345, "world": world, "body": 1}
    np.testing.assert_array_equal(run(block, count, device, **how), run(scalar, count, device, **how))


@pytest.mark.parametrize(("noise", "count"), FORMS)
def test_no_lane_knows_where_it_is(noise, count, device):
    """Blocks that overlap agree in the steps they share."""
    kernel = block_kernel(noise, count)
    world = np.arange(100)
    one = run(kernel, count, device, first=100, world=world, body=0)
    for ahead in range(1, BLOCK):
        other = run(kernel, count, device, first=100 + ahead, world=world, body=0)
        np.testing.assert_array_equal(one[:, ahead:], other[:, : BLOCK - ahead])


@pytest.mark.parametrize("count", [3, 6])
def test_moments_of_gaussian_lanes(count, device):
    """Moments 1 to 6 and correlations of lanes; the standard error of a mean of n values of x^p is √(m₂ₚ − m_p²)/√n."""
    x = run(block_kernel("gaussian", count), count, device, first=3, world=np.arange(MANY), body=0).view(np.float32)
    x = x.astype(float)
    moments = [1.0, 0.0, 1.0, 0.0, 3.0, 0.0, 15.0, 0.0, 105.0, 0.0, 945.0, 0.0, 10395.0]
    for order in range(1, 7):
        error = np.sqrt((moments[2 * order] - moments[order] ** 2) / x.size)
        assert abs(np.mean(x**order) - moments[order]) < 5.0 * error, order
    lanes = x.reshape(MANY, -1)
    correlation = lanes.T @ lanes / MANY - np.eye(lanes.shape[1])
    # the diagonal varies as x² does, by √2
    assert np.abs(correlation).max() < 5.0 * np.sqrt(2.0 / MANY)


def test_a_struct_can_hold_on_to_a_block(device):
    """The address survives in a plain number, which is how a step's constants carry it."""

    block = noise_block_term("gaussian", 6)

    @wp.func
    def read(carrier: Carrier, step: wp.int64) -> vec6:
        return six_at(carrier.noise, step)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(out: wp.array(dtype=vec6)):
        buffer = wp.zeros(shape=(wp.static(6 * BLOCK),), dtype=wp.float32)
        carrier = Carrier()
        carrier.noise = address_of(buffer, 0)
        steps = int(BLOCK)
        for n in range(3):
            block(buffer, 0, wp.uint32(SEED), wp.int64(BLOCK * n), 11, 0)
            for k in range(steps):
                out[BLOCK * n + k] = read(carrier, wp.int64(k))

    out = wp.empty(3 * BLOCK, dtype=vec6, device=device)
    wp.launch(kernel, dim=1, inputs=[out], device=device)
    scalar = scalar_kernel("gaussian", 6)
    for n in range(3):
        expected = run(scalar, 6, device, first=BLOCK * n, world=np.array([11]), body=0)[0]
        np.testing.assert_array_equal(out.numpy()[BLOCK * n : BLOCK * (n + 1)].view(np.uint32), expected)
