"""Host numbers to device arrays, empty ones included, in the precision of a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.precision import typed
from otwarp.warp_internals import scalar_of, shape_of


@dataclass(frozen=True)
class Place:
    """Where a model's numbers live: a device, and the precision of the real ones there.

    Attributes:
        device: Warp device or its name.
        precision: One of `otwarp.kernels.core.precision.PRECISIONS`.
    """

    device: Any
    precision: str = "float32"

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
