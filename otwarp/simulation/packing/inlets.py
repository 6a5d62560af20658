"""The domain of a scene, and the inlet at which cells come in again, as kernels read them."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.types import InletData
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import Place, device_array


def has_inlet(scene: Scene) -> bool:
    """Whether the domain of a scene ends anywhere."""
    return scene.settings.domain_low != scene.settings.domain_high


def pack_inlets(scene: Scene, place: Place) -> tuple[wp.array, list[Any]]:
    """Domain and inlet; both results empty without an end of the domain.

    Returns:
        `ModelData.inlets`, and what it refers to by address, to be kept alive.
    """
    kind, vec3, settings = place.typed(InletData), place.typed(wp.vec3), scene.settings
    if not has_inlet(scene):
        return wp.empty(0, dtype=kind, device=place.device), []
    data = kind()
    low, high = np.array(settings.domain_low), np.array(settings.domain_high)
    open_axes = low == high
    data.domain_low, data.domain_high = (
        vec3(*np.where(open_axes, -np.inf, low)),
        vec3(*np.where(open_axes, np.inf, high)),
    )
    data.low = vec3(*settings.inlet_low)
    data.size = vec3(*(np.array(settings.inlet_high) - np.array(settings.inlet_low)))
    data.recycled = device_array([body.kind == "cell" for body in scene.bodies], wp.int32, place.device)
    return wp.array([data], dtype=kind, device=place.device), [data]
