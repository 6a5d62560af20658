"""Power spectra of tracks, and the trap that fits them best.

The ordinates of a periodogram of a long Gaussian track are independent and exponentially distributed around their
expectation; means of several are gamma distributed. `fit_spectrum` maximises that likelihood (Whittle's) with the
expectation of `otwarp.analysis.process`, which has aliasing, leakage, exposure, filter and noise in it. Leakage would
correlate ordinates where the spectrum falls steeply; what is transformed is therefore x(t + Δ) − φ·x(t), with φ such
that its spectrum is nearly flat. The blocking of Berg-Sørensen and Flyvbjerg (2004, doi:10.1063/1.1645654), which makes
least squares possible, is needed for pictures only, and the bias of least squares (Nørrelykke and Flyvbjerg 2010,
doi:10.1063/1.3455217) does not arise.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from otwarp.analysis.detector import Detector
from otwarp.analysis.estimates import NotTrapped, Row, check_level, check_temperature, each_axis, estimates, factor
from otwarp.analysis.process import Process
from otwarp.analysis.tracks import Tracks, tracks_of, xarray
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN

LONGEST = 2**17
"""Samples of a block that are transformed at once; longer tracks are cut into equal blocks."""

UNIT_ROOT = 14.1
"""Relaxation times that must pass in all: less is what a free bead, which nothing holds, seems to have.

The 5 % point of n(ρ̂ − 1) for a random walk with unknown mean (Dickey and Fuller 1979,
doi:10.1080/01621459.1979.10482531; table 10.A.1 of Fuller 1996, n → ∞).
"""

LEAST_EACH = 3.0
"""Relaxation times that must pass in each of several worlds."""

FASTEST = 30.0
"""Relaxation rate times interval beyond which samples are independent to rounding, and say nothing about the rate."""


def power_spectrum(x: Any, *, blocks: int = 1, bins: int = 0) -> Any:
    """One-sided power spectral density of a track, the mean of its blocks and worlds.

    Args:
        x: Track with the dimension `time` [µm].
        blocks: Stretches of equal length into which each world's track is cut (Bartlett; no window, for the fit knows
            the leakage).
        bins: Frequencies to which neighbours are averaged, evenly in log f; 0 keeps all.

    Returns:
        Dataset over `frequency` [Hz] and axis: `power` [µm²/Hz], `error`, its standard error, and `count`, how many
        ordinates each is the mean of. Frequency 0 is left out: the mean is no fluctuation.

    Raises:
        InputError: A track that is none (see `otwarp.analysis.tracks`), or more blocks than it can be cut into.
    """
    tracks = tracks_of(x)
    frequency, power, count = _periodogram(tracks, blocks)
    counts = np.full(frequency.shape, float(count))
    if bins:
        edges = np.geomspace(frequency[0] * 0.999, frequency[-1] * 1.001, bins + 1)
        at = np.digitize(frequency, edges)
        groups = [np.flatnonzero(at == n) for n in np.unique(at)]
        power = np.stack([power[:, g].mean(axis=1) for g in groups], axis=1)
        counts = np.array([count * len(g) for g in groups], dtype=float)
        frequency = np.array([frequency[g].mean() for g in groups])
    out = xarray().Dataset(coords={"frequency": ("frequency", frequency, {"units": "Hz"}), "axis": tracks.axes})
    said = {"units": "um2/Hz"}
    out["power"] = (("axis", "frequency"), power, said | {"long_name": "one-sided power spectral density"})
    out["error"] = (("axis", "frequency"), power / np.sqrt(counts), said | {"long_name": "standard error"})
    out["count"] = ("frequency", counts)
    return out


def _periodogram(tracks: Tracks, blocks: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Frequencies above 0 and below Nyquist [Hz], (axes, frequencies) mean periodogram, ordinates behind each mean."""
    axes, worlds, n = tracks.values.shape
    if not 1 <= blocks <= n // 8:
        raise InputError(f"blocks is {blocks}; allowed: 1 to {n // 8}, an eighth of the samples")
    size = n // blocks
    centred = tracks.values - tracks.values.mean(axis=(1, 2), keepdims=True)
    total = np.zeros((axes, size // 2 + 1))
    for block in np.split(centred[..., : size * blocks], blocks, axis=-1):
        total += np.sum(np.abs(np.fft.rfft(block, axis=-1)) ** 2, axis=1)
    use = slice(1, (size + 1) // 2)
    scale = 2.0 * tracks.interval / size / (worlds * blocks)
    return np.fft.rfftfreq(size, tracks.interval)[use], total[:, use] * scale, worlds * blocks


def fit_spectrum(
    x: Any,
    *,
    temperature: float,
    detector: Detector | None = None,
    drag: float | None = None,
    fit_noise: bool = False,
    blocks: int = 0,
    band: tuple[float, float] = (0.0, math.inf),
    level: float = 0.95,
) -> Any:
    """Stiffness, drag and corner frequency along each axis, from the power spectrum by maximum likelihood.

    Args:
        x: Track with the dimension `time` [µm].
        temperature: [K].
        detector: What the samples went through; None: a perfect one.
        drag: γ where it is known [pN·s/µm]; then stiffness is 2πγ·f_c, and the signal need not be in µm: `sensitivity`
            says what its unit is. None takes γ = k_BT/D from the spectrum itself.
        fit_noise: Whether the detector's noise is fitted as well.
        blocks: As of `power_spectrum`; 0: as few as `LONGEST` allows.
        band: Lowest and highest frequency that counts [Hz].
        level: Of the intervals, which are normal in the logarithms, by the Fisher information.

    Returns:
        Dataset by axis: stiffness, drag, corner_frequency, diffusion, with `noise` or `sensitivity` where asked for,
        each with _low and _high, NaN along axes on which the bead is not trapped; `p_value` of the fit, by χ² of
        the binned spectrum.

    Raises:
        InputError: A track that is none or not trapped, or a band without frequencies.
    """
    quantile = check_level(level)
    check_temperature(temperature)
    tracks, detector = tracks_of(x), detector or Detector()
    detector.check(tracks.interval)
    thermal = BOLTZMANN * temperature
    worse = [math.nan] * len(tracks.axes)

    def row_of(axis: int) -> Row:
        theta, covariance, worse[axis] = _fit(tracks, axis, detector, fit_noise, blocks, band)
        return _row(theta, covariance, thermal, drag, quantile)

    rows, notes = each_axis(tracks.axes, row_of)
    out = estimates(rows, tracks.axes, level=level, method="power spectrum", notes=notes)
    out["p_value"] = ("axis", worse, {"long_name": "chance of a worse fit, were the model true"})
    return out


def _row(theta: np.ndarray, covariance: np.ndarray, thermal: float, drag: float | None, quantile: float) -> Row:
    """Quantities from logarithms of D, κ and perhaps the noise's variance."""
    errors = np.sqrt(np.diag(covariance))
    row = physical(theta[:2], covariance[:2, :2], thermal, drag, quantile)
    if drag is not None:
        row["sensitivity"] = factor(math.sqrt(thermal / drag) * math.exp(-0.5 * theta[0]), 0.5 * errors[0], quantile)
    if len(theta) > 2:
        row["noise"] = factor(math.exp(0.5 * theta[2]), 0.5 * errors[2], quantile)
    return row


def physical(
    theta: np.ndarray, covariance: np.ndarray, thermal: float, drag: float | None, quantile: float
) -> dict[str, tuple[float, float, float]]:
    """Stiffness, drag, corner frequency and diffusion with their ends, from the logarithms of D and κ.

    Args:
        theta, covariance: Logarithms, and their covariance (2, 2).
        thermal: k_BT [pN·µm].
        drag: Where it is known [pN·s/µm].
        quantile: Of the normal distribution, for the ends.
    """
    d, rate = np.exp(theta)
    errors = np.sqrt(np.diag(covariance))
    if drag is None:
        ratio = math.sqrt(max(covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1], 0.0))
        stiff, slow = factor(thermal * rate / d, ratio, quantile), factor(thermal / d, errors[0], quantile)
    else:
        stiff, slow = factor(drag * rate, errors[1], quantile), (drag, drag, drag)
    corner = factor(rate / (2.0 * math.pi), errors[1], quantile)
    return {"stiffness": stiff, "drag": slow, "corner_frequency": corner, "diffusion": factor(d, errors[0], quantile)}


def fitted_process(tracks: Tracks, axis: int, detector: Detector) -> Process:
    """The process that fits the spectrum of an axis best.

    Raises:
        NotTrapped: There is none.
    """
    theta, _, _ = _fit(tracks, axis, detector, False, 0, (0.0, math.inf))
    return Process(diffusion=math.exp(theta[0]), rate=math.exp(theta[1]), interval=tracks.interval, detector=detector)


def _fit(
    tracks: Tracks, axis: int, detector: Detector, fit_noise: bool, blocks: int, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Logarithms of D, κ and perhaps the noise's variance; their covariance; and the p-value of the fit."""
    one = Tracks(tracks.values[axis : axis + 1], tracks.interval, tracks.start, [tracks.axes[axis]])
    start = _start(one, detector, fit_noise)
    white = _whitened(one)
    n = one.values.shape[-1] - 1
    blocks = blocks or math.ceil(n / LONGEST)
    frequency, power, count = _periodogram(Tracks(white[0], one.interval, one.start, one.axes), blocks)
    use = (frequency >= band[0]) & (frequency <= min(band[1], _clear(detector)))
    if np.count_nonzero(use) < FEW_ORDINATES:
        raise InputError(
            f"band is {band[0]:g} to {band[1]:g} Hz, with {np.count_nonzero(use)} frequencies; allowed: "
            f"{FEW_ORDINATES} or more of {frequency[0]:.3g} to {frequency[-1]:.4g} Hz"
        )
    p = power[0][use]

    def expected(theta: np.ndarray) -> np.ndarray:
        """Periodogram [µm²/Hz] at the frequencies in use, by logarithms of D, κ and the variance of noise."""
        seen = replace(detector, noise=math.exp(0.5 * theta[2])) if fit_noise else detector
        process = Process(
            diffusion=math.exp(theta[0]), rate=math.exp(theta[1]), interval=tracks.interval, detector=seen
        )
        return process.periodogram(n // blocks, whitened=white[1])[1 : len(frequency) + 1][use]

    limit = math.log(FASTEST / tracks.interval)
    theta, covariance = _scoring(p, count, expected, start, limit)
    check_trapped(math.exp(theta[1]), tracks, axis)
    return theta, covariance, _p_value(p / expected(theta), count, len(theta))


FEW_ORDINATES = 8
"""Frequencies that a fit needs."""


HELD_BACK = 1e-2
"""Power that a filter lets pass, as a share, below which frequencies tell more of leakage than of the bead."""


def _clear(detector: Detector) -> float:
    """Highest frequency that a filter does not hold back [Hz]."""
    if detector.passed**2 >= HELD_BACK:
        return math.inf
    return detector.cutoff * (1.0 / HELD_BACK - 1.0) ** (0.5 / detector.order)


def _whitened(tracks: Tracks) -> tuple[np.ndarray, float]:
    """x(t + Δ) − φ·x(t) of tracks (axes, worlds, n − 1), and φ."""
    x = tracks.values - tracks.values.mean(axis=(1, 2), keepdims=True)
    share = float(np.clip(np.sum(x[..., 1:] * x[..., :-1]) / np.sum(x * x), 0.0, 1.0))
    return x[..., 1:] - share * x[..., :-1], share


def _start(tracks: Tracks, detector: Detector, fit_noise: bool) -> np.ndarray:
    """Logarithms of D, κ and the noise's variance from three lags."""
    x = tracks.values[0] - tracks.values[0].mean()
    variance, one, two = np.mean(x * x), np.mean(x[:, 1:] * x[:, :-1]), np.mean(x[:, 2:] * x[:, :-2])
    noise = detector.noise**2
    share = np.clip(two / one if one > 0.0 else 0.0, 1e-2, 1.0 - 1e-6)
    if fit_noise:
        noise = max(variance - one / share, 1e-3 * variance)
    elif one > 0.0 and variance > noise:
        share = np.clip(one / (variance - noise), 1e-2, 1.0 - 1e-6)
    rate = -math.log(share) / tracks.interval
    d = rate * max(variance - noise, 0.1 * variance)
    return np.log([d, rate, noise] if fit_noise else [d, rate])


def _scoring(
    power: np.ndarray, count: int, expected: Any, start: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters of the largest likelihood, by Fisher scoring, and their covariance."""
    h = 1e-4
    theta = start.copy()

    def cost(at: np.ndarray) -> tuple[float, np.ndarray]:
        e = expected(at)
        return count * float(np.sum(np.log(e) + power / e)), e

    least, e = cost(theta)
    information = np.eye(len(theta))
    for _ in range(60):
        steps = h * np.eye(len(theta))
        slope = np.stack([np.log(expected(theta + s) / expected(theta - s)) / (2.0 * h) for s in steps])
        information = count * slope @ slope.T
        move = np.linalg.lstsq(information, count * slope @ (power / e - 1.0), rcond=1e-12)[0]
        move *= min(1.0, 1.0 / np.max(np.abs(move), initial=1e-300))
        for _ in range(20):
            trial = theta + move
            trial[1] = min(trial[1], limit)
            value, e_trial = cost(trial)
            if value <= least + 1e-9 * abs(least):
                break
            move *= 0.5
        theta, least, e = trial, value, e_trial
        if np.max(np.abs(move)) < 1e-6:
            break
    with np.errstate(all="ignore"):
        covariance = np.linalg.pinv(information, rcond=1e-14, hermitian=True)
    return theta, covariance


def check_trapped(rate: float, tracks: Tracks, axis: int) -> None:
    """Refuse a track on which the bead relaxed so seldom that a free one could have made it.

    Raises:
        NotTrapped: It is too short, or the bead was not trapped.
    """
    _, worlds, _ = tracks.values.shape
    each = rate * tracks.duration
    least = max(UNIT_ROOT / worlds, LEAST_EACH)
    if each < least:
        raise NotTrapped(
            f"axis {tracks.axes[axis]}: the track lasts {tracks.duration:.4g} s, {each:.3g} relaxation times as it "
            f"seems; allowed: {least:.3g} or more: longer tracks, or a bead that is trapped (free ones look like this)"
        )


def _p_value(ratio: np.ndarray, count: int, parameters: int) -> float:
    """χ² of means over bins of the power over its expectation, each a gamma variable turned into a normal one."""
    from scipy.special import chdtrc, gammainc, ndtri

    edges = np.unique(np.geomspace(1, len(ratio) + 1, 40).astype(int)) - 1
    sizes = count * np.diff(edges)
    sums = count * np.add.reduceat(ratio, edges[:-1])
    with np.errstate(divide="ignore"):
        normal = ndtri(np.clip(gammainc(sizes, sums), 1e-16, 1.0 - 1e-16))
    return float(chdtrc(max(len(sizes) - parameters, 1), np.sum(normal**2)))
