"""`Process`: second moments of a bead in a harmonic trap as a detector samples it, without an approximation.

The bead is an Ornstein–Uhlenbeck process, ẋ = −κ·x + √(2D)·ξ. The filter of a detector adds poles to its response, so
that the autocovariance is a sum of exponentials; averaging over an exposure multiplies each by a factor, and noise adds
to the variance. All that sampling does follows: aliasing, for the spectrum of the samples is the transform of their
autocovariance; and the leakage of a finite track, for the expected periodogram of n samples is the transform of
(1 − |m|/n)·R(m) (Sykulski et al. 2019, doi:10.1093/biomet/asy071). For a perfect detector this is the aliased
Lorentzian of Berg-Sørensen and Flyvbjerg (2004, doi:10.1063/1.1645654), plus leakage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from otwarp.analysis.detector import Detector

APART = 1e-5
"""A filter's pole on the bead's own rate is moved by this share: the residues of a double pole are infinite."""


@dataclass(frozen=True, kw_only=True)
class Process:
    """A trapped bead as a detector samples it, along one axis.

    Attributes:
        diffusion: D [µm²/s].
        rate: κ, stiffness over drag [1/s].
        interval: Between samples [s].
        detector: Its exposure, filter and noise.
    """

    diffusion: float
    rate: float
    interval: float
    detector: Detector = field(default_factory=Detector)

    def autocovariance(self, count: int) -> np.ndarray:
        """(count,) R at lags 0, 1, … of the samples [µm²]."""
        exposure = self.detector.exposure
        lag = self.interval * np.arange(count)
        total = np.zeros(count)
        for rate, weight in self._exponentials():
            blurred = rate * exposure
            if abs(blurred) < 1e-6:
                total += (weight * np.exp(-rate * lag)).real
                continue
            factor = ((1.0 - np.exp(-blurred)) / blurred) ** 2
            total[1:] += (weight * factor * np.exp(-rate * (lag[1:] - exposure))).real
            total[0] += (weight * blur(blurred)).real
        total[0] += self.detector.noise**2
        return total

    def _exponentials(self) -> list[tuple[complex, complex]]:
        """Rates [1/s] and weights [µm²] of the autocovariance before exposure and noise."""
        amplitude = math.sqrt(2.0 * self.diffusion)
        if not math.isfinite(self.detector.cutoff):
            return [(self.rate, self.diffusion / self.rate)]
        from scipy.signal import butter

        d = self.detector
        found: Any = butter(d.order, 2.0 * math.pi * d.cutoff, analog=True, output="zpk")
        poles, gain = np.asarray(found[1]), float(found[2])
        rate = self.rate
        if np.min(np.abs(poles + rate)) < APART * rate:
            rate *= 1.0 + 2.0 * APART
        own = d.passed + (1.0 - d.passed) * gain / np.prod(-rate - poles)
        others = [
            (1.0 - d.passed) * gain / (np.prod(p - np.delete(poles, n)) * (p + rate)) for n, p in enumerate(poles)
        ]
        pole = np.array([-rate, *poles], dtype=complex)
        residue = amplitude * np.array([own, *others], dtype=complex)
        weight = residue * np.sum(residue[None, :] / -(pole[:, None] + pole[None, :]), axis=1)
        return list(zip(-pole, weight, strict=True))

    def periodogram(self, count: int, *, whitened: float = 0.0) -> np.ndarray:
        """Expected one-sided periodogram of `count` samples at k/(count·interval), k = 0 … count/2 [µm²/Hz].

        Args:
            count: Of samples.
            whitened: φ, where x(t + Δ) − φ·x(t) was transformed.
        """
        r = self.autocovariance(count + 1)
        before = np.append(r[1], r[: count - 1])
        r = (1.0 + whitened**2) * r[:-1] - whitened * (r[1:] + before)
        folded = (1.0 - np.arange(count) / count) * r
        return 2.0 * self.interval * (2.0 * np.fft.rfft(folded).real - folded[0])


def blur(ratio: complex | float) -> complex | float:
    """Variance of an exponential process averaged over `ratio` relaxation times, over that of the process.

    Wong and Halvorsen (2006, doi:10.1364/OE.14.012517).
    """
    if abs(ratio) < 1e-4:
        return 1.0 - ratio / 3.0 + ratio**2 / 12.0
    return 2.0 * (np.exp(-ratio) - 1.0 + ratio) / ratio**2
