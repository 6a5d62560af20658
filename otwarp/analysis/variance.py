"""Stiffness from the variance of a track: k = k_BT/⟨x²⟩."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from otwarp.analysis.correlation import MEMORY, variance_of_mean
from otwarp.analysis.detector import Detector
from otwarp.analysis.estimates import Row, check_level, check_temperature, each_axis, estimates
from otwarp.analysis.process import Process
from otwarp.analysis.spectrum import fitted_process
from otwarp.analysis.tracks import Tracks, tracks_of
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN


def equipartition(x: Any, *, temperature: float, detector: Detector | None = None, level: float = 0.95) -> Any:
    """Stiffness along each axis from the variance about the mean, corrected for the detector.

    The interval is that of χ² with as many degrees of freedom as the correlated samples are worth, 2·⟨s²⟩²/var(s²) of
    the process that fits the spectrum. The variance is corrected for the mean having been taken from the same track,
    for noise, and for the exposure and filter, which let less of it through (for the exposure: Wong and Halvorsen 2006,
    doi:10.1364/OE.14.012517); how uncertain that share is, is counted.

    Args:
        x: Track with the dimension `time` [µm].
        temperature: [K].
        detector: What the samples went through; None: a perfect one.
        level: Of the interval.

    Returns:
        Dataset by axis: stiffness with _low and _high.

    Raises:
        InputError: A track that is none or not trapped, or one with less variance than the detector's noise.
    """
    check_level(level)
    check_temperature(temperature)
    tracks, detector = tracks_of(x), detector or Detector()
    detector.check(tracks.interval)
    thermal = BOLTZMANN * temperature

    def row_of(axis: int) -> Row:
        low, middle, high = _variance(tracks, axis, fitted_process(tracks, axis, detector), level)
        return {"stiffness": (thermal / middle, thermal / high, thermal / low if low else math.inf)}

    rows, notes = each_axis(tracks.axes, row_of)
    return estimates(rows, tracks.axes, level=level, method="equipartition", notes=notes)


def _variance(tracks: Tracks, axis: int, process: Process, level: float) -> tuple[float, float, float]:
    """Lower end, value and upper end of the bead's variance [µm²]."""
    from scipy.special import chdtri

    _, worlds, n = tracks.values.shape
    memory = int(min(n, MEMORY / (process.rate * process.interval) + 2))
    r = process.autocovariance(memory)
    lost = variance_of_mean(r, n) / worlds
    freedom = 2.0 * (r[0] - lost) ** 2 / variance_of_squares(r, n, worlds)
    passed, steep = _passed(process)
    # with an exposure, a rate that is uncertain makes the share that passes uncertain too
    freedom = 2.0 / (2.0 / freedom + (steep * _error_of_rate(process, n * worlds)) ** 2)
    scale = float(np.var(tracks.values[axis])) * r[0] / (r[0] - lost)
    noise = process.detector.noise
    if scale <= noise**2:
        raise InputError(f"detector: noise = {noise:g} µm; allowed: below the track's {math.sqrt(scale):.3g}")
    tail = 0.5 * (1.0 - level)
    ends = (scale * freedom / chdtri(freedom, tail), scale, scale * freedom / chdtri(freedom, 1.0 - tail))
    low, middle, high = (max(v - noise**2, 0.0) / passed for v in ends)
    return low, middle, high


def variance_of_squares(r: np.ndarray, n: int, worlds: int) -> float:
    """Of the mean square about the mean, of `worlds` tracks of n samples with the autocovariance r [µm⁴]."""
    m = np.arange(len(r))
    pairs = np.where(m > 0, 2.0, 1.0) * (1.0 - m / n)
    squares = 2.0 * float(np.sum(pairs * r**2)) / (n * worlds)
    of_mean = variance_of_mean(r, n)
    # tr((HR)²) = tr(R²) − 2·1ᵀR²1/N + (1ᵀR1)²/N² with H = 1 − 11ᵀ/N; R acts on 1 as nearly a number
    return squares - 2.0 * (of_mean / worlds) ** 2


def _passed(process: Process) -> tuple[float, float]:
    """Share of the bead's variance that the samples have without noise, and its slope by the logarithm of the rate."""

    def share(rate: float) -> float:
        one = Process(diffusion=rate, rate=rate, interval=process.interval, detector=process.detector)
        return float(one.autocovariance(1)[0]) - process.detector.noise**2

    if not process.detector.exposure and not math.isfinite(process.detector.cutoff):
        return 1.0, 0.0
    h, value = 1e-3, share(process.rate)
    return value, (math.log(share(process.rate * (1 + h))) - math.log(share(process.rate * (1 - h)))) / (2.0 * h)


def _error_of_rate(process: Process, samples: int) -> float:
    """Relative standard error of the rate, of a process that is sampled perfectly."""
    step = math.exp(-min(process.rate * process.interval, 30.0))
    return math.sqrt((1.0 - step**2) / samples) / (step * process.rate * process.interval)
