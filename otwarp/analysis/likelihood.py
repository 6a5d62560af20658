"""Maximum likelihood of a linear force field: the whole stiffness matrix, its part that does work on a closed path too.

FORMA (García et al. 2018, doi:10.1038/s41467-018-07437-x) is the linear regression of a bead's displacements on its
positions, the maximum likelihood estimate for F = −K·(x − x₀). There, displacement over time stands for velocity, which
is right for intervals far below the relaxation time. Here the regression x(t + Δ) = Φ·x(t) + c + noise is that of the
exact solution, Φ = e^(−KΔ/γ): the logarithm of the matrix removes the bias, whatever the interval. The drag follows
from the noise by the fluctuation–dissipation theorem. Estimates of Φ are biased, for positions are measured from their
own mean; the bias of order 1/n is known and taken off (Nicholls and Pope 1988,
doi:10.1111/j.1467-842X.1988.tb00504.x; Pope 1990, doi:10.1111/j.1467-9892.1990.tb00056.x).

Positions are taken as they are: noise and exposure of a detector bias this method; `fit_spectrum` allows for them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.analysis.estimates import check_level, check_temperature
from otwarp.analysis.spectrum import check_trapped
from otwarp.analysis.tracks import Tracks, tracks_of, xarray
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN


def forma(x: Any, *, temperature: float, drag: float | None = None, level: float = 0.95) -> Any:
    """Stiffness matrix, drag and centre of a trap, by maximum likelihood.

    Args:
        x: Track with the dimension `time`, of 1 to 3 axes [µm], as the bead moved.
        temperature: [K].
        drag: γ where it is known [pN·s/µm]; None takes it from the fluctuations along each axis.
        level: Of the intervals, by the delta method.

    Returns:
        Dataset: `stiffness` (row, column) of F = −K·(x − centre) [pN/µm], `drag` (axis) [pN·s/µm], `centre` (axis)
        [µm], each with _low and _high, and `circulation` (rotation): ½·(K_xy − K_yx) along z and so on, 0 for a force
        that has a potential. Positive, it drives the bead around that axis, from x to y around z.

    Raises:
        InputError: A track that is none or not trapped, or so slowly sampled that nothing is left of a position by
            the next sample.
    """
    quantile = check_level(level)
    check_temperature(temperature)
    tracks = tracks_of(x)
    x0, x1, centre = _pairs(tracks)
    n, axes = x0.shape
    gram = x0.T @ x0 / n
    slope = np.linalg.solve(gram, x0.T @ x1 / n).T
    rest = x1 - x0 @ slope.T
    noise = rest.T @ rest / (n - axes - 1)
    for axis in range(axes):
        check_trapped(float(-np.log(np.clip(np.diag(slope)[axis], 1e-13, None)) / tracks.interval), tracks, axis)
    error = np.kron(noise, np.linalg.inv(gram)) / n  # of the rows of Φ, one after the other
    if np.min(np.linalg.eigvals(slope).real) <= 3.0 * np.sqrt(np.max(np.diag(error))):
        raise InputError(
            f"track is sampled every {tracks.interval:.4g} s, so slowly that a sample says nothing about the next; "
            "allowed: shorter intervals, or a method that needs none: equipartition"
        )
    slope = slope + _bias(slope, noise, gram) / n
    values = _parameters(slope, noise, tracks.interval, temperature, drag)
    covariance = _delta(slope, noise, error, n, tracks.interval, temperature, drag)
    of_centre = np.linalg.solve(np.eye(axes) - slope, noise) @ np.linalg.inv(np.eye(axes) - slope).T / n
    return _labelled(tracks, values, covariance, centre, of_centre, quantile, level)


def _pairs(tracks: Tracks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, axes) centred samples, those after them, and the centre (axes,)."""
    values = np.moveaxis(tracks.values, 0, -1)
    x0, x1 = values[:, :-1].reshape(-1, values.shape[-1]), values[:, 1:].reshape(-1, values.shape[-1])
    return x0 - x0.mean(axis=0), x1 - x1.mean(axis=0), values.mean(axis=(0, 1))


def _bias(slope: np.ndarray, noise: np.ndarray, gram: np.ndarray) -> np.ndarray:
    """n times what least squares with an intercept lacks of Φ, to first order."""
    one = np.eye(len(slope))
    total = np.linalg.inv(one - slope.T) + slope.T @ np.linalg.inv(one - slope.T @ slope.T)
    for root in np.linalg.eigvals(slope):
        total = total + root * np.linalg.inv(one - root * slope.T)
    return np.real(noise @ total @ np.linalg.inv(gram))


def _parameters(
    slope: np.ndarray, noise: np.ndarray, interval: float, temperature: float, drag: float | None
) -> np.ndarray:
    """K (axes², by rows) and the drag along each axis."""
    from scipy.linalg import expm, logm

    axes = len(slope)
    a = -np.real(logm(slope)) / interval
    if drag is None:
        # noise = ∫₀^Δ e^(−As)·2D·e^(−Aᵀs) ds, linear in D, turned round by the Kronecker sum of A
        both = np.kron(a, np.eye(axes)) + np.kron(np.eye(axes), a)
        gathered = np.linalg.solve(both, np.eye(axes**2) - expm(-both * interval))
        diffusion = np.diag(np.linalg.solve(2.0 * gathered, noise.ravel()).reshape(axes, axes))
        gamma = BOLTZMANN * temperature / diffusion
    else:
        gamma = np.full(axes, drag)
    return np.append((gamma[:, None] * a).ravel(), gamma)


def _delta(
    slope: np.ndarray,
    noise: np.ndarray,
    error: np.ndarray,
    n: int,
    interval: float,
    temperature: float,
    drag: float | None,
) -> np.ndarray:
    """Covariance of `_parameters`, from those of Φ and of the noise (Wishart), which are independent."""
    axes = len(slope)
    upper = [(i, j) for i in range(axes) for j in range(i, axes)]
    wishart = np.array(
        [[(noise[i, k] * noise[j, m] + noise[i, m] * noise[j, k]) / n for k, m in upper] for i, j in upper]
    )
    columns = []
    h = 1e-5
    for index in range(axes**2):
        change = np.zeros(axes**2)
        change[index] = h
        change = change.reshape(axes, axes)
        ends = [_parameters(slope + s * change, noise, interval, temperature, drag) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2.0 * h))
    for i, j in upper:
        change = np.zeros((axes, axes))
        change[i, j] = change[j, i] = h * np.sqrt(noise[i, i] * noise[j, j])
        ends = [_parameters(slope, noise + s * change, interval, temperature, drag) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2.0 * change[i, j]))
    jacobian = np.stack(columns, axis=1)
    size = axes**2
    return jacobian[:, :size] @ error @ jacobian[:, :size].T + jacobian[:, size:] @ wishart @ jacobian[:, size:].T


def _labelled(
    tracks: Tracks,
    values: np.ndarray,
    covariance: np.ndarray,
    centre: np.ndarray,
    of_centre: np.ndarray,
    quantile: float,
    level: float,
) -> Any:
    axes = len(tracks.axes)
    out = xarray().Dataset(coords={"row": tracks.axes, "column": tracks.axes, "axis": tracks.axes})
    errors = np.sqrt(np.diag(covariance))

    def put(name: str, dims: Any, value: np.ndarray, error: np.ndarray, units: str) -> None:
        for suffix, sign in (("", 0.0), ("_low", -1.0), ("_high", 1.0)):
            out[name + suffix] = (dims, value + sign * quantile * error, {"units": units, "level": level})

    size = axes**2
    matrix = (axes, axes)
    put("stiffness", ("row", "column"), values[:size].reshape(matrix), errors[:size].reshape(matrix), "pN/um")
    put("drag", "axis", values[size:], errors[size:], "pN s/um")
    put("centre", "axis", centre, np.sqrt(np.diag(of_centre)), "um")
    turns = [("z", 0, 1), ("x", 1, 2), ("y", 2, 0)][: {1: 0, 2: 1, 3: 3}[axes]]
    if turns:
        out = out.assign_coords(rotation=[name for name, _, _ in turns])
        weights = np.zeros((len(turns), len(values)))
        for n, (_, i, j) in enumerate(turns):
            weights[n, i * axes + j], weights[n, j * axes + i] = 0.5, -0.5
        spread = np.sqrt(np.diag(weights @ covariance @ weights.T))
        put("circulation", "rotation", weights @ values, spread, "pN/um")
    out.attrs = {"method": "FORMA", "level": level}
    return out
