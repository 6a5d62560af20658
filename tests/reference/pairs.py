"""Two touching spheres by a T-matrix code of others: `benchmarks/peers/treams_pair.py` prints these numbers."""

from __future__ import annotations

WAVELENGTH, MEDIUM, RADIUS, INDEX = 0.55, 1.33, 0.35, 1.55
"""Of light in vacuum [µm], of the medium, of each sphere [µm] and its index."""

EXTINCTION = {(0.0, 0.0, 1.0): 1.741182, (1.0, 0.0, 1.0): 1.106074, (1.0, 0.0, 0.0): 1.074519}
"""Direction from sphere to sphere → cross section in light along z that is not polarised [µm²], by treams 0.4.7, orders
up to 12; up to 10 it differs by less than 2e-5."""
