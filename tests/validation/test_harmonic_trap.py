"""A bead in a harmonic trap, stiffer across the beam than along it: an Ornstein–Uhlenbeck process in every respect.

Expected values are those of the integrator's own chain (`scheme`), which differ from the law of continuous time by less
than the wanted accuracy; a test of its own holds that difference against the accuracy.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize_scalar

from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import ENERGY, STIFFNESS, drag, harmonic, sphere_body
from tests.validation import scheme
from tests.validation.laws import Law, across_worlds, lagged

SOFT = 0.5
"""Axial over radial stiffness."""
STIFF = np.array([STIFFNESS, STIFFNESS, SOFT * STIFFNESS])
RATE = STIFF / drag(1.0)
integrators = pytest.mark.parametrize("integrator", scheme.OFFERED)


def scene(integrator: str, h: float) -> Scene:
    """A bead in a trap, stepped with h = κ·dt across the beam."""
    trap = harmonic("Trap")
    assert trap.radial is not None
    trap = dataclasses.replace(trap, axial=dataclasses.replace(trap.radial, stiffness=SOFT * STIFFNESS))
    return Scene(
        bodies=(sphere_body("Bead"),),
        traps=(trap,),
        settings=Settings(time_step=h / RATE[0], integrator=integrator),
    )


def settled(integrator: str, h: float, worlds: int, device: str, seed: int) -> Simulation:
    """A run that has forgotten its start to e⁻¹⁰: it begins with a draw from the Gibbs distribution."""
    sim = Simulation(scene(integrator, h), worlds=worlds, seed=seed, device=device, allow_large_step=True)
    draw = np.random.default_rng(seed).standard_normal((worlds, 1, 3)) * np.sqrt(ENERGY / STIFF)
    sim.set_state(position=draw)
    sim.step(int(10.0 / (h * SOFT)))
    return sim


def record(sim: Simulation, samples: int, every: int) -> np.ndarray:
    """(samples, W, 3) positions over their thermal widths."""
    out = np.empty((samples, sim.model.worlds, 3), dtype=np.float32)
    for i in range(samples):
        sim.step(every)
        out[i] = sim.state.position.numpy()[:, 0]
    return out / np.sqrt(ENERGY / STIFF)


def test_every_integrator_has_a_chain():
    assert set(scheme.OFFERED) <= set(scheme.CHAINS)
    assert scheme.DEFAULT in scheme.OFFERED


@pytest.mark.parametrize("integrator", scheme.CHAINS)
def test_the_chains_converge_to_the_law(integrator):
    """Variance and covariance of all chains tend to k_B T/k and e^(−κt), Euler–Maruyama's with the first order."""
    for h in (0.02, 0.01):
        assert scheme.variance(integrator, h) == pytest.approx(1.0, abs=0.51 * h)
        lag = round(1.0 / h)
        assert scheme.covariance(integrator, h, lag) == pytest.approx(np.exp(-1.0), abs=0.5 * h)


def check_moments(expect_law: Law, integrator: str, device: str, worlds: int, samples: int) -> None:
    h, every = 0.1, 3
    sim = settled(integrator, h, worlds, device, seed=61)
    x = record(sim, samples, every)
    rates = h * np.array([1.0, 1.0, SOFT])
    lags = (0, 1, 3, 8)
    for lag in lags:
        got, error = across_worlds(lagged(x, x, lag))
        expected = np.diag([float(scheme.covariance(integrator, r, lag * every)) for r in rates])
        name = f"{integrator}, h = {h}: ⟨x_i(0) x_j(t)⟩·√(k_i k_j)/k_B T at κt = {lag * every * h:.1f}"
        expect_law.tensor(name, got, expected, error)


@integrators
def test_moments(expect_law, device, integrator):
    """⟨x_i(0) x_j(t)⟩ = (k_B T/k_i) e^(−k_i t/γ) δ_ij, as the integrator's chain has it.

    Source: Uhlenbeck & Ornstein 1930, doi:10.1103/PhysRev.36.823.
    """
    check_moments(expect_law, integrator, device, 2000, 50)


@pytest.mark.validate
@integrators
def test_moments_precisely(expect_law, device, integrator):
    """⟨x_i(0) x_j(t)⟩ = (k_B T/k_i) e^(−k_i t/γ) δ_ij, as the integrator's chain has it.

    Source: Uhlenbeck & Ornstein 1930, doi:10.1103/PhysRev.36.823.
    """
    check_moments(expect_law, integrator, device, 20_000, 300)


def test_default_step_keeps_the_wanted_accuracy(expect_law, device):
    """With the chosen step ⟨x²⟩ differs from k_B T/k by no more than the scene's `accuracy` (1 %).

    Source: Uhlenbeck & Ornstein 1930, doi:10.1103/PhysRev.36.823.
    """
    plain = scene(scheme.DEFAULT, 0.1)
    plain = dataclasses.replace(plain, settings=Settings(accuracy=0.01))
    worlds = 20_000
    sim = Simulation(plain, worlds=worlds, seed=62, device=device)
    sim.set_state(position=np.random.default_rng(62).standard_normal((worlds, 1, 3)) * np.sqrt(ENERGY / STIFF))
    sim.run(4.0 / (RATE[0] * SOFT))
    x = record(sim, 8, int(0.5 / (RATE[0] * sim.time_step)))
    got, error = across_worlds((x[..., :2] ** 2).mean(axis=(0, 2)))
    # the predicted error is (accuracy) to first order and 1.01 times that exactly
    expect_law("⟨x²⟩·k/k_B T at the chosen step", got, 1.0, error, bias=1.02e-2)


def expected_periodogram(covariance: np.ndarray, frequencies: np.ndarray, interval: float) -> np.ndarray:
    """Two-sided ⟨|Σ x_n e^(−iωn)|²⟩·Δt/N of N samples with the given covariances, leakage included."""
    n = len(covariance)
    weight = (1.0 - np.arange(n) / n) * covariance
    full = np.real(np.fft.fft(weight))
    return (2.0 * full - weight[0])[frequencies] * interval


def aliased_lorentzian(rate: float, interval: float, samples: int, k: np.ndarray) -> np.ndarray:
    """Two-sided power of a sampled Ornstein–Uhlenbeck process of unit variance at ω = 2πk/(NΔt), N → ∞ [s].

    P = (1 − c²)Δt/(1 + c² − 2c cos(2πk/N)), c = exp(−κΔt).
    """
    c = np.exp(-rate * interval)
    return (1.0 - c * c) * interval / (1.0 + c * c - 2.0 * c * np.cos(2.0 * np.pi * k / samples))


def check_spectrum(expect_law: Law, device: str, worlds: int) -> None:
    h, every, samples = 0.02, 10, 512
    sim = settled(scheme.DEFAULT, h, worlds, device, seed=63)
    x = record(sim, samples, every)[..., :2].astype(float).reshape(samples, 2 * worlds)
    interval = every * sim.time_step
    k = np.arange(1, samples // 2)
    power = (np.abs(np.fft.rfft(x, axis=0)[k]) ** 2).mean(axis=1) * interval / samples
    lags = np.arange(samples)
    chain = expected_periodogram(scheme.covariance(scheme.DEFAULT, h, lags * every), k, interval)
    error = 1.0 / np.sqrt(2 * worlds)
    expect_law("power spectrum over that of the sampled process, 255 frequencies", power / chain, 1.0, error)
    # the corner frequency by least squares on the relative power, leakage of the finite record taken from the model
    leakage = expected_periodogram(np.exp(-RATE[0] * lags * interval), k, interval) / aliased_lorentzian(
        RATE[0], interval, samples, k
    )

    def misfit(corner: float) -> float:
        model = aliased_lorentzian(2.0 * np.pi * corner, interval, samples, k) * leakage
        scale = (power / model).mean()
        return float(((power / model / scale - 1.0) ** 2).sum())

    corner = RATE[0] / (2.0 * np.pi)
    fit = minimize_scalar(misfit, bracket=(0.95 * corner, 1.05 * corner), tol=1e-10).x
    # sensitivity of log P to log f_c, with the free amplitude projected out, gives the error of the fit
    up, down = (np.log(aliased_lorentzian(RATE[0] * f, interval, samples, k)) for f in (1.001, 0.999))
    slope = (up - down) / 0.002
    deviation = error / np.sqrt(((slope - slope.mean()) ** 2).sum())
    # a chain that decays by a per step instead of e⁻ʰ has its corner elsewhere, by h/2 at most
    a = scheme.CHAINS[scheme.DEFAULT](h)[0]
    expect_law(
        "corner frequency k/(2πγ) from the aliased Lorentzian, over the law", fit / corner, -np.log(a) / h, deviation
    )


def test_power_spectrum(expect_law, device):
    """Lorentzian with the corner k/(2πγ), aliased by sampling.

    Source: Berg-Sørensen & Flyvbjerg 2004, doi:10.1063/1.1645654.
    """
    check_spectrum(expect_law, device, 500)


@pytest.mark.validate
def test_power_spectrum_precisely(expect_law, device):
    """Lorentzian with the corner k/(2πγ), aliased by sampling.

    Source: Berg-Sørensen & Flyvbjerg 2004, doi:10.1063/1.1645654.
    """
    check_spectrum(expect_law, device, 5000)


def check_histogram(expect_law: Law, device: str, worlds: int, samples: int) -> None:
    h = 0.1
    sim = settled(scheme.DEFAULT, h, worlds, device, seed=64)
    x = record(sim, samples, int(6.0 / (h * SOFT)))  # e⁻⁶ from sample to sample
    rates = h * np.array([1.0, 1.0, SOFT])
    x = x / np.sqrt([scheme.variance(scheme.DEFAULT, r) for r in rates])
    bins = 50
    edges = stats.norm.ppf(np.linspace(0.0, 1.0, bins + 1))
    for i, name in enumerate("xyz"):
        counts = np.histogram(x[..., i], edges)[0]
        expect_law.chi_square(f"{name} against the Gaussian", counts, np.full(bins, 1.0 / bins))
    energy = 0.5 * (x**2).sum(axis=-1)
    edges = stats.gamma(1.5).ppf(np.linspace(0.0, 1.0, bins + 1))
    expect_law.chi_square("U/k_B T against Boltzmann", np.histogram(energy, edges)[0], np.full(bins, 1.0 / bins))


def test_boltzmann_histogram(expect_law, device):
    """p(x) ∝ e^(−U/k_B T): each coordinate, and U/k_B T ~ Γ(3/2).

    Source: Risken 1996, The Fokker–Planck Equation, doi:10.1007/978-3-642-61544-3.
    """
    check_histogram(expect_law, device, 10_000, 3)


@pytest.mark.validate
def test_boltzmann_histogram_precisely(expect_law, device):
    """p(x) ∝ e^(−U/k_B T): each coordinate, and U/k_B T ~ Γ(3/2).

    Source: Risken 1996, The Fokker–Planck Equation, doi:10.1007/978-3-642-61544-3.
    """
    check_histogram(expect_law, device, 40_000, 20)
