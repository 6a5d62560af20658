"""Nearest points of segments, by the cases of the quadratic problem rather than by the device's search along one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar


def point_segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """(distance, s in [0, 1]) of a point from a segment."""
    along = end - start
    square = float(along @ along)
    s = float(np.clip((point - start) @ along / square, 0.0, 1.0)) if square > 0.0 else 0.0
    return float(np.linalg.norm(point - start - s * along)), s


def segment_segment(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> float:
    """Least distance of two segments: that of the lines if both feet are inside, else from one of the four ends."""
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    best = min(
        point_segment(a0, b0, b1)[0],
        point_segment(a1, b0, b1)[0],
        point_segment(b0, a0, a1)[0],
        point_segment(b1, a0, a1)[0],
    )
    gram = np.array([[u @ u, -u @ v], [-u @ v, v @ v]])
    if np.linalg.det(gram) > 1e-12 * gram[0, 0] * gram[1, 1]:
        s, t = np.linalg.solve(gram, [-u @ w, v @ w])
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            best = min(best, float(np.linalg.norm(w + s * u - t * v)))
    return best


def along_segment(
    distance: Callable[[np.ndarray], float], start: np.ndarray, end: np.ndarray, samples: int = 200
) -> tuple[float, float]:
    """(least value of a signed distance on a segment, s in [0, 1] where it is): dense samples, then Brent's method."""
    s = np.linspace(0.0, 1.0, samples + 1)
    values = [distance(start + k * (end - start)) for k in s]
    i = int(np.argmin(values))
    low, high = s[max(i - 1, 0)], s[min(i + 1, samples)]
    found = minimize_scalar(
        lambda k: distance(start + k * (end - start)), bounds=(low, high), method="bounded", options={"xatol": 1e-10}
    )
    return (float(found.fun), float(found.x)) if found.fun < values[i] else (float(values[i]), float(s[i]))
