"""Random actions, and what scripted policies share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Seen = Mapping[str, np.ndarray]
"""Observed columns by name, each (N) in their own units."""


def planar(seen: Seen, name: str) -> np.ndarray:
    """(N, 2) x and y of an observed vector."""
    return np.stack([seen[f"{name}.x"], seen[f"{name}.y"]], axis=1).astype(float)


def unit(ways: np.ndarray) -> np.ndarray:
    """(N, 2) ways of length 1; those of length 0 stay."""
    return ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)


class RandomPolicy:
    """Uniform numbers within ±1.

    Args:
        width: Numbers of an action.
        seed: Of the generator.
    """

    def __init__(self, width: int, seed: int = 0):
        self.width, self.generator = width, np.random.default_rng(seed)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, A) actions."""
        return self.generator.uniform(-1.0, 1.0, (len(fresh), self.width))
