"""Piecewise and harmonic fits of exact force curves: the paper's eq. 1, with its errors.

F(d) = K·d for d < δ, A/d² + C for δ ≤ d < D, 0 beyond, against the restoring force at distance d from the equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.optics.analysis import trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.exact import force
from otwarp.optics.mie import Sphere

SAMPLES = 160
"""Points per curve."""

REFINED = 1e-4
"""Spacing [µm] to which the search for δ and D is refined."""


@dataclass(frozen=True, kw_only=True)
class PiecewiseLaw:
    """Constants of the law at the beam's power: K [pN/µm], δ [µm], A [pN·µm²], C [pN], D [µm]; inf where unused."""

    stiffness: float
    threshold: float = float("inf")
    inverse_square: float = 0.0
    offset: float = 0.0
    cutoff: float = float("inf")


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """A fitted curve and how well it fits, at the beam's power.

    Attributes:
        name: `radial`, `axial` (the weaker side, on which the sphere leaves) or `isotropic`.
        law: The constants.
        mse, rmse: Of the residual in Q², Q.
        r_squared: Coefficient of determination.
        worst: Largest residual in Q; `worst_at` its distance [µm].
        jump: Discontinuity of the fitted force at δ [pN], 0 for a continuous fit.
    """

    name: str
    law: PiecewiseLaw
    mse: float
    rmse: float
    r_squared: float
    worst: float
    worst_at: float
    jump: float


def sample_curves(beam: Beam, sphere: Sphere) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Distance from the equilibrium [µm] and restoring force [Q]: `radial` (x and y), `downstream` and `upstream`."""
    stable = trap_properties(beam, sphere).equilibrium
    d = np.linspace(0.0, 1.5 * sphere.radius + 2.0 * beam.wavelength, SAMPLES)
    ways = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "downstream": (0.0, 0.0, 1.0), "upstream": (0.0, 0.0, -1.0)}
    pulls = {
        name: -force(beam, sphere, np.array([0.0, 0.0, stable]) + d[:, None] * np.array(way)) @ np.array(way)
        for name, way in ways.items()
    }
    return {
        "radial": (np.concatenate([d, d]), np.concatenate([pulls["x"], pulls["y"]])),
        "downstream": (d, pulls["downstream"]),
        "upstream": (d, pulls["upstream"]),
    }


def _basis(d: np.ndarray, threshold: float, cutoff: float, continuous: bool) -> np.ndarray:
    """(n, 1 or 3) functions whose combination is the law with these two distances."""
    safe = np.maximum(d, 1e-9)
    inner, outer = d < threshold, (d >= threshold) & (d < cutoff)
    if continuous:
        branch = threshold * (1.0 / safe**2 - 1.0 / cutoff**2) / (1.0 / threshold**2 - 1.0 / cutoff**2)
        return (np.where(inner, d, 0.0) + np.where(outer, branch, 0.0))[:, None]
    return np.stack([np.where(inner, d, 0.0), np.where(outer, 1.0 / safe**2, 0.0), outer.astype(float)], axis=1)


def _solve(d: np.ndarray, q: np.ndarray, threshold: float, cutoff: float, continuous: bool) -> tuple[float, np.ndarray]:
    basis = _basis(d, threshold, cutoff, continuous)
    coefficients = np.linalg.lstsq(basis, q, rcond=None)[0]
    return float(np.sum((q - basis @ coefficients) ** 2)), coefficients


def fit_curve(name: str, d: np.ndarray, q: np.ndarray, beam: Beam, *, continuous: bool) -> CurveFit:
    """Least-squares piecewise fit of one curve; δ and D by a grid search refined to `REFINED`, the rest linear."""
    top = float(d.max())
    low = np.linspace(0.05, 0.95, 25) * top
    high = np.linspace(0.1, 1.6, 31) * top
    while True:
        gap = 0.02 * top
        _, t, c = min((_solve(d, q, t, c, continuous)[0], t, c) for t in low for c in high if c > t + gap)
        dt, dc = low[1] - low[0], high[1] - high[0]
        if max(dt, dc) < REFINED * max(1.0, top):
            break
        low, high = np.linspace(max(t - dt, 0.01 * top), t + dt, 9), np.linspace(c - dc, c + dc, 9)
    _, found = _solve(d, q, t, c, continuous)
    residual = q - _basis(d, t, c, continuous) @ found
    scale = beam.force_scale
    k = float(found[0]) * scale
    if continuous:
        a = k * t / (1.0 / t**2 - 1.0 / c**2)
        offset = -a / c**2
    else:
        a, offset = float(found[1]) * scale, float(found[2]) * scale
    law = PiecewiseLaw(stiffness=k, threshold=float(t), inverse_square=float(a), offset=float(offset), cutoff=float(c))
    return _report(name, law, d, q, residual, 0.0 if continuous else a / t**2 + offset - k * t)


def _report(name: str, law: PiecewiseLaw, d: np.ndarray, q: np.ndarray, residual: np.ndarray, jump: float) -> CurveFit:
    mse = float(np.mean(residual**2))
    worst = int(np.argmax(np.abs(residual)))
    return CurveFit(
        name=name,
        law=law,
        mse=mse,
        rmse=mse**0.5,
        r_squared=float(1.0 - np.sum(residual**2) / np.sum((q - q.mean()) ** 2)),
        worst=float(abs(residual[worst])),
        worst_at=float(d[worst]),
        jump=float(jump),
    )


def fit_piecewise(beam: Beam, sphere: Sphere, *, continuous: bool = True) -> dict[str, CurveFit]:
    """The paper's law as separate `radial` and `axial` curves and as one `isotropic` curve.

    The axial curve is fitted on the side with the smaller largest pull, on which the sphere is lost; the isotropic one
    to both together.

    Args:
        continuous: Join the branches at δ and end at zero at D (three free constants), or fit all five freely.
    """
    curves = sample_curves(beam, sphere)
    weak = min(("downstream", "upstream"), key=lambda side: curves[side][1].max())
    both = tuple(np.concatenate([a, b]) for a, b in zip(curves["radial"], curves[weak], strict=True))
    chosen = {"radial": curves["radial"], "axial": curves[weak], "isotropic": both}
    return {name: fit_curve(name, d, q, beam, continuous=continuous) for name, (d, q) in chosen.items()}


def fit_harmonic(beam: Beam, sphere: Sphere, *, reach: float | None = None) -> dict[str, CurveFit]:
    """Straight lines through the equilibrium, least squares over `reach` [µm] (default half a radius)."""
    curves = sample_curves(beam, sphere)
    out = {}
    for name, source in (("radial", "radial"), ("axial", "downstream")):
        d, q = curves[source]
        near = d <= (reach or 0.5 * sphere.radius)
        d, q = d[near], q[near]
        slope = float(d @ q / (d @ d))
        law = PiecewiseLaw(stiffness=slope * beam.force_scale)
        out[name] = _report(name, law, d, q, q - slope * d, 0.0)
    return out
