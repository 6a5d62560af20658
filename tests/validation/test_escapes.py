"""Rare escapes by forward-flux sampling: mean time out of a well that ends, 5 to 30 k_B T deep, from one run.

The double integral for a radially symmetric well (Gardiner 2009, Stochastic Methods, §5.5) is exact at any depth. A
trap that is dragged and one whose force is tabulated stand beside the Fokker–Planck equation, solved on two grids. All
runs of a depth share their interfaces, which a pilot places; given those they are independent, and the mean of their
rates has no bias, so that its standard error is theirs over √runs. Of 16 runs that error is itself known to 18 % alone:
each depth has 32, of many paths.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.bench.integrators.fokker_planck import mean_exit_time
from otwarp.bench.integrators.wells import SplinedForce, Well
from otwarp.optics import Beam, Particle
from otwarp.studies.rare.study import EscapeStudy
from otwarp.units import BOLTZMANN
from tests.reference.fokker_planck import mean_first_passage
from tests.studies.scenes import bead_in_a_well

SCENES = Path(__file__).parents[2] / "scenes"
STIFFNESS, RIM, DRAG = 0.5, 0.4, 6.0 * np.pi * 0.00089 * 0.5
"""Of the well at 1 mW [pN/µm], where it ends [µm], and the bead's [pN·s/µm]."""

ENERGY = BOLTZMANN * 298.15
MOST, SURE = 0.03, 0.01
"""What a rate may be off, and its standard error: relative, at every depth."""

RUNS = 32


def power_of(depth: float) -> float:
    """Power [mW] of a well of so many k_B T."""
    return 2.0 * depth * ENERGY / RIM**2 / STIFFNESS


def rates_of(scene: Path, power: float, device: str, **how) -> np.ndarray:
    """(RUNS) rates of escape [1/s] at a power [mW]."""
    axes = {"trap_power": ot.values([power], unit="mW")}
    study = EscapeStudy(scene, axes=axes, runs=RUNS, halved=False, seed=11, **how)
    return study.compute([0], device=device)[0]["rate_of_trial"].ravel()


def rates_over_exact(folder, depth: float, device: str, *, branches: int, step: float, **how) -> np.ndarray:
    """(RUNS) rates of escape times the exact mean time; `step` is in times in which the well relaxes."""
    k = STIFFNESS * power_of(depth)
    exact = mean_first_passage(lambda r: 0.5 * k * r**2, RIM, diffusion=ENERGY / DRAG, energy=ENERGY)
    how = {"branches": branches, "time_step": step * DRAG / k, **how}
    return exact * rates_of(bead_in_a_well(folder), power_of(depth), device, **how)


def expect(expect_law, what: str, found: np.ndarray, *, bias: float) -> None:
    """The mean of the runs is 1 by the law, and within `MOST`; its standard error is `SURE` at most."""
    error = found.std(ddof=1) / np.sqrt(RUNS)
    expect_law(f"rate of escapes {what}, over the law", found.mean(), 1.0, error, bias=bias)
    assert error <= SURE and abs(found.mean() - 1.0) <= MOST


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
    expect(expect_law, f"from {depth:g} k_B T at steps of {step:g} γ/k", found, bias=step)


@pytest.mark.validate
@pytest.mark.parametrize(
    ("depth", "branches", "step", "interfaces", "basin"),
    [
        (5.0, 2_000, 0.01, [0.3], 0.25),
        (5.0, 10_000, 0.01, [0.2, 0.39], 0.2),
        (12.0, 15_000, 0.01, [0.16, 0.24, 0.3, 0.37, 0.399], None),
        (20.0, 40_000, 0.02, [0.15, 0.2, 0.24, 0.28, 0.31, 0.34, 0.36, 0.38, 0.395], None),
        (30.0, 80_000, 0.02, [0.1, 0.14, 0.18, 0.21, 0.24, 0.265, 0.29, 0.31, 0.33, 0.35, 0.37, 0.39], None),
    ],
)
def test_interfaces_of_ones_own(expect_law, tmp_path, device, depth, branches, step, interfaces, basin):
    """Rate of escapes × exact mean time = 1 within 3 %, whichever interfaces [µm] are asked for.

    One alone, two far apart, the last a hair's breadth from the rim at 0.4 µm, many.

    Source: as above.
    """
    how = {"interfaces": interfaces, "basin": basin}
    found = rates_over_exact(tmp_path, depth, device, branches=branches, step=step, **how)
    what = f"from {depth:g} k_B T by {len(interfaces)} interfaces from {interfaces[0]:g} to {interfaces[-1]:g} µm"
    expect(expect_law, what, found, bias=step)


@pytest.mark.validate
@pytest.mark.parametrize(
    ("depth", "speed", "branches", "step"),
    [(8.0, 2.5, 2_500, 0.01), (14.0, 5.0, 8_000, 0.01), (25.0, 8.0, 30_000, 0.02)],
)
def test_a_dragged_trap(expect_law, tmp_path, device, depth, speed, branches, step):
    """Rate of escapes × mean exit time = 1 within 3 %, of the equation in the trap's frame, F = −k r − γ v ẑ.

    A mean exit time counts from the centre of the trap: what it takes to lag behind is another 1 % of it.

    Source: Gardiner 2009, Stochastic Methods, §5.5; Scharfetter & Gummel 1969, doi:10.1109/T-ED.1969.16566.
    """
    k, pull = STIFFNESS * power_of(depth), np.array([0.0, 0.0, DRAG * speed])
    exact = mean_exit_time(lambda r: -k * r - pull, RIM, diffusion=ENERGY / DRAG, energy=ENERGY)
    scene = bead_in_a_well(tmp_path, speed=speed)
    rates = rates_of(scene, power_of(depth), device, branches=branches, time_step=step * DRAG / k)
    what = f"from {depth:g} k_B T dragged at {speed:g} µm/s"
    still = mean_exit_time(lambda r: -k * r, RIM, diffusion=ENERGY / DRAG, energy=ENERGY)
    assert exact.value < 0.9 * still.value, "the drag must matter"
    bias = step + 0.01 + exact.error / exact.value
    expect(expect_law, what, exact.value * rates, bias=bias)


@pytest.mark.validate
@pytest.mark.parametrize(("depth", "branches"), [(5.0, 600), (10.0, 8_000), (20.0, 26_000), (30.0, 70_000)])
def test_a_tabulated_trap(expect_law, device, depth, branches):
    """Rate of escapes × mean exit time = 1 within 3 %, of exact forces, which are not conservative.

    The table leaves 1e-3 of the peak force, so less than that much of the depth.

    Source: as above.
    """
    if depth > 20.0 and device == "cpu":
        pytest.skip("half an hour of a core: --device cuda:0")
    beam, sphere = Beam(numerical_aperture=1.2, polarization="circular"), Particle(radius=0.5, index=1.59)
    well = Well.of_depth(beam, sphere, depth)
    scene = ot.Scene.load(SCENES / "table_trap.usda")
    reach = float(ot.Simulation(scene, device="cpu").model.held_range[0, 0])
    exact = well.escape(well.about_centre(SplinedForce(well.bead.beam, well.bead.sphere, reach + 0.5, "cpu")), reach)
    rates = rates_of(
        SCENES / "table_trap.usda", well.power, device, branches=branches, time_step=0.05 * well.relaxation
    )
    bias = 0.01 + 0.5e-3 * depth + exact.error / exact.value
    what = f"from {depth:g} k_B T of a tabulated trap at steps of 0.05 γ/k"
    expect(expect_law, what, exact.value * rates, bias=bias)
