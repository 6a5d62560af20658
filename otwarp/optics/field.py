"""The force as a field: exact Q at points, computed by NumPy or by a Warp device."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from otwarp.optics.beam import Beam
from otwarp.optics.exact import evaluate
from otwarp.optics.mie import Particle

Field = Callable[[np.ndarray], np.ndarray]
"""Dimensionless force Q (n, 3) at sphere centres (n, 3) from the focus [µm]."""


def force(beam: Beam, sphere: Particle, points: np.ndarray, *, device: str | None = None) -> np.ndarray:
    """Exact force on a sphere, dimensionless: in pN it is `beam.force_scale`·Q.

    Args:
        beam: The incident beam.
        sphere: The sphere.
        points: (n, 3) centres of the sphere relative to the focus [µm].
        device: None for NumPy, as `evaluate`; the name of a Warp device for its float64 kernel, which gives no error
            estimate but is faster: see `otwarp.optics.batched`.

    Returns:
        (n, 3) Q.

    Raises:
        InputError: As `evaluate`, or no such device.
    """
    if device is not None:
        from otwarp.optics.batched import batched_force

        return batched_force(beam, sphere, points, device=device)
    return evaluate(beam, sphere, points).force
