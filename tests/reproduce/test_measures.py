"""Figures of merit against closed forms and published values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.reproduce.measures import (
    agreement,
    difference_of_shares,
    fisher,
    mean_of_trials,
    share,
)


def test_a_constant_offset_has_its_closed_form():
    """Of f = sin over whole periods with b added: MSE = RMSE² = MAE² = b², R² = 1 − b²/(1/2)."""
    f = np.sin(np.linspace(0.0, 2.0 * math.pi, 1000, endpoint=False))
    found = agreement(f + 0.1, f)
    assert found.mse == pytest.approx(0.01) and found.rmse == pytest.approx(0.1) and found.mae == pytest.approx(0.1)
    assert found.r_squared == pytest.approx(1.0 - 0.01 / 0.5)
    assert found.count == 1000


def test_a_lag_has_its_closed_form():
    """Of sin(x) late by a: mean square 1 − cos a, R² = 2 cos a − 1."""
    x = np.linspace(0.0, 2.0 * math.pi, 5000, endpoint=False)
    found = agreement(np.sin(x - 0.3), np.sin(x))
    assert found.mse == pytest.approx(1.0 - math.cos(0.3))
    assert found.r_squared == pytest.approx(2.0 * math.cos(0.3) - 1.0)


def test_the_mean_as_an_estimate_has_r_squared_of_zero():
    f = np.array([1.0, 2.0, 6.0])
    assert agreement(np.full(3, f.mean()), f).r_squared == pytest.approx(0.0)
    assert math.isnan(agreement([1.0, 1.0], [2.0, 2.0]).r_squared), "nothing varies: it has none"


def test_the_published_figures_are_consistent():
    """MSE/(1 − R²) of the paper is the variance of its model force; √MSE is its RMSE."""
    for mse, rmse, r_squared, spread in ((5.460e-5, 0.0074, 0.9525, 0.0339), (2.1005e-4, 0.0145, 0.9268, 0.0536)):
        assert math.sqrt(mse) == pytest.approx(rmse, abs=5e-5)
        assert math.sqrt(mse / (1.0 - r_squared)) == pytest.approx(spread, abs=5e-5)


def test_eight_of_ten_against_three_of_ten():
    """Fisher's p by its sum of hypergeometric terms."""
    choose = math.comb
    terms = [choose(10, k) * choose(10, 11 - k) / choose(20, 11) for k in range(1, 11)]
    expected = sum(t for t in terms if t <= choose(10, 8) * choose(10, 3) / choose(20, 11) * (1.0 + 1e-9))
    assert fisher((8, 10), (3, 10)) == pytest.approx(expected)
    assert expected == pytest.approx(0.0698, abs=1e-4)


def test_newcombe_published_example():
    """56/70 against 48/80: 0.2, 0.0524 to 0.3339 (Newcombe 1998, table II, method 10)."""
    found, (low, high) = difference_of_shares((56, 70), (48, 80))
    assert found == pytest.approx(0.2)
    assert (low, high) == (pytest.approx(0.0524, abs=1e-4), pytest.approx(0.3339, abs=1e-4))


def test_shares_and_means_state_their_uncertainty():
    assert share(10, 10)[1][0] == pytest.approx(0.025 ** (1 / 10))
    assert mean_of_trials([1.0, 3.0]) == (2.0, pytest.approx(1.0))
    assert math.isnan(mean_of_trials([1.0])[1])
