"""Simulated operators on a device are those of the CPU: the same numbers drawn, the same hands, chains and physics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.operators.study import OperatorStudy
from otwarp.scene import Scene

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "cell_delivery.usda"
OPERATORS, SECONDS = 4, 0.25
ROUNDING = 2e-4
"""Of places after 500 steps in float32, in sums of another order [µm]; robots move by some tenths of a µm."""


def test_operators_do_on_a_device_what_they_do_on_a_cpu(device: str):
    study = OperatorStudy(scene=Scene.load(SCENE), operators=OPERATORS, conditions=("with",), seed=7)
    loops = [study.loop(np.arange(OPERATORS), where) for where in ("cpu", device)]
    began = loops[0].sim.state.position.numpy().copy()
    for loop in loops:
        loop.run(SECONDS)
    here, there = (loop.sim.state.position.numpy() for loop in loops)
    assert np.abs(here - began).max() > 0.02
    np.testing.assert_allclose(there, here, atol=ROUNDING)
    hands = [loop.chain.hand.numpy() for loop in loops]
    np.testing.assert_allclose(hands[1], hands[0], atol=1e-3 * np.ptp(hands[0]))
    forces = [loop.chain.force.numpy() for loop in loops]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-3 * np.abs(forces[0]).max())
    assert np.abs(forces[0]).max() > 0.0
