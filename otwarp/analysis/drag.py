"""Stiffness from a known drag force: a trap that moves through the liquid, or a liquid that flows past it.

At a constant speed the bead lags until trap and drag balance: k·x = γ·(w − v), for a flow w and a trap that moves with
v.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from otwarp.analysis.correlation import MEMORY, variance_of_mean
from otwarp.analysis.estimates import estimates
from otwarp.analysis.process import Process
from otwarp.analysis.tracks import tracks_of
from otwarp.errors import InputError

SETTLED = 7.0
"""Relaxation times after a change of speed that are left out: e⁻⁷ of the change is left."""

EQUAL = 1e-3
"""Speeds that differ by less than this share of the largest are one speed."""


def drag_calibration(
    trajectory: Any,
    *,
    drag: float | None = None,
    flow: Sequence[float] = (0.0, 0.0, 0.0),
    rest: Sequence[float] | None = None,
    level: float = 0.95,
) -> Any:
    """Stiffness along each axis on which the liquid moves past the trap, from the mean displacement.

    Stretches of constant trap velocity count from `SETTLED` relaxation times on. With several speeds the stiffness is
    the slope of drag force against displacement; with one, the displacement at rest must be known. Errors are those of
    the stretches' means, of correlated samples. Where the interval of the slope reaches 0, stiffness has no upper end.

    Args:
        trajectory: Dataset as of `load_trajectory`, with `displacement` and `trap_position`.
        drag: γ [pN·s/µm]; None: that of the trajectory.
        flow: w, velocity of the liquid [µm/s], the same all the time.
        rest: Displacement at rest along each axis [µm]; None: fitted where there are several speeds, 0 where not.
        level: Of the intervals.

    Returns:
        Dataset by axis: stiffness with _low and _high; NaN along axes on which nothing moves.

    Raises:
        InputError: No known drag, nothing moves, or no stretch is long enough.
    """
    gamma = float(trajectory.attrs.get("drag", math.nan)) if drag is None else drag
    if not 0.0 < gamma < math.inf:
        raise InputError(f"drag is {gamma}; allowed: above 0, in pN·s/µm (known for lone spheres only)")
    tracks = tracks_of(trajectory["displacement"])
    traps = np.zeros_like(tracks.values)
    if "trap_position" in trajectory:
        traps = trajectory["trap_position"].transpose("axis", "world", "time").values.astype(float)
    speed = np.diff(traps, axis=-1) / tracks.interval
    past = np.asarray(flow, dtype=float)[: len(speed), None, None] - speed
    if not np.any(past):
        raise InputError("trap and liquid are at rest; allowed: a trap that moves, or flow")
    stretches = _stretches(past)
    rows = []
    for axis in range(len(tracks.axes)):
        if not np.any(past[axis]):
            rows.append({"stiffness": (math.nan,) * 3})
            continue
        known = None if rest is None else rest[axis]
        rows.append(
            {"stiffness": _stiffness(tracks.values[axis], past[axis], stretches, tracks.interval, gamma, known, level)}
        )
    return estimates(rows, tracks.axes, level=level, method="drag")


def _stretches(past: np.ndarray) -> list[tuple[int, int]]:
    """Ranges of intervals within which the velocity is constant in every world."""
    most = np.max(np.abs(past))
    jumps = np.any(np.abs(np.diff(past, axis=-1)) > UNEVEN_SPEED * most, axis=(0, 1))
    edges = [0, *(np.flatnonzero(jumps) + 1), past.shape[-1]]
    return [(a, b) for a, b in pairwise(edges) if b - a >= 2]


UNEVEN_SPEED = 0.3
"""Change of velocity from interval to interval, as a share of the largest, that begins a stretch: frames jitter."""


def _stiffness(
    x: np.ndarray,
    past: np.ndarray,
    stretches: list[tuple[int, int]],
    interval: float,
    gamma: float,
    rest: float | None,
    level: float,
) -> tuple[float, float, float]:
    """Value and ends, for x (worlds, n) and the liquid's velocity past the trap (worlds, n − 1)."""
    from scipy.special import stdtrit

    process = _settled_process(x, stretches, interval)
    skip = math.ceil(SETTLED / (process.rate * interval))
    worlds = len(x)
    force, mean, weight = [], [], []
    for a, b in stretches:
        n = b - a - skip
        if n < 2:
            continue
        r = process.autocovariance(int(min(n, MEMORY / (process.rate * interval) + 2)))
        force.append(gamma * float(past[:, a:b].mean()))
        mean.append(float(x[:, a + skip + 1 : b + 1].mean()))
        weight.append(worlds / variance_of_mean(r, n))
    if not force:
        raise InputError(
            f"no stretch of constant speed lasts {skip + 2} samples, {SETTLED:g} relaxation times; allowed: longer ones"
        )
    f, u, w = np.array(force), np.array(mean), np.array(weight)
    several = np.ptp(f) > EQUAL * np.max(np.abs(f)) and rest is None
    if several:
        f, u = f - np.average(f, weights=w), u - np.average(u, weights=w)
    else:
        u = u - (rest or 0.0)
    compliance, error = float(np.sum(w * f * u) / np.sum(w * f * f)), 1.0 / math.sqrt(np.sum(w * f * f))
    # the variance that weighs the means is itself estimated, from as many independent samples as relaxation times / 2
    freedom = max(2.0, 0.5 * x.size * process.rate * interval)
    reach = float(stdtrit(freedom, 0.5 + 0.5 * level)) * error
    high = math.inf if compliance <= reach else 1.0 / (compliance - reach)
    low = 1.0 / (compliance + reach) if compliance + reach > 0.0 else 0.0
    return 1.0 / compliance if compliance > 0.0 else math.nan, low, high


def _settled_process(x: np.ndarray, stretches: list[tuple[int, int]], interval: float) -> Process:
    """Fluctuations about the mean of the later half of every stretch."""
    parts = [x[:, (a + b) // 2 : b + 1] for a, b in stretches if b - a >= 8]
    if not parts:
        raise InputError("no stretch of constant speed has 8 samples; allowed: longer ones")
    parts = [p - p.mean() for p in parts]
    variance = float(np.concatenate([p.ravel() for p in parts]).var())
    one = float(np.concatenate([(p[:, 1:] * p[:, :-1]).ravel() for p in parts]).mean())
    rate = -math.log(min(max(one / variance, 1e-6), 1.0 - 1e-6)) / interval
    return Process(diffusion=variance * rate, rate=rate, interval=interval)
