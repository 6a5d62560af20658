"""Rare escapes by forward-flux sampling: mean time out of a harmonic well that ends, 5 to 30 k_B T deep, from one run.

The double integral for a radially symmetric well (Gardiner 2009, Stochastic Methods, §5.5) is exact at any depth. All
runs of a depth share their interfaces, which a pilot places; given those they are independent, and the mean of their
rates has no bias, so that its standard error is theirs over √runs. Of 16 runs that error is itself known to 18 % alone:
each depth has 32, of many paths.
"""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from otwarp.studies.rare.study import EscapeStudy
from otwarp.units import BOLTZMANN
from tests.reference.fokker_planck import mean_first_passage
from tests.studies.scenes import bead_in_a_well

STIFFNESS, RIM, DRAG = 0.5, 0.4, 6.0 * np.pi * 0.00089 * 0.5
"""Of the well at 1 mW [pN/µm], where it ends [µm], and the bead's [pN·s/µm]."""

ENERGY = BOLTZMANN * 298.15
MOST, SURE = 0.03, 0.01
"""What a rate may be off, and its standard error: relative, at every depth."""

RUNS = 32


def power_of(depth: float) -> float:
    """Power [mW] of a well of so many k_B T."""
    return 2.0 * depth * ENERGY / RIM**2 / STIFFNESS


def rates_over_exact(folder, depth: float, device: str, *, branches: int, step: float) -> np.ndarray:
    """(RUNS) rates of escape times the exact mean time; `step` is in times in which the well relaxes."""
    k = STIFFNESS * power_of(depth)
    study = EscapeStudy(
        bead_in_a_well(folder),
        axes={"trap_power": ot.values([power_of(depth)], unit="mW")},
        runs=RUNS,
        branches=branches,
        time_step=step * DRAG / k,
        halved=False,
        seed=11,
    )
    exact = mean_first_passage(lambda r: 0.5 * k * r**2, RIM, diffusion=ENERGY / DRAG, energy=ENERGY)
    return exact * study.compute([0], device=device)[0]["rate_of_trial"].ravel()


def test_rate_of_escapes(expect_law, tmp_path, device):
    """Rate of escapes × exact mean time = 1.

    Source: Gardiner 2009, Stochastic Methods, §5.5; Allen, Valeriani & ten Wolde 2009,
    doi:10.1088/0953-8984/21/46/463102.
    """
    found = rates_over_exact(tmp_path, 6.0, device, branches=100, step=0.03)
    error = found.std(ddof=1) / np.sqrt(RUNS)
    expect_law("rate of escapes from 6 k_B T, over the law", found.mean(), 1.0, error, bias=0.02)


@pytest.mark.validate
@pytest.mark.parametrize(
    ("depth", "branches", "step"),
    [
        (5.0, 2_500, 0.01),
        (10.0, 7_000, 0.01),
        (15.0, 10_000, 0.01),
        (20.0, 18_000, 0.01),
        (25.0, 36_000, 0.02),
        (30.0, 80_000, 0.02),
    ],
)
def test_rate_of_escapes_precisely(expect_law, tmp_path, device, depth, branches, step):
    """Rate of escapes × exact mean time = 1, within 3 % and with a standard error of 1 % at most.

    Source: Gardiner 2009, Stochastic Methods, §5.5; Allen, Valeriani & ten Wolde 2009,
    doi:10.1088/0953-8984/21/46/463102.
    """
    found = rates_over_exact(tmp_path, depth, device, branches=branches, step=step)
    error = found.std(ddof=1) / np.sqrt(RUNS)
    what = f"rate of escapes from {depth:g} k_B T at steps of {step:g} γ/k, over the law"
    expect_law(what, found.mean(), 1.0, error, bias=step)
    assert error <= SURE and abs(found.mean() - 1.0) <= MOST
