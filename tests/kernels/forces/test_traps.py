"""The optical force of all traps on a lone sphere: few, whose constants it carries along, or many."""

import functools

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.forces.traps import traps_on_sphere
from otwarp.simulation.model import Model
from tests.kernels.forces.setups import CUTOFF, FOCI, ROUNDING, on_sphere, places, scene
from tests.simulation.setups import STIFFNESS


def springs(points: np.ndarray, foci) -> np.ndarray:
    """(n, 3) sum of springs that end at the cutoff [pN]."""
    away = points[:, None] - np.array(foci)
    return -STIFFNESS * np.sum(np.where(np.linalg.norm(away, axis=2, keepdims=True) < CUTOFF, away, 0.0), axis=1)


@pytest.mark.parametrize("traps", [1, 2, 3])
def test_traps_within_reach_add_up(traps, device):
    model = Model.build(scene(traps=traps), device=device)
    force = on_sphere(model, functools.partial(traps_on_sphere, what="force"))
    expected = springs(places()[0], FOCI[:traps])
    assert np.any(expected)
    np.testing.assert_allclose(force, expected, atol=ROUNDING * 4.0 * STIFFNESS)


def test_stiffness_is_that_of_the_traps_within_reach(device):
    model = Model.build(scene(traps=2), device=device)
    stiffness = on_sphere(model, functools.partial(traps_on_sphere, what="stiffness"), wp.mat33)
    inside = np.linalg.norm(places()[0][:, None] - np.array(FOCI[:2]), axis=2) < CUTOFF
    expected = STIFFNESS * inside.sum(axis=1)[:, None, None] * np.eye(3)
    np.testing.assert_allclose(stiffness, expected, rtol=ROUNDING)


def test_they_do_not_act_on_what_is_not_trapped(device):
    model = Model.build(scene(traps=1, trapped=False), device=device)
    assert not np.any(on_sphere(model, functools.partial(traps_on_sphere, what="force")))
