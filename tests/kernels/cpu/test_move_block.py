"""Moves in vector registers against the same arithmetic in NumPy, and what they leave to scalar code."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.cpu.move_block import MOVES, move_block_term

COUNT = 3 * MOVES
SPREAD, MOBILITY, QUANTA, FARTHEST, SKIN = 0.02, 0.3, 2.0**40, 1e9, 0.4
BLOCK = MOVES
"""First slot of the block that moves: there are others before and after it."""


@wp.kernel(module="unique", enable_backward=False)
def probe(
    places: wp.array2d(dtype=wp.vec4), order: wp.array2d(dtype=wp.int32), shape: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.float32), walled: wp.array(dtype=wp.int32), deviates: wp.array(dtype=wp.float32),
    push: wp.array(dtype=wp.vec4l), reference: wp.array(dtype=wp.vec3), done: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Move the second block of three."""
    move = wp.static(move_block_term(True, True))
    done[0] = move(
        places, 1, order, 0, BLOCK, shape, 2, weight, walled, SPREAD, MOBILITY, wp.float64(QUANTA), FARTHEST, deviates,
        7, push, reference, SKIN,
    )  # fmt: skip


class Setup:
    """Arrays of three blocks, which a test may spoil before it moves the second one."""

    def __init__(self) -> None:
        rng = np.random.default_rng(6)
        start = np.concatenate([rng.uniform(-9.0, 9.0, (COUNT, 3)), rng.uniform(0.5, 1.0, (COUNT, 1))], axis=1)
        self.places = np.stack([np.zeros((COUNT, 4)), start]).astype(np.float32)
        self.order = np.stack([rng.permutation(COUNT), np.zeros(COUNT)]).astype(np.int32)
        self.shape = np.ones(COUNT, np.int32)
        self.weight = rng.uniform(-0.1, 0.1, COUNT).astype(np.float32)
        self.walled = np.zeros(COUNT, np.int32)
        self.deviates = rng.normal(size=7 + 3 * MOVES).astype(np.float32)
        self.push = (rng.uniform(-0.2, 0.2, (COUNT, 4)) * QUANTA).astype(np.int64)
        self.reference = start[:, :3].astype(np.float32)
        self.done = np.zeros(1, np.int32)

    def moved(self, device: str) -> int:
        """Launch, keep what came of it, and return what the block said."""
        types = {"places": wp.vec4, "push": wp.vec4l, "reference": wp.vec3}
        arrays = {
            name: wp.array(values, dtype=types.get(name, wp.dtype_from_numpy(values.dtype)), device=device)
            for name, values in vars(self).items()
        }
        wp.launch(probe, dim=1, inputs=list(arrays.values()), device=device)
        vars(self).update({name: array.numpy() for name, array in arrays.items()})
        return int(self.done[0])


@pytest.fixture
def setup(device: str) -> Setup:
    if not wp.get_device(device).is_cpu:
        pytest.skip("moves in blocks are for CPUs")
    return Setup()


def test_moves_have_the_bits_of_the_same_arithmetic(setup: Setup, device: str) -> None:
    """Noise and weight first, then the contact force; radii stay, sums begin anew, other blocks are not touched."""
    before = Setup()
    assert setup.moved(device) == 1
    own = slice(BLOCK, BLOCK + MOVES)
    noise = before.deviates[7:].reshape(3, MOVES).T
    force = (before.push[own, :3] / QUANTA).astype(np.float32)
    fall = np.zeros((MOVES, 3), np.float32)
    fall[:, 2] = np.float32(MOBILITY) * -before.weight[before.order[0, own]]
    start = before.places[1, own, :3]
    wanted = (start + (fall + np.float32(SPREAD) * noise)) + np.float32(MOBILITY) * force
    np.testing.assert_array_equal(setup.places[0, own, :3], wanted)
    np.testing.assert_array_equal(setup.places[0, own, 3], before.places[1, own, 3])
    assert not setup.push[own].any()
    others = np.r_[:BLOCK, BLOCK + MOVES : COUNT]
    np.testing.assert_array_equal(setup.push[others], before.push[others])
    assert not setup.places[0, others].any()
    np.testing.assert_array_equal(setup.places[1], before.places[1])


@pytest.mark.parametrize("k", [0, 6, MOVES - 1])
def test_one_that_has_gone_far_asks_for_new_lists(setup: Setup, k: int, device: str) -> None:
    setup.reference[BLOCK + k, 1] += 1.5
    assert setup.moved(device) == 2


@pytest.mark.parametrize("k", [0, 6, MOVES - 1])
@pytest.mark.parametrize("what", ["another shape", "an obstacle", "not a number", "thrown out"])
def test_what_is_rare_moves_nothing(setup: Setup, what: str, k: int, device: str) -> None:
    if what == "another shape":
        setup.shape[setup.order[0, BLOCK + k]] = 2
    elif what == "an obstacle":
        setup.walled[BLOCK + k] = 4
    elif what == "not a number":
        setup.places[1, BLOCK + k, 2] = np.nan
    else:
        setup.places[1, BLOCK + k, 0] = 2e9
    push = setup.push.copy()
    assert setup.moved(device) == 0
    assert not setup.places[0].any()
    np.testing.assert_array_equal(setup.push, push)
