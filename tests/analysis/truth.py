"""What the tests of the analysis know: a bead, exact tracks of it, and when too few intervals hold the truth."""

from __future__ import annotations

import numpy as np

from otwarp.analysis.process import Process
from otwarp.units import BOLTZMANN

TEMPERATURE = 298.15
THERMAL = BOLTZMANN * TEMPERATURE
DRAG = 0.0168
"""Of a bead of radius 1 µm in water [pN·s/µm]."""

RELAXATION = DRAG / 1.0
"""Of that bead at 1 pN/µm [s]."""


def process(interval: float, stiffness: float = 1.0, **detector: float) -> Process:
    from otwarp.analysis import Detector

    seen = Detector(**detector)  # pyright: ignore[reportArgumentType]
    return Process(diffusion=THERMAL / DRAG, rate=stiffness / DRAG, interval=interval, detector=seen)


def gaussian_tracks(process: Process, samples: int, tracks: int, seed: int) -> np.ndarray:
    """(tracks, samples) with the autocovariance of a process, exactly: circulant embedding.

    Davies and Harte (1987, doi:10.1093/biomet/74.1.95).
    """
    r = process.autocovariance(samples + 1)
    power = np.fft.fft(np.concatenate([r, r[-2:0:-1]])).real
    assert power.min() > -1e-9 * power.max()
    random = np.random.Generator(np.random.Philox(seed))
    noise = random.standard_normal((2, tracks, 2 * samples))
    noise = (noise[0] + 1j * noise[1]) * np.sqrt(np.maximum(power, 0.0) / (2 * samples))
    return np.fft.fft(noise, axis=1).real[:, :samples]


def check_coverage(hits: np.ndarray, level: float = 0.95, allowance: float = 0.0) -> None:
    """Fail where fewer intervals hold the truth than their level says, by 5 standard errors and an allowance."""
    hits = np.asarray(hits, dtype=float)
    error = np.sqrt(level * (1.0 - level) / len(hits))
    assert np.all(hits.mean(axis=0) >= level - allowance - 5.0 * error), hits.mean(axis=0)
