"""How bodies share the threads of a CPU, and how long a block of their noise lasts."""

from otwarp.kernels.core.features import Features
from otwarp.kernels.cpu.noise_block import BLOCK
from otwarp.kernels.drivers.lane_groups import GROUP, draws_blocks, fresh_steps, threads_for


def test_threads_hold_all_bodies():
    assert [threads_for(n) for n in (1, GROUP, GROUP + 1, 10 * GROUP)] == [1, 1, 2, 10]


def test_a_block_lasts_as_long_as_no_step_looks_beyond_it():
    assert fresh_steps(Features(integrator="heun")) == BLOCK
    assert fresh_steps(Features(integrator="leimkuhlerMatthews")) == BLOCK - 1


def test_blocks_are_for_noise_far_from_walls():
    assert [draws_blocks(f) for f in (Features(), Features(brownian=False), Features(walls=1))] == [True, False, False]
