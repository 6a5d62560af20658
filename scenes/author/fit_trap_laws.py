"""Fit the piecewise trap law to exact optical forces, and print what `trap_laws.py` holds.

    python -m scenes.author.fit_trap_laws FOLDER

FOLDER holds `<CASE>_radial_x.csv`, `_radial_y.csv` and `_axial.csv` of the Optical Tweezers Toolbox (Nieminen et al.
2007, J. Opt. A 9 S196, doi:10.1088/1464-4258/9/8/S12) for a sphere of radius 2.5 µm and index 1.52 in water
(n = 1.33), wavelength 1.064 µm, NA 1.25, circular polarization: columns x_um, y_um, z_um (sphere centre relative to
the focus) and the force efficiencies Qx, Qy, Qz.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.units import FORCE_PER_POWER

CASE = "c4_polymer_r2.5_NA1.25_circ"
MEDIUM_INDEX = 1.33


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A fitted law at 1 mW and how well it fits.

    Attributes:
        stiffness, threshold, inverse_square, offset, cutoff: The law's constants [pN/µm, µm, pN·µm², pN, µm].
        errors: Standard errors of the three free parameters (stiffness, threshold, cutoff).
        rmse: Root mean square residual [pN].
        r_squared: Coefficient of determination [1].
        slope: Slope of the samples at the equilibrium [pN/µm], which the one straight branch need not meet.
        peak: Largest sampled force [pN].
        samples: Number of samples.
    """

    stiffness: float
    threshold: float
    inverse_square: float
    offset: float
    cutoff: float
    errors: tuple[float, float, float]
    rmse: float
    r_squared: float
    slope: float
    peak: float
    samples: int


def shape(distance: np.ndarray, threshold: float, cutoff: float) -> np.ndarray:
    """The law at unit stiffness [µm], continuous at the threshold and zero at the cutoff.

    d below the threshold δ, δ·(1/d² − 1/D²)/(1/δ² − 1/D²) up to the cutoff D, 0 beyond.
    """
    d = np.maximum(distance, 1e-9)
    branch = threshold * (1 / d**2 - 1 / cutoff**2) / (1 / threshold**2 - 1 / cutoff**2)
    return np.where(d < threshold, d, np.where(d < cutoff, branch, 0.0))


def fit_law(distance: np.ndarray, force: np.ndarray) -> Fit:
    """Least-squares fit of the piecewise law, continuous at its threshold and at its cutoff.

    Continuity leaves three free parameters: stiffness, threshold and cutoff. The stiffness enters linearly, the other
    two are searched on a grid that is refined until its spacing is below 1e-4 µm.

    Args:
        distance: (n,) distances from the equilibrium [µm], ≥ 0.
        force: (n,) restoring forces [pN].

    Returns:
        The law and its errors.
    """

    def stiffness(threshold: float, cutoff: float) -> float:
        g = shape(distance, threshold, cutoff)
        return float(g @ force / (g @ g))

    def loss(threshold: float, cutoff: float) -> float:
        g = shape(distance, threshold, cutoff)
        return float(np.sum((force - (g @ force / (g @ g)) * g) ** 2))

    thresholds, cutoffs = np.linspace(0.5, 4.0, 71), np.linspace(1.0, 8.0, 141)
    while True:
        _, t, c = min((loss(t, c), t, c) for t in thresholds for c in cutoffs if c > t + 0.05)
        dt, dc = thresholds[1] - thresholds[0], cutoffs[1] - cutoffs[0]
        if max(dt, dc) < 1e-4:
            break
        thresholds, cutoffs = np.linspace(t - dt, t + dt, 21), np.linspace(c - dc, c + dc, 21)
    k = stiffness(t, c)
    residual = force - k * shape(distance, t, c)
    inverse_square = k * t / (1 / t**2 - 1 / c**2)
    near = distance <= 0.5
    return Fit(
        stiffness=k,
        threshold=float(t),
        inverse_square=float(inverse_square),
        offset=float(-inverse_square / c**2),
        cutoff=float(c),
        errors=_standard_errors(distance, residual, np.array([k, t, c])),
        rmse=float(np.sqrt(np.mean(residual**2))),
        r_squared=float(1 - np.sum(residual**2) / np.sum((force - force.mean()) ** 2)),
        slope=float(distance[near] @ force[near] / (distance[near] @ distance[near])),
        peak=float(force.max()),
        samples=len(distance),
    )


def _standard_errors(distance: np.ndarray, residual: np.ndarray, parameters: np.ndarray) -> tuple[float, float, float]:
    """Square roots of the diagonal of s²(JᵀJ)⁻¹ with a central-difference Jacobian."""

    def law(p: np.ndarray) -> np.ndarray:
        return p[0] * shape(distance, p[1], p[2])

    steps = 0.02 * np.eye(3)
    jacobian = np.stack([(law(parameters + h) - law(parameters - h)) / 0.04 for h in steps], axis=1)
    variance = residual @ residual / (len(residual) - 3)
    a, b, c = np.sqrt(np.diag(variance * np.linalg.inv(jacobian.T @ jacobian)))
    return float(a), float(b), float(c)


def read_curves(folder: Path) -> tuple[float, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Read the three scans as restoring force against distance from the stable equilibrium.

    Args:
        folder: Where the CSV files are.

    Returns:
        The height of the stable equilibrium above the focus [µm], and name → (distance [µm], restoring force [pN at
        1 mW]) for `radial` (both axes, both signs), `downstream` (the side on which the sphere leaves along the beam)
        and `upstream`.

    Raises:
        InputError: A file is missing.
    """
    scans = {}
    for name in ("radial_x", "radial_y", "axial"):
        file = folder / f"{CASE}_{name}.csv"
        if not file.is_file():
            raise InputError(f"{file}: no such file; FOLDER must hold {CASE}_{{radial_x,radial_y,axial}}.csv")
        scans[name] = np.genfromtxt(file, delimiter=",", names=True)
    per_q = FORCE_PER_POWER * MEDIUM_INDEX
    equilibrium = float(scans["radial_x"]["z_um"][0])
    x, y = scans["radial_x"], scans["radial_y"]
    radial = np.concatenate([x["x_um"], y["y_um"]])
    radial_force = -np.sign(radial) * per_q * np.concatenate([x["Qx"], y["Qy"]])
    z = scans["axial"]["z_um"] - equilibrium
    axial_force = -np.sign(z) * per_q * scans["axial"]["Qz"]
    return equilibrium, {
        "radial": (np.abs(radial), radial_force),
        "downstream": (z[z > 0], axial_force[z > 0]),
        "upstream": (-z[z < 0], axial_force[z < 0]),
    }


def fit_folder(folder: Path) -> tuple[float, dict[str, Fit]]:
    """Fit the radial, axial and isotropic laws of the CSV files in `folder`.

    The axial law is fitted downstream, where the restoring force is the weaker and the sphere escapes. The isotropic
    law is fitted to radial and downstream samples together; each curve has the weight of its samples along one half
    line, so the radial scan (two axes, two signs) counts once, not four times.

    Returns:
        The height of the equilibrium above the focus [µm], and name → fit.
    """
    equilibrium, curves = read_curves(folder)
    radial, axial = curves["radial"], curves["downstream"]
    half_line = len(radial[0]) // 4
    pooled = [np.concatenate([r[:half_line], a]) for r, a in zip(radial, axial, strict=True)]
    return equilibrium, {"RADIAL": fit_law(*radial), "AXIAL": fit_law(*axial), "ISOTROPIC": fit_law(*pooled)}


def main(argv: list[str]) -> None:
    """Print the fitted constants."""
    if len(argv) != 1:
        raise SystemExit(f"usage: python -m scenes.author.fit_trap_laws FOLDER (holding {CASE}_*.csv)")
    folder = Path(argv[0])
    equilibrium, fits = fit_folder(folder)
    _, curves = read_curves(folder)
    print(f"EQUILIBRIUM = {equilibrium:.4f}")
    for name, fit in fits.items():
        k, t, c = fit.errors
        print(f"{name} = continuous_law({fit.stiffness:.4f}, {fit.threshold:.4f}, {fit.cutoff:.4f})")
        print(
            f"  standard errors {k:.4f} pN/µm, {t:.4f} µm, {c:.4f} µm; RMSE {fit.rmse:.4f} pN, R² {fit.r_squared:.4f}"
        )
        print(f"  samples {fit.samples}: slope at 0 {fit.slope:.4f} pN/µm, peak {fit.peak:.4f} pN", end="")
        print(f"; law: A {fit.inverse_square:.4f}, C {fit.offset:.4f}, peak {fit.stiffness * fit.threshold:.4f} pN")
    peaks = [f"{side} {curves[side][1].max():.4f} pN" for side in ("downstream", "upstream")]
    print("axial restoring peaks of the samples: " + ", ".join(peaks))


if __name__ == "__main__":
    main(sys.argv[1:])
