"""The cost of a servo period is measured for every chain that there is: tiny sizes, no claim about speed."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from benchmarks import operators_chain
from otwarp.device import pick_device
from otwarp.teleop.operators import plan_hands


def test_every_chain_has_its_cost(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(operators_chain, "PERIODS", 16)
    monkeypatch.setattr(operators_chain, "WORLDS", {"cpu": (2,), "cuda": (2,)})
    shown, data = operators_chain.table(pick_device("cpu"), 2)
    assert [len(row) for row in shown.rows] == [3] * 3
    assert set(data) == {"stable", "paper"}
    assert all(cost["median"] > 0.0 for ways in data.values() for cost in ways.values())
    assert "batched, 2 worlds" in data["paper"]


def test_both_are_asked_for_the_same_force():
    """What is timed works: the batch's forces are the servo's at the end of the measured periods."""
    given = operators_chain.Given()
    plans = plan_hands(given.scene, {"left": "virtual", "right": "virtual"})
    batch = operators_chain.batch_of(given, plans, 2, wp.get_device("cpu"))
    chains = operators_chain.chains_of(given, plans, None)
    for n in range(30):
        places = given.hands(n)
        batch.hand.assign(np.tile(places, (2, 1, 1)))
        if n % operators_chain.STATE == 0:
            batch.refresh(operators_chain.PERIOD * n)
        batch.step()
        for chain, sample in zip(chains, given.samples(n), strict=True):
            chain.step(sample, given.frame(n))
    forces = batch.asked.numpy()
    assert forces[1] == pytest.approx(np.array([chain.asked for chain in chains]), rel=1e-12, abs=1e-12)
    assert abs(forces).max() > 1e-2
