"""`fast_math`: the same noise to rounding, kept by checkpoints."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from otwarp import Scene, Simulation

BEAD = Path(__file__).parents[2] / "scenes" / "single_bead.usda"


def places(device: str, *, fast_math: bool) -> np.ndarray:
    sim = Simulation(Scene.load(BEAD), worlds=64, seed=11, device=device, fast_math=fast_math)
    sim.step(500)
    return sim.state.position.numpy()


@pytest.mark.thorough
def test_fast_math_changes_trajectories_by_rounding_only(device):
    """Deviates agree to some 1e-6; steps of 9 nm, remembered over 50 steps, differ by much less than a picometre × 1e3.

    On a CPU both have the same blocks of noise, where bodies do not touch.
    The bound of 1e-5 µm is ten times the spacing of float32 numbers at the bead's height of 10 µm.
    """
    accurate, fast = places(device, fast_math=False), places(device, fast_math=True)
    assert accurate.std(axis=0).min() > 1e-3
    difference = np.abs(accurate - fast).max()
    assert difference < 1e-5
    assert (difference == 0.0) == (device == "cpu")


def test_features_tell_the_two_apart(device):
    scene = Scene.load(BEAD)
    accurate, fast = (Simulation(scene, device=device, fast_math=f).model.features for f in (False, True))
    assert fast == dataclasses.replace(accurate, fast_math=True)


def test_a_checkpoint_keeps_it(device, tmp_path):
    sim = Simulation(Scene.load(BEAD), worlds=2, device=device, fast_math=True)
    sim.step(10)
    again = Simulation.restore(sim.save(tmp_path / "c.npz"), device=device)
    assert again.model.features.fast_math
    sim.step(10)
    again.step(10)
    np.testing.assert_array_equal(again.state.position.numpy(), sim.state.position.numpy())
