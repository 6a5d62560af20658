"""Strategy A: two traps nearer than a rigid pair is long tilt it out of their plane.

With e = L/2·u − d/2·x̂ the energy of two equal harmonic traps is k_r c_⊥² + k_z c_z² + k_r e_⊥² + k_z e_z²: the centre c
separates from the axis u. So the Gibbs–Boltzmann distribution of the tilt is a quadrature, p(sin θ) ∝
exp(−B(cos²θ + η sin²θ)) I₀(2B (d/L) cos θ) with B = k_r L²/4k_B T, and at T = 0 cos θ = d/((1 − η)L): a pitchfork.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.special import i0e

from otwarp.laws import TrapLaw
from otwarp.scene import Medium, Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import COLD, ENERGY, VISCOSITY, harmonic, robot
from tests.validation.poses import matrices, pose

LENGTH, ETA, SHARPNESS = 8.0, 0.2, 100.0
STIFFNESS_R = SHARPNESS * 4.0 * ENERGY / LENGTH**2
"""B = 100: two wells 3 k_B T deep."""
SPACING = 0.64
"""d/L: the pair rests at cos θ = 0.8."""
OWN = 2.6
"""How far the radial force of a trap reaches [µm]: its own sphere stays within it, five thermal widths, and the other
one outside it."""
BOTH = 2.0 * LENGTH
"""How far the axial force reaches where it acts on both spheres, half as stiff from each trap."""
ALONE = 4.8
"""How far it reaches in runs without noise, where a trap acts on its own sphere alone."""

PAIR = (((-0.5 * LENGTH, 0.0, 0.0), 1.0), ((0.5 * LENGTH, 0.0, 0.0), 1.0))


def scene(temperature: float, *, axial_reach: float, accuracy: float = 0.01) -> Scene:
    """The pair in two traps; a sphere feels k_z = η·k_r along the beam, from one trap or from both."""
    shared = 0.5 if axial_reach == BOTH else 1.0
    law = TrapLaw(stiffness=STIFFNESS_R, power=20.0, cutoff=OWN if axial_reach == BOTH else axial_reach)
    axial = dataclasses.replace(law, stiffness=shared * ETA * STIFFNESS_R, cutoff=axial_reach)
    half = 0.5 * SPACING * LENGTH
    traps = tuple(
        dataclasses.replace(harmonic(f"T{i}", (x, 0.0, 0.0)), radial=law, axial=axial, holds=f"/World/Pair/S{i}")
        for i, x in enumerate((-half, half))
    )
    return Scene(
        medium=Medium(temperature=temperature, viscosity=VISCOSITY),
        bodies=(robot("Pair", shape=PAIR),),
        traps=traps,
        settings=Settings(accuracy=accuracy, frames_per_second=1e-3),
    )


def density(sine: np.ndarray) -> np.ndarray:
    """p(sin θ), not normalised; e^(−(…)) I₀ with the exponents taken together."""
    cosine = np.sqrt(1.0 - sine**2)
    argument = 2.0 * SHARPNESS * SPACING * cosine
    return np.exp(-SHARPNESS * (cosine**2 + ETA * sine**2) + argument) * i0e(argument)


def quantiles(shares: np.ndarray) -> np.ndarray:
    """sin θ below which the given shares of the distribution lie."""
    sine = np.linspace(-1.0, 1.0, 20_001)
    total = cumulative_simpson(density(sine), x=sine, initial=0.0)
    return np.interp(shares, total / total[-1], sine)


def start(worlds: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(W, 1, 3) and (W, 1, 4) draws of centre and tilt, for a run that begins near its steady state."""
    rng = np.random.default_rng(seed)
    width = np.sqrt(ENERGY / (2.0 * STIFFNESS_R * np.array([1.0, 1.0, ETA])))
    half = -0.5 * np.arcsin(quantiles(rng.uniform(size=worlds)))
    turn = np.stack([0 * half, np.sin(half), 0 * half, np.cos(half)], axis=-1)
    return rng.standard_normal((worlds, 1, 3)) * width, turn[:, None]


def sines(sim: Simulation) -> np.ndarray:
    """(W,) sin θ of the axis."""
    return matrices(pose(sim)[1])[:, 2, 0]


def check_distribution(expect_law, device: str, worlds: int, bins: int) -> None:
    sim = Simulation(scene(298.15, axial_reach=BOTH), worlds=worlds, seed=101, device=device)
    place, turn = start(worlds, 101)
    sim.set_state(position=place, orientation=turn)
    assert sim.model.scales.trap_relaxation is not None
    sim.run(6.0 * sim.model.scales.trap_relaxation / ETA)
    edges = quantiles(np.linspace(0.0, 1.0, bins + 1))
    edges[0], edges[-1] = -1.0, 1.0
    expect_law.chi_square(
        "sin θ against Gibbs–Boltzmann", np.histogram(sines(sim), edges)[0], np.full(bins, 1.0 / bins)
    )
    assert np.mean(sim.readout.escape_step.numpy() >= 0) < 1e-3


def test_quadrature_has_the_pitchfork():
    """The two maxima of the distribution in θ lie where the energy is least, up to k_B T."""
    sine = np.linspace(0.0, 1.0, 2001)
    most = sine[np.argmax(density(sine))]
    assert np.sqrt(1.0 - most**2) == pytest.approx(SPACING / (1.0 - ETA), abs=0.02)
    assert density(np.zeros(1))[0] < 0.1 * density(np.array([most]))[0]


def test_tilt_distribution(expect_law, device):
    """p(sin θ) ∝ exp(−B(cos²θ + η sin²θ)) I₀(2Bd cos θ/L), whatever the mobility.

    Source: Gibbs–Boltzmann statistics by quadrature; the pitchfork of the energy is derived in the docstring above.
    """
    check_distribution(expect_law, device, 4000, 20)


@pytest.mark.validate
def test_tilt_distribution_precisely(expect_law, device):
    """p(sin θ) ∝ exp(−B(cos²θ + η sin²θ)) I₀(2Bd cos θ/L), whatever the mobility.

    Source: Gibbs–Boltzmann statistics by quadrature; the pitchfork of the energy is derived in the docstring above.
    """
    check_distribution(expect_law, device, 40_000, 40)


STILL = 1e-4
"""cos θ at rest: what is left after the run, and float32."""


def rest(scene: Scene, device: str, tilt: float, time: float, **parameters) -> np.ndarray:
    """(W,) sin θ after `time` relaxation times of a run without noise, from a small tilt."""
    worlds = max(len(v) for v in parameters.values())
    sim = Simulation(scene, worlds=worlds, seed=102, device=device, parameters=parameters)
    turn = np.array([0.0, -np.sin(0.5 * tilt), 0.0, np.cos(0.5 * tilt)])
    sim.set_state(orientation=turn[None])
    assert sim.model.scales.trap_relaxation is not None
    sim.run(time * sim.model.scales.trap_relaxation)
    return sines(sim)


def test_pitchfork(expect_law, device):
    """cos θ = d/((1 − η)L) for d < (1 − η)L, 1 above; either sign.

    Source: minimum of U(θ) = k_r(d − L cos θ)²/4 + k_z L² sin²θ/4.
    """
    fork = 1.0 - ETA
    # the relaxation about the fork slows down as 1/|d/d_c − 1|
    spacing = np.array([0.75, 0.8, 0.85, 0.9, 0.95, 1.1, 1.2]) * fork
    place = np.zeros((len(spacing), 2, 3))
    place[:, 0, 0], place[:, 1, 0] = -0.5 * LENGTH * spacing, 0.5 * LENGTH * spacing
    for sign in (1.0, -1.0):
        sine = rest(scene(COLD, axial_reach=ALONE, accuracy=0.05), device, sign * 0.25, 300.0, trap_position=place)
        tilted = spacing < fork
        expect_law(
            f"cos θ at rest, start at {sign * 0.25:+g} rad",
            np.sqrt(1.0 - sine[tilted] ** 2),
            spacing[tilted] / fork,
            STILL,
        )
        assert np.all(np.sign(sine[tilted]) == sign)
        expect_law(f"sin θ beyond the fork, start at {sign * 0.25:+g} rad", sine[~tilted], 0.0, STILL)


def test_a_pair_does_not_feel_the_power_ratio(expect_law, device):
    """In harmonic traps of unequal power the same pitchfork: k₁k₂/(k₁ + k₂) scales the whole energy.

    Source: minimum of U over the centre; compare strategy B of five elements.
    """
    ratio = np.array([1.0, 1.25, 1.5])
    power = np.stack([40.0 * ratio / (1.0 + ratio), 40.0 / (1.0 + ratio)], axis=1)
    sine = rest(scene(COLD, axial_reach=ALONE, accuracy=0.05), device, 0.25, 300.0, trap_power=power)
    expect_law("cos θ at power ratios 1, 1.25, 1.5", np.sqrt(1.0 - sine**2), SPACING / (1.0 - ETA), STILL)
