"""Exact tracks of a bead in a linear force field: what is needed to know how well a calibration does."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.analysis.tracks import track
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN


def harmonic_tracks(
    stiffness: ArrayLike,
    drag: float,
    interval: float,
    samples: int,
    *,
    tracks: int = 1,
    temperature: float = 298.15,
    seed: int = 0,
) -> Any:
    """Tracks of F = −K·x with the statistics of the equation of motion itself, whatever the interval.

    x(t + Δ) = e^(−KΔ/γ)·x(t) + noise whose covariance solves the Lyapunov equation; the first sample is drawn from the
    stationary state.

    Args:
        stiffness: (axes,) of each axis, or K (axes, axes), which need not be symmetric [pN/µm]; stable.
        drag: γ [pN·s/µm].
        interval: Δ between samples [s].
        samples: Per track.
        tracks: How many.
        temperature: [K].
        seed: Key of the noise.

    Returns:
        DataArray (world, time, axis) [µm].

    Raises:
        InputError: A stiffness that does not hold the bead.
    """
    from scipy.linalg import expm, solve_continuous_lyapunov

    k = np.atleast_1d(np.asarray(stiffness, dtype=float))
    k = np.diag(k) if k.ndim == 1 else k
    if np.min(np.linalg.eigvals(k).real) <= 0.0:
        raise InputError(f"stiffness = {np.asarray(stiffness).tolist()}; allowed: one that holds the bead")
    axes = len(k)
    stationary = solve_continuous_lyapunov(k / drag, 2.0 * BOLTZMANN * temperature / drag * np.eye(axes))
    step = expm(-k * interval / drag)
    kick = np.linalg.cholesky(stationary - step @ stationary @ step.T)
    random = np.random.Generator(np.random.Philox(seed))
    out = random.standard_normal((samples, tracks, axes))
    out[0] = out[0] @ np.linalg.cholesky(stationary).T
    out[1:] = out[1:] @ kick.T
    if np.array_equal(step, np.diag(np.diag(step))):
        from scipy.signal import lfilter

        for n in range(axes):
            out[:, :, n] = lfilter([1.0], [1.0, -step[n, n]], out[:, :, n], axis=0)
    else:
        for n in range(1, samples):
            out[n] += out[n - 1] @ step.T
    return track(np.moveaxis(out, 1, 0), interval)
