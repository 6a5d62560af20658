"""Second moments against numerical integrals of spectra, and against published closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.analysis import Detector, harmonic_tracks
from otwarp.analysis.process import blur
from tests.analysis.truth import DRAG, RELAXATION, TEMPERATURE, THERMAL, process


def integrated(p, lag: float) -> float:
    """R(lag) as the transform of the spectrum, to 1e-4 of the variance: ∫ D/(π²(f_c² + f²))·sinc²·|H|²·cos/2 df."""
    d, corner = p.detector, p.rate / (2.0 * np.pi)
    f = np.concatenate(
        [np.linspace(0.0, 200.0 * corner, 400_001), np.geomspace(200.0 * corner, 1e5 * corner, 400_000)[1:]]
    )
    power = p.diffusion / (np.pi**2 * (corner**2 + f**2)) * np.sinc(f * d.exposure) ** 2
    if np.isfinite(d.cutoff):
        if d.order == 1:
            power *= d.passed**2 + (1.0 - d.passed**2) / (1.0 + (f / d.cutoff) ** 2)
        else:
            power /= 1.0 + (f / d.cutoff) ** (2 * d.order)
    y = power * np.cos(2.0 * np.pi * f * lag)
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(f)))


@pytest.mark.parametrize(
    "detector",
    [
        {"exposure": 0.02},
        {"exposure": 0.001},
        {"cutoff": 30.0},
        {"cutoff": 30.0, "order": 4},
        {"cutoff": 20.0, "passed": 0.4},
        {"cutoff": 1.0 / (2.0 * np.pi * RELAXATION)},
        {"cutoff": 40.0, "order": 2, "exposure": 0.015},
    ],
)
def test_autocovariance_is_the_transform_of_the_spectrum(detector):
    """The integral's tail beyond 1e5 corner frequencies is 6e-6 of the variance, the error of its grid less."""
    p = process(0.02, **detector)
    r = p.autocovariance(4)
    for lag in range(4):
        assert abs(r[lag] - integrated(p, 0.02 * lag)) < 1e-4 * r[0]


def test_aliased_lorentzian():
    """Berg-Sørensen and Flyvbjerg (2004), eq. 20, one-sided; what is left is leakage, of order 1/n."""
    p, n = process(0.01), 4096
    c = np.exp(-p.rate * p.interval)
    f = np.fft.rfftfreq(n, p.interval)
    exact = 2.0 * p.interval * THERMAL * (1.0 - c**2) / (1.0 + c**2 - 2.0 * c * np.cos(2.0 * np.pi * f * p.interval))
    assert np.allclose(p.periodogram(n), exact, rtol=4.0 / n / (1.0 - c))


def test_noise_is_flat():
    p = process(0.01, noise=0.02)
    clean = process(0.01)
    assert np.allclose(p.periodogram(64) - clean.periodogram(64), 2.0 * 0.01 * 0.02**2)


def test_whitened_is_the_spectrum_of_the_difference():
    """x(t + Δ) − φ·x(t) of a long track has |1 − φ·e^(−iω)|² times the spectrum."""
    p, n = process(0.002, exposure=0.001), 2**16
    phi, omega = 0.9, 2.0 * np.pi * np.fft.rfftfreq(n)
    transfer = np.abs(1.0 - phi * np.exp(-1j * omega)) ** 2
    ratio = p.periodogram(n, whitened=phi) / (p.periodogram(n) * transfer)
    assert np.allclose(ratio[1:-1], 1.0, atol=0.02)


def test_blur_of_wong_and_halvorsen():
    """At once, for a long exposure (2/ratio), and at one relaxation time, 2/e (doi:10.1364/OE.14.012517)."""
    assert blur(1e-9) == pytest.approx(1.0) and blur(1e4) == pytest.approx(2e-4, rel=1e-3)
    assert blur(1.0) == pytest.approx(2.0 / np.e, rel=1e-12)
    assert blur(1.01e-4) == pytest.approx(1.0 - 1.01e-4 / 3.0, rel=1e-7)


def test_exact_tracks_have_the_moments_of_the_process():
    """4 σ_mean of 400 tracks for variance and covariance at a lag; and coupled axes obey K·C + C·Kᵀ = 2·k_BT."""
    k = np.array([[1.0, 0.3, 0.0], [-0.2, 0.6, 0.1], [0.0, 0.0, 0.4]])
    x = harmonic_tracks(k, DRAG, 0.01, 400, tracks=400, temperature=TEMPERATURE, seed=1).values
    c = np.einsum("wti,wtj->wij", x, x) / x.shape[1]
    balance = np.einsum("ij,wjk->wik", k, c) + np.einsum("wij,kj->wik", c, k)
    error = balance.std(axis=0) / np.sqrt(len(x))
    assert np.all(np.abs(balance.mean(axis=0) - 2.0 * THERMAL * np.eye(3)) < 5.0 * error)
    one = harmonic_tracks([1.0], DRAG, 0.01, 400, tracks=400, temperature=TEMPERATURE, seed=2).values[..., 0]
    for lag in (0, 2):
        products = np.mean(one[:, lag:] * one[:, : 400 - lag], axis=1)
        expected = process(0.01).autocovariance(3)[lag]
        assert abs(products.mean() - expected) < 5.0 * products.std() / np.sqrt(400)


def test_a_detector_records_what_the_process_says():
    """Exposure, filter, noise and rate of a synthetic detector against the moments that fits expect, at 5 σ.

    The track is sampled 80 times in a relaxation time: averages of straight lines lack 0.1 % of the variance.
    """
    fine = harmonic_tracks([1.0], DRAG, RELAXATION / 80, 40_000, tracks=40, temperature=TEMPERATURE, seed=4)
    rate = 1.0 / (16 * RELAXATION / 80)
    for detector in (
        Detector(rate=rate, exposure=RELAXATION / 5, noise=0.03),
        Detector(rate=rate, cutoff=40.0, order=2),
        Detector(rate=rate, cutoff=30.0, passed=0.3),
    ):
        seen = detector.see(fine, seed=5).values[..., 0]
        p = process(1.0 / rate, exposure=detector.exposure, noise=detector.noise, cutoff=detector.cutoff,
                    order=detector.order, passed=detector.passed)  # fmt: skip
        r = p.autocovariance(3)
        for lag in range(3):
            products = np.mean(seen[:, lag:] * seen[:, : seen.shape[1] - lag], axis=1)
            error = products.std() / np.sqrt(len(products))
            assert abs(products.mean() - r[lag]) < 5.0 * error + 2e-3 * r[0]


def test_drift_is_a_straight_line():
    fine = harmonic_tracks([1.0], DRAG, 1e-3, 1000, seed=4)
    moved = Detector(drift=0.5).see(fine) - fine
    assert np.allclose(moved.values[0, :, 0], 0.5 * fine["time"].values)
