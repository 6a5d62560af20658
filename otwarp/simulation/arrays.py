"""Host numbers to device arrays, empty ones included."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp


def device_array(values: Any, dtype: Any, device: Any, *, ndim: int = 1) -> wp.array:
    """Copy `values` to a device array of `dtype` with `ndim` dimensions; an empty list becomes length 0."""
    inner = tuple(getattr(dtype, "_shape_", ()))
    table = np.asarray(values, dtype=wp.dtype_to_numpy(getattr(dtype, "_wp_scalar_type_", dtype)))
    if table.size == 0:
        lead = table.shape[:ndim] if table.ndim >= ndim else (0,) * ndim
        return wp.empty(shape=lead, dtype=dtype, device=device)
    return wp.array(table.reshape(*table.shape[:ndim], *inner), dtype=dtype, device=device, ndim=ndim)


def filled(shape: tuple[int, ...], value: Any, dtype: Any, device: Any) -> wp.array:
    """Device array of `shape` with every element equal to `value`."""
    return wp.full(shape=shape, value=value, dtype=dtype, device=device)
