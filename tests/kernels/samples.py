"""Inputs shared by the tests of the kernel terms: quaternions, and the way to the device and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from otwarp.simulation.packing.arrays import device_array


def quaternions(rng: np.random.Generator, n: int) -> np.ndarray:
    """(n, 4) random unit quaternions, rounded to float32."""
    q = rng.normal(size=(n, 4))
    return (q / np.linalg.norm(q, axis=1, keepdims=True)).astype(np.float32)


def evaluate(kernel: wp.Kernel, n: int, inputs: list[Any], dtypes: list[Any], device: str) -> list[np.ndarray]:
    """Launch `kernel` over n threads with outputs of `dtypes` behind its inputs; float64 results."""
    outputs = [wp.empty(n, dtype=dtype, device=device) for dtype in dtypes]
    wp.launch(kernel, dim=n, inputs=[*inputs, *outputs], device=device)
    return [out.numpy().astype(float) for out in outputs]


def on_device(device: str, *arrays: tuple[np.ndarray, Any]) -> list[wp.array]:
    """Device arrays of (values, dtype), in order."""
    warp_type = {int: wp.int32, float: wp.float32}
    return [device_array(values, warp_type.get(dtype, dtype), device) for values, dtype in arrays]
