"""What is solved in a step: what free moves may close, and then what pushes have closed."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.simulation import Simulation
from tests.kernels.drivers.grid.test_entry_sweeps import ended
from tests.simulation.setups import harmonic, neutral
from tests.simulation.test_contact_chains import still

GAP = 0.02
"""Between beads of a row [µm]: a fifth of what the one behind it goes in a step."""


def shoved_row(device: str) -> dict[str, np.ndarray]:
    """Six beads, of which a trap takes the last along, and four far away, after one step."""
    row = tuple(neutral(f"R{i}", ((2.0 + GAP) * i, 0, 0)) for i in range(6))
    away = tuple(neutral(f"A{i}", (5.0 * i, 20.0, 0)) for i in range(4))
    traps = (harmonic("T0", (0.9, 0, 0), cutoff=1.0), harmonic("T1", (0, 40.0, 0), cutoff=1.0))
    sim = Simulation(still((*row, *away), 5e-4, traps), device=device, allow_large_step=True)
    sim.step()
    return ended(sim) | {"shared": np.array(isinstance(sim._stepper, BlockStepper | GridPhasesStepper))}


@pytest.mark.thorough
def test_gaps_that_only_pushes_close_are_closed_in_the_same_step(monkeypatch, device):
    """All five, as where each neighbour is solved from the beginning; free moves close the first alone."""
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    searched = shoved_row(device)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    listed = shoved_row(device)
    assert searched.pop("shared")
    assert not listed.pop("shared")
    assert np.count_nonzero(searched["load"]) == 6
    np.testing.assert_allclose(searched["place"], listed["place"], atol=5e-6)
    for name in ("force", "load"):
        np.testing.assert_allclose(searched[name], listed[name], atol=5e-3 * listed["load"].max(), err_msg=name)
