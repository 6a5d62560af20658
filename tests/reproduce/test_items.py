"""Items: what they compute, against closed forms and the toolbox's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.haptics.check.fidelity import release, sweep, touch
from otwarp.haptics.core.config import RELEASE_ALPHA
from otwarp.laws import TrapLaw
from otwarp.optics.fit import fit_curve, pull
from otwarp.reproduce.items import rendering
from otwarp.reproduce.items.chain import DISTANCE, MESSAGES, settled_force
from otwarp.reproduce.items.handle import BEAM, fits
from otwarp.reproduce.items.strategy_a import closed_form, thermal
from otwarp.reproduce.items.strategy_b import against_moving
from otwarp.reproduce.items.tilts import Tilts, balance, held, length
from otwarp.reproduce.measures import agreement
from otwarp.scene import Scene
from tests.optics.pack_reference import cases

LINE = TrapLaw(stiffness=1.0, threshold=10.0, cutoff=10.0, power=1.0)
"""A spring that a sweep never leaves."""


def test_the_fit_of_the_toolbox_is_the_fit_of_ours():
    """Eq. 1 fitted to the toolbox's curve of a polymer sphere has the errors that it states for itself."""
    case = next(c for c in cases() if c.name.startswith("c4_polymer"))
    radial = np.abs(case.points[:, 1]) + np.abs(case.points[:, 2] - case.equilibrium) < 1e-9
    x, q = case.points[radial, 0], -case.force[radial, 0]
    d, q = np.abs(x), np.sign(x) * q
    fit = fit_curve("radial", d, q, case.beam, continuous=True)
    found = agreement(pull(fit.law, d) / case.beam.force_scale, q)
    assert len(d) > 50
    assert (found.rmse, found.r_squared) == (pytest.approx(fit.rmse), pytest.approx(fit.r_squared))
    assert 0.8 < found.r_squared < 0.95, "eq. 1 does not follow a curve that steepens before its peak"


def test_the_release_renders_what_its_filter_makes_of_published_forces():
    """y ← y + (1 − 0.95²)(x − y) at every published state: two messages each, and held in between."""
    one = sweep(release(force_gain=0.01), "radial", 0.1, radial=LINE, axial=LINE, power=1.0, sweeps=1.0)
    states = np.floor(60.0 * one.time + 1e-9)
    kept, y, last, expected = (1.0 - RELEASE_ALPHA) ** 2, 0.0, states[0], []
    for state, x in zip(states, one.at_trap, strict=True):
        if state != last:
            y, last = x + kept * (y - x), state
        expected.append(y)
    assert np.abs(one.at_trap).max() > 0.09 and len(set(one.at_trap)) > 100
    assert one.rendered == pytest.approx(np.array(expected), abs=1e-9)


@pytest.mark.thorough
def test_our_chain_follows_a_fast_hand_and_the_release_does_not():
    ours, theirs = (rendering.judged(rendering.swept(chain, "radial", 0.1)) for chain in ("stable", "paper"))
    assert ours.r_squared > 0.999
    assert theirs.r_squared < 0.6
    assert touch().chain.passivity is not None


def test_moving_runs_are_set_against_the_balance_where_traps_are_as_far_apart():
    """Runs that are 1° off to both sides err by 1°, whatever their sign and wherever the moments between lie."""
    apart, spacing = np.linspace(10.0, 8.0, 201), np.array([8.0, 8.5, 9.5])
    line = 10.0 * (10.0 - apart)
    angle = np.stack([line + 1.0, -(line - 1.0)], axis=1)
    (rmse, rmse_error), (mae, _) = against_moving(Tilts(apart, angle, np.abs(angle)), spacing, 10.0 * (spacing - 10.0))
    assert (rmse, mae, rmse_error) == (pytest.approx(1.0), pytest.approx(1.0), pytest.approx(0.0, abs=1e-9))


def test_the_crossing_time_is_that_of_the_law():
    cutoff = fits()["axial"].law.cutoff
    assert rendering.crossing("axial", 0.01) == pytest.approx(2.0 * cutoff / 100.0 / 0.01)
    assert BEAM.power == 20.0


def test_the_release_settles_as_its_filter_says():
    """G·K·d·(1 − 0.95⁹⁹)."""
    expected = 0.0022 * 12000.0 * DISTANCE * (1.0 - 0.95**MESSAGES)
    assert settled_force() == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(1.312, abs=5e-4)


def test_the_fork_of_strategy_a():
    """cos θ = d/((1 − η)L); the thermal mean tends to it where noise is small, away from the fork."""
    assert np.round(closed_form(np.array([0.5, 0.6, 0.7, 0.8]), 0.2)).tolist() == [51.0, 41.0, 29.0, 0.0]
    far = np.array([0.5, 0.7])
    assert thermal(far, 0.2, 1e5) == pytest.approx(closed_form(far, 0.2), abs=0.02)
    assert thermal(np.array([0.8]), 0.2, 1e5)[0] > 1.0, "noise rounds the fork"
    assert math.isclose(closed_form(np.array([0.9]), 0.2)[0], 0.0)


@pytest.mark.parametrize("spacing", [0.55, 0.7, 0.9])
def test_the_balance_of_forces_is_the_closed_form_in_harmonic_traps(spacing: float):
    scene = Scene.load("scenes/strategy_a.usda")
    power = np.array([20.0, 20.0])
    found = balance(scene, spacing * length(scene), power, 20.0)
    assert abs(found) == pytest.approx(closed_form(np.array([spacing]), 0.2)[0], abs=1e-3)
    assert np.linalg.norm(held(scene)[1]) == pytest.approx(0.5 * length(scene))
