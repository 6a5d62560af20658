"""Where hard spheres are by Boltzmann's distribution: in a spring by quadrature, several in a box by Metropolis.

Independent of the kernels: float64, host only. Units are the internal ones (µm, pN).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GapDistribution:
    """(n,) gaps [µm] and the chance of each."""

    gap: np.ndarray
    chance: np.ndarray

    @property
    def mean(self) -> float:
        """Mean gap ⟨g⟩ [µm]."""
        return float(self.chance @ self.gap)

    @property
    def spread(self) -> float:
        """Standard deviation of the gap [µm]."""
        return float(np.sqrt(self.chance @ (self.gap - self.mean) ** 2))

    def below(self, gap: float) -> float:
        """Chance of a gap smaller than `gap` [µm]."""
        return float(self.chance[self.gap < gap].sum())


def spring_gaps(
    stiffness: float, hard: float, energy: float, reach: float, room: Callable[[np.ndarray], np.ndarray]
) -> GapDistribution:
    """Gap that a spring closes: p(r) ∝ room(r)·exp(−U/k_BT), U = k/2·r² + 2/5·K·(reach − r)^{5/2} below `reach`.

    Args:
        stiffness: k [pN/µm].
        hard: K of Hertz's law F = K·δ^{3/2} [pN/µm^{3/2}].
        energy: k_BT [pN·µm].
        reach: Distance r at which the bodies touch [µm].
        room: How much of space is at a distance r: r² about a point, r about a line.
    """
    pull = stiffness * reach
    far = min(40.0 * energy / pull, 10.0 * np.sqrt(energy / stiffness))
    deep = 6.0 * (2.5 * energy / hard) ** 0.4 + (2.0 * pull / hard) ** (2.0 / 3.0)
    n = 800_000
    gap = (far + deep) * (np.arange(n) + 0.5) / n - deep
    r = reach + gap
    exponent = 0.5 * stiffness * (r**2 - reach**2) + 0.4 * hard * np.maximum(-gap, 0.0) ** 2.5
    weight = room(r) * np.exp(-exponent / energy)
    return GapDistribution(gap, weight / weight.sum())


def pair_gaps(stiffness: float, hard: float, energy: float, reach: float = 2.0) -> GapDistribution:
    """Gap of two spheres in one spring of stiffness k on each [pN/µm], whose distance has one of k/2; see above."""
    return spring_gaps(0.5 * stiffness, hard, energy, reach, np.square)


def metropolis(
    place: np.ndarray, half: float, stiffness: float, energy: float, sweeps: int, rng: np.random.Generator
) -> np.ndarray:
    """(W, n, 3) places of hard spheres of radius 1 µm after `sweeps` trials each (Metropolis et al. 1953).

    Their centres stay within ±`half` [µm] along every axis; a spring pulls each to the origin.
    """
    place = place.copy()
    worlds, count, _ = place.shape
    for _ in range(sweeps):
        for b in range(count):
            to = place[:, b] + rng.uniform(-0.3, 0.3, (worlds, 3))
            apart = np.linalg.norm(to[:, None] - place, axis=2)
            apart[:, b] = np.inf
            more = 0.5 * stiffness * ((to**2).sum(1) - (place[:, b] ** 2).sum(1)) / energy
            chance = np.exp(-np.maximum(more, 0.0))
            good = (np.abs(to) <= half).all(1) & (apart >= 2.0).all(1) & (rng.uniform(size=worlds) < chance)
            place[good, b] = to[good]
    return place


def near_gaps(place: np.ndarray, half: float, within: float) -> tuple[np.ndarray, np.ndarray]:
    """(W,) numbers of gaps below `within` [µm] between spheres and walls, and between spheres."""
    walls = (half - np.abs(place) < within).sum((1, 2)) + (half + np.abs(place) < within).sum((1, 2))
    i, j = np.triu_indices(place.shape[1], 1)
    pairs = (np.linalg.norm(place[:, i] - place[:, j], axis=2) - 2.0 < within).sum(1)
    return walls, pairs
