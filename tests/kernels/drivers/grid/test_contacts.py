"""Sweeps over the contacts of many bodies: what they do not settle stops the run."""

from __future__ import annotations

import pytest

from otwarp.errors import SimulationError
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import harmonic, line, neutral
from tests.simulation.test_contact_chains import still


@pytest.mark.parametrize("alone", [0, 512])
def test_unfinished_sweeps_stop_the_run(alone, monkeypatch, device):
    """With two sweeps in place of 32, or 64, a row that a trap drives at 200 µm/s would be squeezed flat.

    Launch by launch, and where a block of threads has the world to itself.
    """
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", alone)
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    monkeypatch.setattr("otwarp.simulation.drivers.grid_scratch.RELAXATIONS", 2)
    # compiled into the step of a block, which no other test has for so many beads
    monkeypatch.setattr("otwarp.kernels.drivers.grid.entry_sweeps.SWEEPS", 2)
    beads = tuple(neutral(f"B{i}", (-2.0 * i, 0, 50)) for i in range(9))
    trap = harmonic("T", line((0.0, (-16.0, 0, 50)), (10.0, (1984.0, 0, 50))), cutoff=1.0)
    sim = Simulation(still(beads, 1e-3, (trap,)), device=device, allow_large_step=True)
    with pytest.raises(SimulationError, match="the contact forces of one step were not found"):
        sim.step(50)
