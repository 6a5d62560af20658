"""The cell that repeats, as kernels read it."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.kernels.core.types import PeriodData
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import Place


def pack_period(scene: Scene, place: Place) -> Annotated[Any, PeriodData]:
    """Lower corner and lengths of the cell [µm]; all zero along an open axis."""
    length = np.array(scene.settings.period, dtype=float)
    closed = length > 0.0
    low = np.where(closed, np.array(scene.settings.period_center) - 0.5 * length, 0.0)
    data, vec3 = place.typed(PeriodData)(), place.typed(wp.vec3)
    data.low, data.length = vec3(*low), vec3(*length)
    data.per_length = vec3(*np.divide(1.0, length, out=np.zeros(3), where=closed))
    return data
