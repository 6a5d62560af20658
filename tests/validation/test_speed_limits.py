"""How fast a trap may move before it loses its bead: by the largest force without noise, and less than that with it.

In the frame of a trap that moves along its beam at v the bead feels −k r − γ v ẑ: without noise it is held up to
k·rim/γ, and with noise as long as the backward Fokker–Planck equation in that frame says.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import otwarp as ot
from otwarp.bench.integrators.fokker_planck import survival_probability
from otwarp.hydrodynamics.bispherical import wall_resistance
from otwarp.studies.observables import trapped
from otwarp.studies.stopping.search import largest
from otwarp.studies.study import Study
from otwarp.units import BOLTZMANN
from tests.studies.scenes import bead_in_a_well

STIFFNESS, RIM, DRAG, ENERGY = 0.5, 0.4, 6.0 * np.pi * 0.00089 * 0.5, BOLTZMANN * 298.15
"""Of the well at 1 mW [pN/µm], where it ends [µm], of the bead [pN·s/µm], and k_B T [pN·µm]."""


def largest_speed(
    folder: Path, device: str, power: float, speeds: np.ndarray, *, until: float, count: int, probability: float
) -> tuple[float, float, float]:
    """The largest speed at which a bead is held so long with that probability, and the ends of its interval [µm/s]."""
    study = Study(
        folder / "well.usda",
        axes={"trap_power": ot.values([power], unit="mW"), "speed:/World/trap": ot.values(speeds, unit="µm/s")},
        observables=[trapped(until=until)],
        stop=largest(probability, along="speed:/World/trap", trials=count),
        seed=5,
    )
    found = study.run(folder / "out", devices=[device]).squeeze()
    speed, low, high = (float(found[f"largest{end}"]) for end in ("", "_low", "_high"))
    return speed, low, high


def held(power: float, speed: float, until: float) -> float:
    """Probability that a trap keeps its bead so long at that speed."""
    pull = np.array([0.0, 0.0, DRAG * speed])
    (found,) = survival_probability(
        lambda r: -STIFFNESS * power * r - pull, RIM, np.array([1e-3]), until,
        diffusion=ENERGY / DRAG, energy=ENERGY, shells=64, sectors=40,
    )  # fmt: skip
    return found.value


@pytest.mark.validate
@pytest.mark.parametrize("height", [None, 1.0, 0.6])
def test_largest_speed_without_noise(expect_law, tmp_path, device, height):
    """v = k·rim/γ, γ that of a sphere beside a plane where there is one: between neighbours 2 % apart.

    Source: Stokes 1851; Goldman, Cox & Brenner 1967, doi:10.1016/0009-2509(67)80047-2.
    """
    hindered = 1.0 if height is None else wall_resistance(height / 0.5 - 1.0).sliding
    limit = STIFFNESS * RIM / DRAG / hindered
    bead_in_a_well(tmp_path, speed=30.0, brownian=False, floor=height)
    speeds = limit * np.linspace(0.9, 1.1, 11)
    speed, _, _ = largest_speed(tmp_path, device, 1.0, speeds, until=0.5, count=1, probability=0.5)
    where = "in the open" if height is None else f"{height:g} µm above a plane"
    expect_law(f"largest speed {where}, over k·rim/γ", speed / limit, 1.0, 0.02 / np.sqrt(12.0))


@pytest.mark.validate
@pytest.mark.parametrize("power", [2.5, 5.0, 10.0])
def test_largest_speed_with_noise(expect_law, tmp_path, device, power):
    """P(held for 0.1 s) = 95 % by ∂P/∂t = ((F − γ v ẑ)/γ)·∇P + D∇²P: less than k·rim/γ, the less the weaker the trap.

    Source: Gardiner 2009, Stochastic Methods, §5.5.
    """
    until, limit = 0.1, STIFFNESS * power * RIM / DRAG
    bead_in_a_well(tmp_path, speed=400.0, accuracy=0.005)
    speeds = limit * np.linspace(0.3, 1.0, 141)
    speed, low, high = largest_speed(tmp_path, device, power, speeds, until=until, count=8_192, probability=0.95)
    exact = brentq(lambda v: held(power, v, until) - 0.95, 0.3 * limit, limit, xtol=1e-3 * limit)
    error = (high - low) / (2.0 * 1.96) / limit
    what = f"speed at which 95 % are held at {power:g} mW, over k·rim/γ"
    expect_law(what, speed / limit, exact / limit, error, bias=0.005)
    assert exact < 0.95 * limit, "noise must matter"
