"""Contacts that take turns end where the sweeps end, and say so when they do not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import SimulationError
from otwarp.scene import Material, Scene
from otwarp.simulation.simulation import Simulation
from tests.kernels.drivers.grid.test_world import with_robot
from tests.simulation.contact_errors import contact_errors
from tests.simulation.crowds import crowd, jumbled
from tests.simulation.setups import harmonic, line, neutral
from tests.simulation.test_contact_chains import still
from tests.simulation.test_periodic import squeezed

SAME = 2e-3
"""Relative difference of forces of two solvers that both leave 1e-6 µm of a gap of some nm."""


@pytest.fixture
def grid(monkeypatch, device) -> str:
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    if device != "cpu":
        pytest.skip("a CPU's form of the contacts")
    return device


def squeezed_step(device: str, steps: int = 25) -> dict[str, np.ndarray]:
    scene = squeezed((12.2, 0.0, 0.0))
    sim = Simulation(scene, worlds=2, device=device, allow_large_step=True)
    sim.step(steps)
    return {
        "force": sim.readout.contact_force.numpy(),
        "load": sim.readout.contact_load.numpy(),
        "place": sim.unwrapped_position(),
        "in_turn": np.array(sim.model.features.in_turn),
    }


@pytest.mark.cpu_forms
def test_turns_and_sweeps_find_the_same_forces(grid, monkeypatch):
    turns = squeezed_step(grid)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    sweeps = squeezed_step(grid)
    assert turns.pop("in_turn") and not sweeps.pop("in_turn")
    assert turns["load"].min() > 1.0
    for name, value in turns.items():
        np.testing.assert_allclose(value, sweeps[name], rtol=SAME, atol=1e-3, err_msg=name)


def jostling() -> Scene:
    """Spheres of 1 kPa that noise moves by 0.02 µm a step: contacts with a path and without lean on each other."""
    base = crowd(jumbled(125, jitter=0.05), temperature=298.15)
    bodies = tuple(
        dataclasses.replace(b, material=Material(youngs_modulus=1e3, poisson_ratio=0.4)) for b in base.bodies
    )
    return dataclasses.replace(base, bodies=bodies)


@pytest.mark.cpu_forms
@pytest.mark.parametrize("make", [jostling, with_robot])
def test_no_contact_is_left_out_of_its_tolerance(make, grid):
    """Of lone spheres, and of a heap with a robot on a floor; tolerances drift by 2 % with what is left.

    When a contact marked its move only beyond its own tolerance, others were left 237 and 25 times out of theirs: that
    of a path is a nanometre.
    """
    sim = Simulation(make(), seed=4, device=grid, threads=1, allow_large_step=True)
    assert sim.model.features.in_turn
    sim.step(180)
    worst, carrying, drawn = 0.0, 0, 0
    for _ in range(100):
        sim.step()
        load, error, tolerance = contact_errors(sim)
        worst = max(worst, float(np.max(error / tolerance)))
        carrying += np.count_nonzero(load)
        drawn += np.count_nonzero(tolerance > 1e-5)
    assert carrying > 500 and 0.1 * carrying < drawn
    assert 0.1 < worst < 1.05


def test_the_third_law_holds_to_the_last_bit(grid):
    """Both partners of a pair have one load: net forces of the pair and of what it leans on add up."""
    scene = dataclasses.replace(squeezed(), obstacles=(), traps=())
    first, second = (
        dataclasses.replace(b, position=(x, 0.0, 3.0)) for b, x in zip(scene.bodies, (-0.9, 0.9), strict=True)
    )
    sim = Simulation(dataclasses.replace(scene, bodies=(first, second)), device=grid, allow_large_step=True)
    sim.step(3)
    force = sim.readout.contact_force.numpy()[0]
    assert np.abs(force[0]).max() > 0.1
    assert np.array_equal(force[0], -force[1])


def test_unfinished_turns_stop_the_run(grid, monkeypatch):
    """As with sweeps: one round is not enough for a row that a trap drives at 200 µm/s."""
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: True)
    monkeypatch.setattr("otwarp.simulation.drivers.block_stepper.TURNS", 1)
    beads = tuple(neutral(f"B{i}", (-2.0 * i, 0, 50)) for i in range(8))
    trap = harmonic("T", line((0.0, (-14.0, 0, 50)), (10.0, (1986.0, 0, 50))), cutoff=1.0)
    sim = Simulation(still(beads, 1e-3, (trap,)), device=grid, allow_large_step=True)
    with pytest.raises(SimulationError, match="the contact forces of one step were not found"):
        sim.step(50)
