"""Axial and radial force curves of a trap, and their picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from otwarp.optics.analysis import TrapProperties, trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.exact import force
from otwarp.optics.mie import Sphere


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Force along the axis and across it, at the beam's power.

    Attributes:
        beam, sphere: What was evaluated.
        properties: Equilibrium, stiffness, escape force, depth.
        distance: (n,) µm, from −reach to reach.
        axial: (n,) F_z at (0, 0, distance) from the focus [pN].
        radial_x, radial_y: (n,) F_x and F_y at that distance from the equilibrium along x and y [pN].
    """

    beam: Beam
    sphere: Sphere
    properties: TrapProperties
    distance: np.ndarray
    axial: np.ndarray
    radial_x: np.ndarray
    radial_y: np.ndarray


def force_curves(beam: Beam, sphere: Sphere, *, reach: float | None = None, samples: int = 161) -> Curves:
    """Evaluate the three scans; `reach` [µm] defaults to one and a half radii plus two wavelengths."""
    properties = trap_properties(beam, sphere)
    d = np.linspace(-1.0, 1.0, samples) * (reach or 1.5 * sphere.radius + 2.0 * beam.wavelength)
    zero, height = np.zeros_like(d), np.full_like(d, properties.equilibrium)
    scans = [np.stack(p, axis=1) for p in ((zero, zero, d), (d, zero, height), (zero, d, height))]
    f = [beam.force_scale * force(beam, sphere, p) for p in scans]
    return Curves(
        beam=beam,
        sphere=sphere,
        properties=properties,
        distance=d,
        axial=f[0][:, 2],
        radial_x=f[1][:, 0],
        radial_y=f[2][:, 1],
    )


def plot_curves(curves: Curves, path: Path) -> None:
    """Draw the curves with the equilibrium and the linear law of its stiffness."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    c, p = curves, curves.properties
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    left.plot(c.distance, c.axial, color="#a8325e", lw=1.8)
    left.plot(p.equilibrium, 0.0, "o", color="#20304a", ms=5, label=f"equilibrium {p.equilibrium:.3f} µm")
    right.plot(c.distance, c.radial_x, color="#1f5fa8", lw=1.8, label="along x")
    right.plot(c.distance, c.radial_y, color="#d9822b", lw=1.8, ls="--", label="along y")
    for axes, k, centre, curve in (
        (left, p.stiffness[2], p.equilibrium, c.axial),
        (right, p.stiffness[0], 0.0, c.radial_x),
    ):
        low, high = 1.15 * curve.min(), 1.15 * curve.max()
        axes.plot(c.distance, -k * (c.distance - centre), color="#9aa3b2", lw=1.0, label=f"stiffness {k:.3g} pN/µm")
        axes.axhline(0.0, color="#c8ced8", lw=0.8, zorder=0)
        axes.set_ylim(low, high)
        axes.legend(frameon=False, fontsize=8)
    left.set(xlabel="z from the focus (µm)", ylabel="axial force (pN)")
    right.set(xlabel="distance from the equilibrium (µm)", ylabel="radial force (pN)")
    figure.suptitle(
        f"r = {c.sphere.radius:g} µm, n = {c.sphere.index}, NA {c.beam.numerical_aperture:g}, {c.beam.power:g} mW",
        fontsize=10,
    )
    part = path.with_name(f".{path.name}.part")
    figure.savefig(part, dpi=160, format="png")
    plt.close(figure)
    part.replace(path)
