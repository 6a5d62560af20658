"""Piecewise and harmonic fits of exact force curves: the paper's eq. 1, with its errors.

F(d) = K·d for d < δ, A/d² + C for δ ≤ d < D, 0 beyond, against the restoring force at distance d from the equilibrium.
Every error is taken over the whole trap region (`trap_region`), so that those of different laws can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.optics.analysis import trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.field import force
from otwarp.optics.mie import Particle

SAMPLES = 160
"""Points per curve."""

REFINED = 1e-4
"""Spacing [µm] to which the search for δ and D is refined."""


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """A fitted curve and how well it fits, at the beam's power.

    Attributes:
        name: `radial`, `axial` or `isotropic`.
        law: The constants.
        fitted: Distance from the equilibrium up to which the law was fitted [µm].
        region: Distance up to which the errors were taken: the trap region [µm].
        mse, rmse: Of the residual in Q², Q.
        r_squared: Coefficient of determination.
        worst: Largest residual in Q; `worst_at` its distance [µm].
        jump: Discontinuity of the fitted force at δ [pN], 0 for a continuous fit.
    """

    name: str
    law: TrapLaw
    fitted: float
    region: float
    mse: float
    rmse: float
    r_squared: float
    worst: float
    worst_at: float
    jump: float


def pull(law: TrapLaw, distance: np.ndarray) -> np.ndarray:
    """Restoring force of a law at its power [pN] at these distances from the equilibrium [µm], of the same shape."""
    d = np.asarray(distance, dtype=float)
    outer = law.inverse_square / np.maximum(d, 1e-9) ** 2 + law.offset
    return np.where(d < law.cutoff, np.where(d < law.threshold, law.stiffness * d, outer), 0.0)


ForceCurves = dict[str, tuple[np.ndarray, np.ndarray]]
"""Distance from the equilibrium [µm] and restoring force [Q] by direction."""


def trap_region(beam: Beam, sphere: Particle) -> float:
    """Distance from the equilibrium [µm] over which curves are fitted, drawn and judged: 1.5 r + 2 λ.

    With the radius r of `sphere` and the vacuum wavelength λ of `beam`, both in µm: the pull of a large sphere is
    strongest when the light meets its rim, that of a small one within a wavelength.
    """
    return 1.5 * sphere.radius + 2.0 * beam.wavelength


def sample_curves(beam: Beam, sphere: Particle, *, device: str | None = None) -> ForceCurves:
    """Exact curves over the trap region: `radial` (x, then y), `downstream` and `upstream`.

    Raises:
        InputError: The beam does not hold this sphere.
    """
    stable = trap_properties(beam, sphere).equilibrium
    d = np.linspace(0.0, trap_region(beam, sphere), SAMPLES)
    ways = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    points = np.array([0.0, 0.0, stable]) + d[None, :, None] * ways[:, None, :]
    q = force(beam, sphere, points.reshape(-1, 3), device=device).reshape(points.shape)
    along_x, along_y, downstream, upstream = -np.einsum("wnc,wc->wn", q, ways)
    return {
        "radial": (np.concatenate([d, d]), np.concatenate([along_x, along_y])),
        "downstream": (d, downstream),
        "upstream": (d, upstream),
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
    scale = beam.force_scale
    k = float(found[0]) * scale
    if continuous:
        a = k * t / (1.0 / t**2 - 1.0 / c**2)
        offset = -a / c**2
    else:
        a, offset = float(found[1]) * scale, float(found[2]) * scale
    law = TrapLaw(
        stiffness=k,
        threshold=float(t),
        inverse_square=float(a),
        offset=float(offset),
        cutoff=float(c),
        power=beam.power,
    )
    residual = q - _basis(d, t, c, continuous) @ found
    jump = 0.0 if continuous else a / t**2 + offset - k * t
    return _report(name, law, d, q, residual, fitted=float(d.max()), jump=jump)


def _report(
    name: str, law: TrapLaw, d: np.ndarray, q: np.ndarray, residual: np.ndarray, *, fitted: float, jump: float
) -> CurveFit:
    mse = float(np.mean(residual**2))
    worst = int(np.argmax(np.abs(residual)))
    return CurveFit(
        name=name,
        law=law,
        fitted=fitted,
        region=float(d.max()),
        mse=mse,
        rmse=mse**0.5,
        r_squared=float(1.0 - np.sum(residual**2) / np.sum((q - q.mean()) ** 2)),
        worst=float(abs(residual[worst])),
        worst_at=float(d[worst]),
        jump=float(jump),
    )


def weak_side(curves: ForceCurves) -> str:
    """`downstream` or `upstream`: the side with the smaller largest pull, on which the sphere is lost."""
    return min(("downstream", "upstream"), key=lambda side: float(curves[side][1].max()))


def fit_piecewise(
    beam: Beam, sphere: Particle, *, continuous: bool = True, curves: ForceCurves | None = None
) -> dict[str, CurveFit]:
    """The paper's law as separate `radial` and `axial` curves and as one `isotropic` curve.

    The axial curve is fitted on the weak side (`weak_side`); the isotropic one to it and the radial one together.

    Args:
        continuous: Join the branches at δ and end at zero at D (three free constants), or fit all five freely.
        curves: What `sample_curves` gave for this beam and sphere, if it is at hand.

    Raises:
        InputError: The beam does not hold this sphere.
    """
    curves = curves or sample_curves(beam, sphere)
    axial = curves[weak_side(curves)]
    both = tuple(np.concatenate([a, b]) for a, b in zip(curves["radial"], axial, strict=True))
    chosen = {"radial": curves["radial"], "axial": axial, "isotropic": both}
    return {name: fit_curve(name, d, q, beam, continuous=continuous) for name, (d, q) in chosen.items()}


def fit_harmonic(
    beam: Beam, sphere: Particle, *, reach: float | None = None, curves: ForceCurves | None = None
) -> dict[str, CurveFit]:
    """Straight lines through the equilibrium, least squares; the axial one through both sides.

    Args:
        reach: Fit up to this distance [µm]; default half a radius. The errors are still those over the trap region.
        curves: What `sample_curves` gave for this beam and sphere, if it is at hand.

    Raises:
        InputError: The beam does not hold this sphere, or a reach that holds no sample.
    """
    curves = curves or sample_curves(beam, sphere)
    down, up = curves["downstream"], curves["upstream"]
    axial = np.concatenate([down[0], up[0]]), np.concatenate([down[1], up[1]])
    # a small sphere's half radius may hold no sample beyond the equilibrium itself
    span = reach if reach is not None else max(0.5 * sphere.radius, 3.0 * float(down[0][1]))
    if not span >= down[0][1]:
        raise InputError(f"reach of the harmonic fit is {span:g} µm; allowed: {float(down[0][1]):.3g} µm or more")
    out = {}
    for name, (d, q) in (("radial", curves["radial"]), ("axial", axial)):
        near = d <= span
        slope = float(d[near] @ q[near] / (d[near] @ d[near]))
        law = TrapLaw(stiffness=slope * beam.force_scale, power=beam.power)
        out[name] = _report(name, law, d, q, q - slope * d, fitted=float(d[near].max()), jump=0.0)
    return out
