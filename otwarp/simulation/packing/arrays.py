"""Host numbers to device arrays, empty ones included, in the precision of a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import empty
from otwarp.kernels.core.precision import typed
from otwarp.warp_internals import scalar_of, shape_of


@dataclass(frozen=True)
class Place:
    """Where a model's numbers live: a device, and the precision of the real ones there.

    Attributes:
        device: Warp device or its name.
        precision: One of `otwarp.kernels.core.precision.PRECISIONS`.
        which: (W) int32 on the device, the row that each world has of parameters whose rows worlds share; None: they
            have rows of their own.
    """

    device: Any
    precision: str = "float32"
    which: wp.array | None = None

    def typed(self, kind: Any) -> Any:
        """A Warp type or struct of float32 as it is here."""
        return typed(kind, self.precision)


def device_array(values: Any, dtype: Any, device: Any, *, ndim: int = 1) -> wp.array:
    """Copy `values` to a device array of `dtype` with `ndim` dimensions; an empty list becomes length 0.

    Args:
        device: Warp device or its name, or a `Place`, in whose precision the array then is.
    """
    if isinstance(device, Place):
        dtype, device = device.typed(dtype), device.device
    inner = shape_of(dtype)
    table = np.asarray(values, dtype=host_type(dtype))
    if table.size == 0:
        lead = table.shape[:ndim] if table.ndim >= ndim else (0,) * ndim
        return wp.empty(shape=lead, dtype=dtype, device=device)
    return wp.array(table.reshape(*table.shape[:ndim], *inner), dtype=dtype, device=device, ndim=ndim)


def device_rows(values: np.ndarray, dtype: Any, place: Place, *, ndim: int = 1) -> wp.array:
    """`device_array` of the (1|W, …) rows of a parameter; rows that worlds share come as they are, (1|R, …)."""
    rows = device_array(values, dtype, place, ndim=ndim)
    return rows if place.which is None or len(values) == 1 else gathered(rows, place.which)


def gathered(rows: wp.array, which: wp.array) -> wp.array:
    """(n, …) rows of an array on the same device, `which` (n) int32 of them, without a way over the host."""
    if rows.size == 0:
        return empty((len(which), *rows.shape[1:]), rows.dtype, rows.device)
    chosen: Any = wp.indexedarray(rows, [which])
    return chosen.contiguous()


def repeated(row: Any, count: int, dtype: Any, place: Place) -> wp.array:
    """(count, n) array of one row (n) on the host, in each row the same."""
    rows = device_array(np.asarray(row)[None], dtype, place, ndim=2)
    return rows if count == 1 else gathered(rows, wp.zeros(count, dtype=wp.int32, device=place.device))


def device_view(values: Any, dtype: Any = None) -> wp.array | None:
    """A Warp array or a tensor of torch as a Warp array, without a copy; None for what lives on the host.

    Args:
        dtype: Of its elements, a vector for the last axis of a tensor; None: as it is.
    """
    if isinstance(values, wp.array):
        return values
    if type(values).__module__.partition(".")[0] == "torch":
        return wp.from_torch(values, dtype=dtype)
    return None


def host_type(dtype: Any) -> Any:
    """NumPy type of the numbers in an array of `dtype`."""
    return wp.dtype_to_numpy(scalar_of(dtype))


def filled(shape: tuple[int, ...], value: Any, dtype: Any, device: Any) -> wp.array:
    """Device array of `shape` with every element equal to `value`."""
    return wp.full(shape=shape, value=value, dtype=dtype, device=device)
