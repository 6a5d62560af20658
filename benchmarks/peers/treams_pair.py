"""Extinction of two touching spheres by treams, a T-matrix code of its own: the numbers of `tests/reference/pairs.py`.

treams 0.4.7 needs SciPy below 1.15, so that it does not install beside otwarp; in an environment of its own

    pip install treams==0.4.7 'scipy<1.15' 'numpy<2.3'
    python benchmarks/peers/treams_pair.py

takes some 20 seconds (Beutel, Fernandez-Corbaton and Rockstuhl 2024, doi:10.1016/j.cpc.2023.109076).
"""

from __future__ import annotations

import math

import numpy as np

WAVELENGTH, MEDIUM, RADIUS, INDEX = 0.55, 1.33, 0.35, 1.55
LEANS = {"along z": (0.0, 0.0, 1.0), "tilted by 45°": (1.0, 0.0, 1.0), "side by side": (1.0, 0.0, 0.0)}


def cross_section(along: tuple[float, float, float], highest: int) -> float:
    """Extinction cross section of a pair in light along z that is not polarised [µm²], of orders up to `highest`."""
    import treams

    k = 2.0 * math.pi / WAVELENGTH
    medium, glass = treams.Material(MEDIUM**2), treams.Material(INDEX**2)
    step = RADIUS * np.array(along) / np.linalg.norm(along)
    spheres = [treams.TMatrix.sphere(highest, k, RADIUS, [glass, medium]) for _ in range(2)]
    pair = treams.TMatrix.cluster(spheres, np.array([step, -step])).interaction.solve()
    waves = [treams.plane_wave([0.0, 0.0, k * MEDIUM], p, k0=k, material=medium) for p in (0, 1)]
    return float(np.mean([pair.xs(wave)[1] for wave in waves]))


if __name__ == "__main__":
    for name, along in LEANS.items():
        print(name, *(f"{cross_section(along, highest):.6f}" for highest in (8, 10, 12)))
