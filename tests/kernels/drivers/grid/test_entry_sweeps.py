"""Sweeps over shared entries: those of launches for all worlds, where each body has a list."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.kernels.drivers.grid.entry_sweeps import WEIGHTS
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.simulation import Simulation
from tests.kernels.drivers.grid.test_turns import jostling
from tests.kernels.drivers.grid.test_world import with_robot
from tests.simulation.contact_errors import contact_errors, forget_entries
from tests.simulation.crowds import crowd, jumbled
from tests.simulation.setups import harmonic, neutral
from tests.simulation.test_contact_chains import still


def squeezed_rows(device: str) -> dict[str, np.ndarray]:
    """A row of six beads that two traps press together, which takes many sweeps, and two pairs that take few."""
    row = tuple(neutral(f"R{i}", (1.999 * i, 0, 0)) for i in range(6))
    pairs = tuple(neutral(f"P{i}", (1.998 * (i % 2), 20.0 * (1 + i // 2), 0)) for i in range(4))
    traps = (harmonic("T0", (0.4, 0, 0), cutoff=1.0), harmonic("T1", (9.595, 0, 0), cutoff=1.0))
    sim = Simulation(still((*row, *pairs), 1e-3, traps), device=device, allow_large_step=True)
    sim.step(3)
    return ended(sim)


def ended(sim: Simulation) -> dict[str, np.ndarray]:
    """Places [µm] and contact readout [pN]."""
    return {
        "place": sim.state.position.numpy(),
        "force": sim.readout.contact_force.numpy(),
        "load": sim.readout.contact_load.numpy(),
    }


def test_shared_entries_have_the_forces_of_lists_by_body(monkeypatch, device):
    """To what sweeps leave: 1e-6 µm of each gap, of lists by body somewhat more."""
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    shared = squeezed_rows(device)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    swept = squeezed_rows(device)
    assert np.count_nonzero(swept["load"]) == 10
    np.testing.assert_allclose(shared["place"], swept["place"], atol=4e-6)
    for name in ("force", "load"):
        np.testing.assert_allclose(shared[name], swept[name], atol=5e-3 * swept["load"].max(), err_msg=name)


def test_the_first_guess_is_weighed_as_from_lists_by_body(monkeypatch, device):
    """Numerator and denominator of its scale, of seventy bodies."""
    monkeypatch.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", 0.0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    scene = crowd(jumbled(70, 1.8))
    shared = Simulation(scene, device=device, allow_large_step=True)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    swept = Simulation(scene, device=device, allow_large_step=True)
    for sim, stepper in ((shared, BlockStepper | GridPhasesStepper), (swept, GridStepper)):
        assert isinstance(sim._stepper, stepper)
        sim.step()
    weight = shared._stepper.scratch.entry.weight.numpy()[0] / WEIGHTS
    np.testing.assert_allclose(weight, swept._stepper.scratch.share.numpy()[0].sum(axis=0), rtol=1e-4)
    assert weight[1] > 0.0


@pytest.mark.parametrize("make", [jostling, with_robot])
def test_no_entry_is_left_out_of_its_tolerance(make, monkeypatch, device):
    """Spheres that noise moves, and a heap with a robot in two stages; tolerances drift by 2 % with what is left.

    When sweeps ended after the first that changed no load by more than its tolerance, its own pushes were not looked
    at, nor what a load that row sums hold back still lacked: these scenes were left 1.9 and 2.0 times out, the shipped
    channel after 5,000 steps 5.3 times.
    """
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    sim = Simulation(make(), seed=4, device=device, threads=1, allow_large_step=True)
    assert isinstance(sim._stepper, BlockStepper | GridPhasesStepper)
    sim.step(180)
    worst, carrying = 0.0, 0
    for _ in range(100):
        forget_entries(sim)
        sim.step()
        load, error, tolerance = contact_errors(sim)
        worst = max(worst, float(np.max(error / tolerance, initial=0.0)))
        carrying += np.count_nonzero(load)
    assert carrying > 500
    assert 0.1 < worst < 1.05
