"""Two touching spheres by a T-matrix code of others: `benchmarks/peers/treams_pair.py` prints these numbers."""

from __future__ import annotations

WAVELENGTH, MEDIUM, RADIUS, INDEX = 0.55, 1.33, 0.35, 1.55
"""Of light in vacuum [µm], of the medium, of each sphere [µm] and its index."""

EXTINCTION = {(0.0, 0.0, 1.0): 1.741182, (1.0, 0.0, 1.0): 1.106074, (1.0, 0.0, 0.0): 1.074519}
"""Direction from sphere to sphere → cross section in light along z that is not polarised [µm²], by treams 0.4.7, orders
up to 12; up to 10 it differs by less than 2e-5."""

ANGLES = ((20.0, 40.0), (50.0, 40.0), (110.0, 40.0), (50.0, 250.0))
"""Polar angle from the light's way and azimuth of directions [deg]."""

DIFFERENTIAL = {
    (0.0, 0.0, 1.0): (1.683269, 4.581655e-3, 2.346087e-4, 4.581655e-3),
    (1.0, 0.0, 1.0): (0.8244186, 3.490732e-2, 1.929300e-3, 7.005920e-3),
    (1.0, 0.0, 0.0): (5.687078e-2, 2.332585e-2, 1.915600e-3, 1.280420e-3),
}
"""Light scattered in these directions [µm²/sr], likewise; up to order 10 it differs by up to 3e-4."""
