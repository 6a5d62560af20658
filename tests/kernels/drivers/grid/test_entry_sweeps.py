"""Sweeps over shared entries: those of launches for all worlds, where islands settle at different times."""

from __future__ import annotations

import numpy as np

from otwarp.simulation.block_stepper import BlockStepper
from otwarp.simulation.simulation import Simulation
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
    return {
        "place": sim.state.position.numpy(),
        "force": sim.readout.contact_force.numpy(),
        "load": sim.readout.contact_load.numpy(),
    }


def test_islands_that_have_settled_sleep(monkeypatch, device):
    """With the same forces as sweeps over everything, to what these leave: 1e-6 µm of a gap."""
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    shared = squeezed_rows(device)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    swept = squeezed_rows(device)
    assert np.count_nonzero(swept["load"]) == 10
    np.testing.assert_allclose(shared["place"], swept["place"], atol=2e-6)
    for name in ("force", "load"):
        np.testing.assert_allclose(shared[name], swept[name], atol=5e-3 * swept["load"].max(), err_msg=name)


def test_the_first_guess_is_weighed_by_what_there_is(monkeypatch, device):
    """Seventy bodies fill 35 of the 64 chunks whose sums scale the guess, two in each."""
    monkeypatch.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", 0.0)
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    sim = Simulation(crowd(jumbled(70, 1.8)), device=device, allow_large_step=True)
    sim.step()
    assert isinstance(sim._stepper, BlockStepper)
    share = sim._stepper.scratch.share.numpy()[0]
    assert np.any(share[:35]) and not np.any(share[35:])
