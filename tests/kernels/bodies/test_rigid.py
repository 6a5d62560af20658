"""Rigid bodies turn, and their orientation stays one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Scene
from otwarp.simulation.packing.bodies import mobilities, union_volume
from otwarp.simulation.packing.traps import rotate
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import (
    VISCOSITY,
    robot,
)
from tests.simulation.test_motion import QUIET


def test_orientation_stays_a_unit_quaternion(device):
    """1e5 steps of free rotation leave the norm at 1 to rounding."""
    from tests.simulation.test_statistics import free_scene

    sim = Simulation(free_scene(), seed=2, device=device)
    sim.step(100_000)
    q = sim.state.orientation.numpy().astype(float)[0, 1]
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=3e-7)
    assert abs(q @ sim.model.start_orientation()[1]) < 0.999  # and it did turn


def test_a_bottom_heavy_body_turns_until_it_hangs(device):
    """Weight acts at the centroid: a large sphere beside a small one swings below it, at the rate arm·W·μ_r."""
    pear = dataclasses.replace(robot("Pear", shape=(((0.0, 0, 0), 1.5), ((2.0, 0, 0), 0.7))), density=4000e-12)
    sim = Simulation(Scene(bodies=(pear,), settings=QUIET), device=device)
    move, load = mobilities(sim.scene)[0], float(sim.model.data.body.weight.numpy()[0])
    arm = union_volume(pear)[1] - move.reference
    np.testing.assert_allclose(sim.model.data.body.weight_arm.numpy()[0], arm, rtol=1e-6)
    assert arm[0] < -0.05
    sim.step(20)
    axis = rotate(sim.state.orientation.numpy()[0, 0], np.array([1.0, 0.0, 0.0]))
    # the arm lies along −x and the force along −z, so the torque is about −y: the small end rises
    rate = load * abs(arm[0]) * move.mobility[4, 4] / VISCOSITY
    assert axis[2] == pytest.approx(rate * sim.time, rel=1e-2)
    sim.step(int(8.0 / rate / sim.time_step))
    axis = rotate(sim.state.orientation.numpy()[0, 0], np.array([1.0, 0.0, 0.0]))
    assert axis[2] > 0.99
