"""Two touching spheres by treams, a T-matrix code of its own: the numbers of `tests/reference/pairs.py`.

treams 0.4.7 needs SciPy below 1.15, so that it does not install beside otwarp; in an environment of its own

    pip install treams==0.4.7 'scipy<1.15' 'numpy<2.3'
    python benchmarks/peers/treams_pair.py

takes some 40 seconds (Beutel, Fernandez-Corbaton and Rockstuhl 2024, doi:10.1016/j.cpc.2023.109076).
"""

from __future__ import annotations

import math

import numpy as np

WAVELENGTH, MEDIUM, RADIUS, INDEX = 0.55, 1.33, 0.35, 1.55
LEANS = {"along z": (0.0, 0.0, 1.0), "tilted by 45°": (1.0, 0.0, 1.0), "side by side": (1.0, 0.0, 0.0)}


ANGLES = ((20.0, 40.0), (50.0, 40.0), (110.0, 40.0), (50.0, 250.0))
"""Polar angle from the light's way and azimuth of directions [deg]."""

FAR = 1e5
"""Where light counts as gone far [µm]."""


def scattered(along: tuple[float, float, float], highest: int) -> tuple[float, list[float]]:
    """Of a pair in light along z that is not polarised, with orders up to `highest`.

    Returns:
        Extinction cross section [µm²], and per direction of `ANGLES` the differential one of scattering [µm²/sr].
    """
    import treams

    k = 2.0 * math.pi / WAVELENGTH
    medium, glass = treams.Material(MEDIUM**2), treams.Material(INDEX**2)
    step = RADIUS * np.array(along) / np.linalg.norm(along)
    spheres = [treams.TMatrix.sphere(highest, k, RADIUS, [glass, medium]) for _ in range(2)]
    pair = treams.TMatrix.cluster(spheres, np.array([step, -step])).interaction.solve()
    waves = [treams.plane_wave([0.0, 0.0, k * MEDIUM], p, k0=k, material=medium) for p in (0, 1)]
    extinction = float(np.mean([pair.xs(wave)[1] for wave in waves]))
    theta, phi = np.radians(ANGLES).T
    places = FAR * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    fields = np.array([[(pair @ wave.expand(pair.basis)).efield(place) for place in places] for wave in waves])
    strength = np.sum(np.abs(fields.reshape(2, len(places), 3)) ** 2, axis=-1).mean(axis=0) * FAR**2
    return extinction, strength.tolist()


if __name__ == "__main__":
    for name, along in LEANS.items():
        for highest in (8, 10, 12):
            extinction, differential = scattered(along, highest)
            print(name, highest, f"{extinction:.6f}", *(f"{value:.6e}" for value in differential))
