"""The law of a contact over one step in float64: its load as a function of how far its gap opens."""

from __future__ import annotations

import numpy as np


def depth(opening: float, overlap: float, hardness: float, give: float, wander: float, layer: float) -> float:
    """δ(s) [µm]: the larger of overlap − s and of what keeps the path out, by bisection.

    Args:
        opening: s [µm].
        overlap: At the start of the step [µm].
        hardness: K [pN/µm^{3/2}].
        give: [µm/pN].
        wander: W = −2 s² ln U [µm²], 0 without an excursion.
        layer: Depth of the thermal layer [µm].
    """
    hertz = max(overlap - opening, 0.0)
    begin = layer - overlap

    def missing(d: float) -> float:
        return give * hardness * d**1.5 + d + begin - 0.25 * wander / (opening + d + begin)

    if wander == 0.0 or missing(hertz) >= 0.0:
        return hertz
    low, high = hertz, hertz + 1.0
    while missing(high) < 0.0:
        high = hertz + 2.0 * (high - hertz)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if missing(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def loads(opening: np.ndarray, floor: np.ndarray, law: np.ndarray, give: np.ndarray) -> np.ndarray:
    """(n,) floor + K·δ^{3/2} [pN] of contacts; `law` (n, 4) holds overlap, K, wander and layer."""
    deep = [depth(s, o, k, g, w, y) for s, (o, k, w, y), g in zip(opening, law, give, strict=True)]
    return floor + law[:, 1] * np.array(deep) ** 1.5


def kept(apart: np.ndarray, overlap: np.ndarray, wander: np.ndarray, layer: np.ndarray) -> tuple[np.ndarray, ...]:
    """What the loads of contacts above their floors keep out [µm], give·λ + δ, by Hertz's law and by their paths.

    The gaps open by `apart` (n,) [µm] by all else. A path asks for the positive root x of
    (x + layer − overlap)·(x + layer − overlap + apart) = W/4, and without a wander for nothing.
    """
    root = 0.5 * (np.sqrt(apart**2 + wander) - apart) + overlap - layer
    return overlap - apart, np.where(wander > 0.0, root, -np.inf)


def load_alone(out: np.ndarray, hardness: np.ndarray, give: np.ndarray) -> np.ndarray:
    """(n,) loads above the floor [pN] that keep out `out` [µm]: δ + give·K·δ^{3/2} = out, by bisection in δ."""
    low, high = np.zeros_like(out), np.maximum(out, 0.0)
    for _ in range(200):
        middle = 0.5 * (low + high)
        less = middle + give * hardness * middle**1.5 < out
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return hardness * low**1.5
