"""Worlds with clocks of their own, on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.types import WorldsData
from otwarp.simulation.packing.arrays import Place, device_array


def pack_worlds(worlds: int, first: int, place: Place) -> tuple[wp.array, list[Any]]:
    """All worlds at the start of trial `first`, `first` + 1, …; both results empty for 0 worlds.

    Returns:
        `ModelData.worlds`, and what it refers to by address, to be kept alive.
    """
    kind = place.typed(WorldsData)
    if not worlds:
        return wp.empty(0, dtype=kind, device=place.device), []
    data = kind()
    data.number = device_array(np.arange(first, first + worlds, dtype=np.uint32), wp.uint32, place.device)
    data.step = wp.zeros(worlds, dtype=wp.int64, device=place.device)
    data.done = wp.zeros(worlds, dtype=wp.int32, device=place.device)
    data.living = device_array(np.arange(worlds, dtype=np.int32), wp.int32, place.device)
    data.count = device_array([worlds, worlds], wp.int32, place.device)
    return wp.array([data], dtype=kind, device=place.device), [data]
