"""Limit cycles of hands that should rest: oscillations that go on, told from noise, drift and what dies away."""

from __future__ import annotations

import numpy as np

PERIODS = 2
"""After so many periods an oscillation must still be like itself, and half a period before that its opposite."""
ALIKE = 0.7
"""Least correlation with itself then. Noise that a resonance has coloured keeps exp(−2π/Q) of it in two periods, so
that resonances with Q above 18, which are as good as unstable, are taken for limit cycles, and no others."""
KEPT = 0.7
"""Of its root mean square in the first quarter, what the last one must have at least: it does not decay."""
LEAST = 1e-6
"""Amplitudes below this are none [m]: no encoder of a haptic device resolves them."""


def slowest(seconds: float) -> float:
    """The slowest oscillation that can be told in so many seconds [Hz]: `PERIODS` in each half of them."""
    return 2.0 * PERIODS / seconds


def limit_cycles(track: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and amplitude [m] of the limit cycle of each hand; nan and 0 where there is none.

    What a hand does along the line on which it moves most is one if it is like itself after `PERIODS` periods of its
    dominant frequency, like its opposite half a period before, does not decay, and is not tiny. Slower ones than
    `slowest` are not told from drift.

    Args:
        track: (…, n, 3) places of hands that should rest, at even times [m].
        rate: Of these [1/s].
    """
    shape, count = track.shape[:-2], track.shape[-2]
    found = [_cycle(one, rate) for one in track.reshape(-1, count, 3)]
    frequency, amplitude = (np.array(column).reshape(shape) for column in zip(*found, strict=True))
    return frequency, amplitude


def _cycle(track: np.ndarray, rate: float) -> tuple[float, float]:
    """Frequency and amplitude of one hand, (n, 3)."""
    none = (np.nan, 0.0)
    if not np.all(np.isfinite(track)):
        return none
    y = _along(track)
    count = len(y)
    quarters = [float(np.sqrt(np.mean(part**2))) for part in np.array_split(y, 4)]
    amplitude = float(np.sqrt(2.0 * np.mean(y[count // 2 :] ** 2)))
    if amplitude < LEAST or quarters[-1] < KEPT * quarters[0]:
        return none
    power = np.abs(np.fft.rfft(y * np.hanning(count))) ** 2
    frequencies = np.fft.rfftfreq(count, 1.0 / rate)
    power[frequencies < slowest(count / rate) - 1e-9] = 0.0
    period = rate / frequencies[int(np.argmax(power))]
    near = np.arange(max(round(0.9 * PERIODS * period), 1), min(round(1.1 * PERIODS * period), count // 2) + 1)
    alike = [_alike(y, int(lag)) for lag in near]
    lag = int(near[int(np.argmax(alike))]) if len(near) else 0
    opposite = _alike(y, round(lag * (PERIODS - 0.5) / PERIODS)) if lag else 0.0
    if not lag or max(alike) < ALIKE or opposite > -ALIKE:
        return none
    return PERIODS * rate / lag, amplitude


def _along(track: np.ndarray) -> np.ndarray:
    """(n) the way along the line on which a hand moves most, without the straight line in time nearest to it [m]."""
    time = np.arange(len(track)) - 0.5 * (len(track) - 1)
    away = track - track.mean(axis=0)
    away = away - time[:, None] * (time @ away / (time @ time))
    _, axes = np.linalg.eigh(away.T @ away)
    return away @ axes[:, -1]


def _alike(y: np.ndarray, lag: int) -> float:
    """Correlation of a way with itself some samples later."""
    before, after = y[: len(y) - lag], y[lag:]
    both = float(np.sqrt((before @ before) * (after @ after)))
    return float(before @ after) / both if both > 0.0 else 0.0
