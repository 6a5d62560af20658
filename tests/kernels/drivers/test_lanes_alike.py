"""Lanes that share vectors: the bits of a thread of its own, and which lanes may."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.drivers.lane_groups import GROUP
from otwarp.kernels.drivers.lanes_alike import go_together
from tests.kernels.drivers.test_lanes import WORLDS, assert_same, simulation

ALIKE = {"bodies": 1, "traps": 1, "trap_models": ("harmonic_isotropic",), "escapes": True}


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("the form for CPUs")


@pytest.mark.parametrize(
    "features", [{}, ALIKE, {**ALIKE, "trap_models": ("piecewise_split",)}, {"gravity": True}, {"brownian": False}]
)
def test_a_sphere_that_keeps_its_place_alone_may_share(features):
    assert go_together(Features(**features))


@pytest.mark.parametrize(
    "more",
    [
        {"bodies": 2},
        {"rigid": True},
        {"walls": 1},
        {"periodic": True},
        {"episodes": True},
        {"moving_traps": True},
        {"speed_limits": True},
        {"traps": 3},
        {"trap_models": ("table_bilinear",)},
        {"trap_models": ("harmonic_isotropic", "exact_20_24_bilinear_1")},
        {"integrator": "leimkuhlerMatthews"},
    ],
    ids=str,
)
def test_others_may_not(more):
    assert not go_together(Features(**{**ALIKE, **more}))


@pytest.mark.thorough
def test_worlds_that_differ_go_by_themselves(device):
    """Powers per world, of which the last of the first thread is another one; and all of them the same again."""
    lanes, plain = (simulation("one trap", device, lanes=form) for form in (True, False))
    powers = np.full((WORLDS, 1), 5.0)
    powers[GROUP - 1] = 9.0
    for given in (powers, np.full((WORLDS, 1), 5.0)):
        for sim in (lanes, plain):
            sim.control.set(trap_power=given)
            sim.step(40)
        assert_same(lanes, plain)


def test_one_sphere_near_the_rim_holds_no_other_up(device):
    """A sphere that may escape at any time sends its thread through every block twice: nothing of it shows."""
    lanes, plain = (simulation("one trap", device, lanes=form) for form in (True, False))
    for sim in (lanes, plain):
        start = sim.state.position.numpy()
        start[5, 0] += np.float32([0.39, 0.0, 0.0])
        sim.set_state(position=start)
        sim.step(400)
    assert lanes.last_readout.escape_step.numpy()[5, 0] > 0
    assert_same(lanes, plain)
