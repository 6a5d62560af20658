"""Work on a bead whose trap moves, and the free energy differences that it tells.

Moving a trap does the work W = ∫ F·dλ, with F the trap's force on the bead and λ the trap's position, since the energy
depends on their difference alone. Jarzynski (1997, doi:10.1103/PhysRevLett.78.2690): ⟨exp(−W/k_BT)⟩ = exp(−ΔF/k_BT).
Crooks (1999, doi:10.1103/PhysRevE.60.2721): P(W)/P_reverse(−W) = exp((W − ΔF)/k_BT). Both hold for tracks that begin in
equilibrium. A trap that only moves has ΔF = 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.analysis.estimates import check_level, check_temperature
from otwarp.analysis.tracks import xarray
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN

FEWEST = 10
"""Tracks that averages over tracks need."""

RESAMPLES = 2000
"""Of the bootstrap."""

RARE = 0.2
"""Largest share of one track in an exponential average whose lower end is still known.

Above it, tracks that were too rare to be seen may carry the average. With it, 95 % intervals of 50 to 100 tracks that
dissipate 0.6 to 4 k_BT held the truth in 84 to 92 % of simulated cases; without it, about half as often.
"""

STEADY = 1e-5
"""Relative change of a trap's power that is rounding."""


def work(trajectory: Any) -> Any:
    """Work that moving the traps has done on the bead by the end, for each world.

    The integral is a sum of trapezoids over the frames, which must be much shorter than the relaxation time: the mean
    is low or high by a share of order (interval/relaxation time)².

    Args:
        trajectory: Dataset as of `load_trajectory`.

    Returns:
        DataArray over world [pN·µm].

    Raises:
        InputError: Nothing holds the bead, its traps do not move, or their power changes, which does work too.
    """
    if "work" not in trajectory:
        raise InputError(f"body {trajectory.attrs.get('body', '')}: no trap holds it; allowed: one that a trap holds")
    power = trajectory["trap_power"].values
    if np.ptp(power) > STEADY * np.max(np.abs(power)):
        raise InputError(
            "the power of the traps changes, which does work that is not recorded; allowed: constant power"
        )
    if not np.any(np.ptp(trajectory["trap_position"].values, axis=1)):
        raise InputError("the traps do not move, and do no work; allowed: a trap that moves")
    return trajectory["work"].isel(time=-1, drop=True)


def jarzynski(work: ArrayLike, *, temperature: float, level: float = 0.95, seed: int = 0) -> Any:
    """Free energy difference from the work of many tracks.

    Args:
        work: (n,) of each track [pN·µm].
        temperature: [K].
        level: Of the intervals.
        seed: Of the bootstrap.

    Returns:
        Dataset: `free_energy` by Jarzynski's equality, with _low and _high by the bootstrap (bias-corrected and
        accelerated), _low −inf where one track is more than `RARE` of the average; `rare`, that share (Gore, Ritort and
        Bustamante 2003, doi:10.1073/pnas.1635159100); `cumulant`, ⟨W⟩ − var(W)/2k_BT, exact for Gaussian work, and
        `mean_work`, with normal ends [pN·µm].

    Raises:
        InputError: Fewer than `FEWEST` tracks, or work that is not finite.
    """
    from scipy.special import logsumexp
    from scipy.stats import bootstrap

    quantile = check_level(level)
    check_temperature(temperature)
    w = _checked(work, "work") / (BOLTZMANN * temperature)

    def average(sample: np.ndarray, axis: int = -1) -> np.ndarray:
        return -np.asarray(logsumexp(-sample, axis=axis)) + math.log(sample.shape[axis])

    n, spread = len(w), float(np.var(w, ddof=1))
    random = np.random.Generator(np.random.Philox(seed))
    ends = bootstrap((w,), average, n_resamples=RESAMPLES, confidence_level=level, rng=random, batch=200)
    interval = ends.confidence_interval
    second = math.sqrt(spread / n + 0.5 * spread**2 / (n - 1))
    rare = float(np.exp(np.max(-w) - np.asarray(logsumexp(-w))))
    low = float(interval.low) if rare <= RARE else -math.inf
    rows = {
        "free_energy": (float(average(w)), low, float(interval.high)),
        "cumulant": _ends(float(w.mean()) - 0.5 * spread, quantile * second),
        "mean_work": _ends(float(w.mean()), quantile * math.sqrt(spread / n)),
    }
    out = _dataset(rows, BOLTZMANN * temperature, level)
    out["rare"] = rare
    return out


def crooks(forward: ArrayLike, reverse: ArrayLike, *, temperature: float, level: float = 0.95) -> Any:
    """Free energy difference from work there and back, and whether both agree with Crooks' theorem.

    ΔF is Bennett's acceptance ratio, the maximum likelihood estimate (Shirts et al. 2003,
    doi:10.1103/PhysRevLett.91.140601). The check fits log(P(W)/P_reverse(−W)) by a straight line of W/k_BT (logistic
    regression, as Shirts 2013, doi:10.1021/ct300688p): its slope is 1 if the theorem holds.

    Args:
        forward: (n,) work of tracks that go there [pN·µm].
        reverse: (m,) work of tracks that go the same way back, from equilibrium at the other end [pN·µm].
        temperature: [K].
        level: Of the intervals.

    Returns:
        Dataset: `free_energy` [pN·µm] and `slope`, each with _low and _high.

    Raises:
        InputError: Fewer than `FEWEST` tracks each way, work that is not finite, or none that overlaps.
    """
    from scipy.special import expit

    quantile = check_level(level)
    check_temperature(temperature)
    thermal = BOLTZMANN * temperature
    there, back = _checked(forward, "forward") / thermal, _checked(reverse, "reverse") / thermal
    w, came = np.append(there, -back), np.append(np.ones(len(there)), np.zeros(len(back)))
    if there.min() > -back.min() or there.max() < -back.max():
        raise InputError("work there and back does not overlap; allowed: slower motion, or more tracks")
    ratio = math.log(len(there) / len(back))
    centre = float(w.mean())
    one = np.ones_like(w)
    fixed, of_fixed = _logistic(one[:, None], w + ratio, came, np.array([-centre]), expit)
    both, of_both = _logistic(np.stack([w - centre, one], axis=1), ratio * one, came, np.array([1.0, 0.0]), expit)
    # of each stratum's mean, the sampling is stratified: n and m were not drawn (Shirts et al. 2003, eq. 10)
    variance = max(of_fixed[0, 0] - (1.0 / len(there) + 1.0 / len(back)), 0.0)
    rows = {"free_energy": _ends(-float(fixed[0]), quantile * math.sqrt(variance))}
    out = _dataset(rows, thermal, level)
    for suffix, value in zip(
        ("", "_low", "_high"), _ends(float(both[0]), quantile * math.sqrt(of_both[0, 0])), strict=True
    ):
        out[f"slope{suffix}"] = value
    return out


def _logistic(
    columns: np.ndarray, offset: np.ndarray, came: np.ndarray, start: np.ndarray, expit: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the log-odds of `came` and their covariance, by Newton's method."""
    theta = start
    for _ in range(100):
        p = expit(columns @ theta + offset)
        information = columns.T @ (columns * (p * (1.0 - p))[:, None])
        move = np.linalg.solve(information, columns.T @ (came - p))
        theta = theta + move * min(1.0, 2.0 / np.max(np.abs(move), initial=1e-300))
        if np.max(np.abs(move)) < 1e-10:
            break
    return theta, np.linalg.inv(information)


def _checked(work: ArrayLike, name: str) -> np.ndarray:
    w = np.asarray(work, dtype=float).ravel()
    if len(w) < FEWEST or not np.all(np.isfinite(w)):
        raise InputError(f"{name} is of {len(w)} tracks; allowed: {FEWEST} or more, all finite (worlds of a run)")
    return w


def _ends(value: float, reach: float) -> tuple[float, float, float]:
    return value, value - reach, value + reach


def _dataset(rows: dict[str, tuple[float, float, float]], thermal: float, level: float) -> Any:
    out = xarray().Dataset(attrs={"level": level})
    for name, values in rows.items():
        for suffix, value in zip(("", "_low", "_high"), values, strict=True):
            out[name + suffix] = ((), thermal * value, {"units": "pN um", "level": level})
    return out
