"""Intervals of rates, means and ratios by simulation: they hold the truth as often as they say, at 5σ.

An interval that is exact has no allowance; one that counts on many trials may miss by what its approximation leaves at
the numbers of trials that are simulated, which stands beside it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray

from otwarp.analysis import crooks, jarzynski
from otwarp.analysis.lifetimes import escape_rates
from otwarp.studies.rare.results import bound_of_unseen, halved_rates, mean_of_runs
from otwarp.studies.results import moments
from otwarp.studies.stopping.intervals import errors_to_the_ends, rate_interval
from otwarp.units import BOLTZMANN
from tests.analysis.truth import check_coverage

THERMAL = BOLTZMANN * 298.15


@pytest.mark.parametrize("trials", [16, 256])
@pytest.mark.parametrize("horizon", [0.02, 0.5, 5.0])
def test_rates_of_first_passages_that_are_censored(trials, horizon):
    """Events over exposure, of lives at a constant rate of 1/s that are cut off at the horizon: rare to nearly all."""
    lives = np.random.Generator(np.random.Philox(31)).exponential(1.0, (4_000, trials))
    events = np.sum(lives <= horizon, axis=-1)
    exposure = np.sum(np.minimum(lives, horizon), axis=-1)
    low, high = rate_interval(events, exposure)
    # Garwood's counts events of a fixed exposure; here that ends with each: a shift of less than half an event
    check_coverage(((low <= 1.0) & (high >= 1.0))[:, None], allowance=0.01)
    same = escape_rates(events[:8], exposure[:8])
    assert np.array_equal(same["rate_low"], low[:8]) and np.array_equal(same["rate_high"], high[:8])


@pytest.mark.parametrize("expected", [0.5, 2.0, 3.6, 5.0])
def test_the_bound_where_all_trials_are_censored(expected):
    """No first passage in 32 trials: the upper end is below the truth in a fortieth of all studies, at most."""
    random = np.random.Generator(np.random.Philox(36))
    horizon = expected / 32
    lives = random.exponential(1.0, (8_000, 32))
    none = np.all(lives > horizon, axis=-1)
    high = rate_interval(np.zeros(8_000), np.full(8_000, 32 * horizon))[1]
    check_coverage(~(none & (high < 1.0))[:, None], level=0.975)
    assert none.mean() == pytest.approx(np.exp(-expected), abs=5.0 * np.sqrt(np.exp(-expected) / 8_000))


@pytest.mark.parametrize("last", [0.5, 1.0, 2.9, 4.0])
@pytest.mark.parametrize("stages", [1, 3])
def test_the_bound_of_escapes_that_no_run_has_seen(stages, last):
    """16 runs of 64 paths a stage, where so many of all are expected to come through the last one.

    The rate of a run whose paths all failed is 0, and the stages behind are not there. Where all runs failed the bound
    is below the truth in a twentieth of all studies, at most.
    """
    random = np.random.Generator(np.random.Philox(37))
    runs, branches, before, studies = 16, 64, 0.3, 4_000
    p = np.full(stages, before)
    p[-1] = last / (runs * branches)
    passed = random.binomial(branches, p, (studies, runs, stages)) / branches
    alive = np.cumprod(passed > 0.0, axis=-1).astype(bool)
    there = np.concatenate([np.ones((studies, runs, 1), dtype=bool), alive[..., :-1]], axis=-1)
    flux = random.gamma(400.0, 2.0 / 400.0, (studies, runs))  # 5 % to either side
    raw = {
        "probability_of_trial": xarray.DataArray(np.where(there, passed, np.nan)),
        "flux_of_trial": xarray.DataArray(flux),
    }
    bound = bound_of_unseen(raw, np.ones((studies, runs), dtype=bool), branches, 0.95)
    none = ~np.any(alive[..., -1], axis=-1)
    check_coverage(~(none & (bound < 2.0 * np.prod(p)))[:, None])
    assert none.mean() == pytest.approx(np.exp(-last), abs=0.05)


@pytest.mark.parametrize(
    ("shape", "trials", "allowance"),
    [("normal", 3, 0.0), ("normal", 8, 0.0), ("normal", 64, 0.0), ("skewed", 8, 0.03), ("skewed", 64, 0.01)],
)
def test_means_of_numbers(shape, trials, allowance):
    """Means of few and of many trials, as pictures have them: Student's, exact for normal numbers alone."""
    random = np.random.Generator(np.random.Philox(32))
    drawn = random.normal(3.0, 2.0, (4_000, trials)) if shape == "normal" else random.gamma(4.0, 0.75, (4_000, trials))
    raw = xarray.Dataset({"force_of_trial": (("point", "trial"), drawn)})
    good = np.ones_like(drawn, dtype=bool)
    good[:, ::9] = False  # trials with a fault count for nothing
    raw["force_of_trial"].values[~good] = 1e6
    mean, error, deviation = moments(raw, {"name": "force"}, good)
    reach = errors_to_the_ends(good.sum(axis=-1)) * error
    check_coverage((np.abs(mean - 3.0) <= reach)[:, None], allowance=allowance)
    if trials == 3:  # normal ends would be far too near
        assert np.mean(np.abs(mean - 3.0) <= 1.96 * error) < 0.85
    assert np.mean(deviation**2) == pytest.approx(4.0 if shape == "normal" else 2.25, rel=0.06)


@pytest.mark.parametrize("spread", [0.1, 0.4])
def test_the_ratio_of_rates_with_half_the_step(spread):
    """Two means of 16 runs each that spread as those of deep wells do, over each other: ± 2.1 errors, Student's."""
    random = np.random.Generator(np.random.Philox(33))
    whole, half = random.lognormal(-0.5 * spread**2, spread, (2, 4_000, 16))
    raw = {"rate_halved_of_trial": xarray.DataArray(half)}
    good = np.ones_like(half, dtype=bool)
    out: Any = xarray.Dataset()
    rate, error = mean_of_runs(whole, good)
    out["escape_rate"], out["escape_rate_error"] = ("point", rate), ("point", error)
    halved_rates(out, raw, good, ("point",), {})
    ratio, wrong = out["step_ratio"].values, out["step_ratio_error"].values
    check_coverage((np.abs(ratio - 1.0) <= 2.1 * wrong)[:, None], allowance=0.01)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.02)


def gaussian_work(random: np.random.Generator, shape: tuple[int, int], spread: float, change: float) -> np.ndarray:
    """Work [pN·µm] of that spread [k_BT], dissipated as Gaussian work is: ⟨W⟩ = ΔF + σ²/2."""
    return THERMAL * random.normal(change + 0.5 * spread**2, spread, shape)


@pytest.mark.thorough
def test_free_energy_by_jarzynski():
    """Bootstrap ends of 100 tracks of Gaussian work with σ = 1 k_BT; bias-corrected, they miss a little more often."""
    random = np.random.Generator(np.random.Philox(34))
    found = [jarzynski(w, temperature=298.15) for w in gaussian_work(random, (200, 100), 1.0, 2.0)]
    for name, truth, allowance in (("free_energy", 2.0, 0.03), ("cumulant", 2.0, 0.015), ("mean_work", 2.5, 0.01)):
        low, high = (np.array([float(f[f"{name}_{end}"]) for f in found]) for end in ("low", "high"))
        check_coverage(((low <= truth * THERMAL) & (truth * THERMAL <= high))[:, None], allowance=allowance)


@pytest.mark.thorough
def test_free_energy_by_crooks():
    """The acceptance ratio of 100 tracks there and 60 back, and the slope of the theorem, which is 1."""
    random = np.random.Generator(np.random.Philox(35))
    there, back = gaussian_work(random, (1_000, 100), 1.5, 2.0), gaussian_work(random, (1_000, 60), 1.5, -2.0)
    found = [crooks(a, b, temperature=298.15) for a, b in zip(there, back, strict=True)]
    for name, truth in (("free_energy", 2.0 * THERMAL), ("slope", 1.0)):
        low, high = (np.array([float(f[f"{name}_{end}"]) for f in found]) for end in ("low", "high"))
        check_coverage(((low <= truth) & (truth <= high))[:, None], allowance=0.01)
