"""Time samples: linear for positions, normalised linear for quaternions, held constant outside."""

from __future__ import annotations

import numpy as np


def interpolate(times: np.ndarray, values: np.ndarray, time: float) -> np.ndarray:
    """(k,) value at `time` of samples `values` (n, k) at increasing `times` (n,)."""
    if time <= times[0]:
        return np.array(values[0], dtype=float)
    if time >= times[-1]:
        return np.array(values[-1], dtype=float)
    after = int(np.searchsorted(times, time, side="right"))
    weight = (time - times[after - 1]) / (times[after] - times[after - 1])
    return (1.0 - weight) * np.asarray(values[after - 1]) + weight * np.asarray(values[after])


def interpolate_rotation(times: np.ndarray, quaternions: np.ndarray, time: float) -> np.ndarray:
    """(4,) unit quaternion at `time`; neighbouring samples lie in one hemisphere, as the reader leaves them."""
    q = interpolate(times, quaternions, time)
    return q / np.linalg.norm(q)
