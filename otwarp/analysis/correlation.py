"""Mean squared displacement and autocorrelation of tracks, and the trap that fits them best.

Both are means of products along the track, whose lags are strongly correlated. For a Gaussian process their covariance
is known from the autocovariance (Isserlis' theorem), so that the fits weigh lags as they should (generalised least
squares), and errors are not guessed from the scatter of points that are not independent.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from otwarp.analysis.detector import Detector
from otwarp.analysis.estimates import Row, check_level, check_temperature, each_axis, estimates
from otwarp.analysis.process import Process
from otwarp.analysis.spectrum import FASTEST, fitted_process, physical
from otwarp.analysis.tracks import Tracks, tracks_of, xarray
from otwarp.units import BOLTZMANN

Kind = Literal["msd", "autocorrelation"]

LAGS = 12
"""Lags of a fit, evenly in their logarithm."""

REACH = 3.0
"""Longest lag of a fit, in relaxation times: what comes later adds noise."""

MEMORY = 12.0
"""Relaxation times after which correlations are e⁻¹² and left out of sums."""


def msd(x: Any, *, lags: int = 40, longest: float = math.inf) -> Any:
    """Mean squared displacement of a track over lags, averaged over time and worlds.

    Args:
        x: Track with the dimension `time` [µm].
        lags: How many, evenly in their logarithm.
        longest: Longest lag [s]; at most a quarter of the track is used.

    Returns:
        Dataset over `lag` [s] and axis: `msd` [µm²].

    Raises:
        InputError: A track that is none.
    """
    return _curve(tracks_of(x), "msd", lags, longest)


def autocorrelation(x: Any, *, lags: int = 40, longest: float = math.inf) -> Any:
    """Autocovariance ⟨x(t)·x(t + lag)⟩ of a track about its mean over time and worlds.

    Args:
        x: Track with the dimension `time` [µm].
        lags: How many, 0 and then evenly in their logarithm.
        longest: Longest lag [s]; at most a quarter of the track is used.

    Returns:
        Dataset over `lag` [s] and axis: `autocorrelation` [µm²].

    Raises:
        InputError: A track that is none.
    """
    return _curve(tracks_of(x), "autocorrelation", lags, longest)


def _curve(tracks: Tracks, kind: Kind, lags: int, longest: float) -> Any:
    n = tracks.values.shape[-1]
    most = max(1, int(min(n // 4, longest / tracks.interval)))
    at = _spread(most, lags, kind)
    found = _measured(tracks.values - tracks.values.mean(axis=(1, 2), keepdims=True), at, kind)
    out = xarray().Dataset(coords={"lag": ("lag", tracks.interval * at, {"units": "s"}), "axis": tracks.axes})
    said = "mean squared displacement" if kind == "msd" else "autocovariance about the mean"
    out[kind] = (("axis", "lag"), found, {"units": "um2", "long_name": said})
    return out


def _spread(most: int, lags: int, kind: Kind) -> np.ndarray:
    """(≤ lags,) whole lags up to `most`, with 0 for correlations."""
    found = np.unique(np.geomspace(1, most, lags).round().astype(int))
    return found if kind == "msd" else np.append(0, found)


def _measured(x: np.ndarray, lags: np.ndarray, kind: Kind) -> np.ndarray:
    """(axes, lags) means over time and worlds of products or squares."""
    n = x.shape[-1]
    if kind == "msd":
        return np.stack([np.mean((x[..., m:] - x[..., : n - m]) ** 2, axis=(1, 2)) for m in lags], axis=1)
    return np.stack([np.mean(x[..., m:] * x[..., : n - m], axis=(1, 2)) for m in lags], axis=1)


def fit_msd(
    x: Any, *, temperature: float, detector: Detector | None = None, drag: float | None = None, level: float = 0.95
) -> Any:
    """Stiffness and drag along each axis, from the mean squared displacement up to `REACH` relaxation times.

    Args:
        x: Track with the dimension `time` [µm].
        temperature: [K].
        detector: What the samples went through; None: a perfect one.
        drag: As of `fit_spectrum`.
        level: Of the intervals.

    Returns:
        Dataset by axis: stiffness, drag, corner_frequency, diffusion, each with _low and _high.

    Raises:
        InputError: A track that is none or not trapped.
    """
    return _fit(x, "msd", temperature, detector, drag, level)


def fit_autocorrelation(
    x: Any, *, temperature: float, detector: Detector | None = None, drag: float | None = None, level: float = 0.95
) -> Any:
    """Stiffness and drag along each axis, from the autocorrelation up to `REACH` relaxation times.

    Args:
        x: Track with the dimension `time` [µm].
        temperature: [K].
        detector: What the samples went through; None: a perfect one.
        drag: As of `fit_spectrum`.
        level: Of the intervals.

    Returns:
        Dataset by axis: stiffness, drag, corner_frequency, diffusion, each with _low and _high.

    Raises:
        InputError: A track that is none or not trapped.
    """
    return _fit(x, "autocorrelation", temperature, detector, drag, level)


def _fit(x: Any, kind: Kind, temperature: float, detector: Detector | None, drag: float | None, level: float) -> Any:
    quantile = check_level(level)
    check_temperature(temperature)
    tracks, detector = tracks_of(x), detector or Detector()
    detector.check(tracks.interval)
    centred = tracks.values - tracks.values.mean(axis=(1, 2), keepdims=True)

    def row_of(axis: int) -> Row:
        process = fitted_process(tracks, axis, detector)
        theta, covariance = _least_squares(centred[axis : axis + 1], process, kind)
        return physical(theta, covariance, BOLTZMANN * temperature, drag, quantile)

    rows, notes = each_axis(tracks.axes, row_of)
    name = "MSD" if kind == "msd" else "autocorrelation"
    return estimates(rows, tracks.axes, level=level, method=name, notes=notes)


def _least_squares(x: np.ndarray, process: Process, kind: Kind) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of D and κ with their covariance, from weights that the process of the first fit gives."""
    _, worlds, n = x.shape
    most = int(np.clip(REACH / (process.rate * process.interval), 2, n // 4))
    lags = _spread(most, LAGS, kind)
    found = _measured(x, lags, kind)[0]
    memory = int(min(n, MEMORY / (process.rate * process.interval) + 2 * most + 2))
    weights = np.linalg.inv(product_covariance(process.autocovariance(memory), n, lags, kind) / worlds)
    theta, h = np.log([process.diffusion, process.rate]), 1e-4

    def expected(at: np.ndarray) -> np.ndarray:
        """What is measured at the lags [µm²], by logarithms of D and κ."""
        p = Process(
            diffusion=math.exp(at[0]), rate=math.exp(at[1]), interval=process.interval, detector=process.detector
        )
        r = p.autocovariance(memory)
        if kind == "msd":
            return 2.0 * (r[0] - r[lags])
        return r[lags] - variance_of_mean(r, n) / worlds

    def cost(at: np.ndarray) -> float:
        rest = found - expected(at)
        return float(rest @ weights @ rest)

    limit = math.log(FASTEST / process.interval)
    for _ in range(60):
        slope = np.stack([(expected(theta + s) - expected(theta - s)) / (2.0 * h) for s in h * np.eye(2)])
        move = np.linalg.pinv(slope @ weights @ slope.T) @ slope @ weights @ (found - expected(theta))
        move *= min(1.0, 0.7 / np.max(np.abs(move), initial=1e-300))
        least = cost(theta)
        while theta[1] + move[1] > limit or (cost(theta + move) > least and np.max(np.abs(move)) > 1e-7):
            move = 0.5 * move
        theta = theta + move
        if np.max(np.abs(move)) < 1e-6:
            break
    return theta, np.linalg.pinv(slope @ weights @ slope.T)


def variance_of_mean(r: np.ndarray, n: int) -> float:
    """Of the mean of n samples with the autocovariance r, 0 beyond its end [µm²]."""
    m = np.arange(min(len(r), n))
    return float(np.sum(r[: len(m)] * (1.0 - m / n) * np.where(m > 0, 2.0, 1.0))) / n


def product_covariance(r: np.ndarray, n: int, lags: np.ndarray, kind: Kind) -> np.ndarray:
    """(lags, lags) covariance of what is measured at lags on one track of n samples with the autocovariance r."""
    reach = len(r) - 1 + int(lags[-1])

    def at(d: np.ndarray) -> np.ndarray:
        d = np.abs(d)
        return np.where(d < len(r), r[np.minimum(d, len(r) - 1)], 0.0)

    d = np.arange(-min(reach, n - 1), min(reach, n - 1) + 1)
    out = np.zeros((len(lags), len(lags)))
    for i, m in enumerate(lags):
        for j, q in enumerate(lags[: i + 1]):
            pairs = np.maximum(np.minimum(n - m, n - q - d) - np.maximum(0, -d), 0)
            if kind == "msd":
                moment = 2.0 * (at(d + q - m) - at(d - m) - at(d + q) + at(d)) ** 2
            else:
                moment = at(d) * at(d + q - m) + at(d + q) * at(d - m)
            out[i, j] = out[j, i] = np.sum(pairs * moment) / (float(n - m) * float(n - q))
    return out
