"""How much faster trapped bodies relax together than each alone, when they carry each other along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.hydrodynamics.rpy import translation_translation
from otwarp.scene import Scene
from otwarp.simulation.packing.coupling import coupling_radius, takes_coupling
from otwarp.simulation.packing.traps import rotate


@dataclass(frozen=True, eq=False)
class CoupledRates:
    """Gain of the fastest relaxation rate by coupling, of m bodies that traps act on and n that traps may come to.

    With M = L (1 + E) Lᵀ, where L Lᵀ are the bodies' own mobilities, the rates M K are the eigenvalues of (1 + E) T
    with T = Lᵀ K L, which has one block for each body.

    Attributes:
        bodies: (m,) their indices in the scene.
        carried: (6m, 6m) E, with the bodies where they start.
        closest: (n, n) largest norm that its blocks can have: of lone spheres that collide where they touch, of other
            bodies where they share a place.
    """

    bodies: np.ndarray
    carried: np.ndarray
    closest: np.ndarray

    @classmethod
    def of(
        cls, scene: Scene, moves: list[BodyMobility], bodies: Sequence[int], reachable: Sequence[int]
    ) -> CoupledRates | None:
        """Prepare the gain for a scene; None where nothing is coupled or traps may come to fewer than two bodies.

        Args:
            bodies: That traps act on where they start.
            reachable: These, and others that traps may come to.
        """
        if not takes_coupling(scene) or len(reachable) < 2:
            return None
        size = len(bodies)
        radius = np.array([coupling_radius(moves[b]) for b in bodies])
        turn = [rotate(np.array(scene.bodies[b].orientation), np.eye(3)).T for b in bodies]
        place = [np.array(scene.bodies[b].position) + q @ moves[b].reference for b, q in zip(bodies, turn, strict=True)]
        carried = np.zeros((size, 6, size, 6))
        for i in range(size):
            for j in range(size):
                if i == j:
                    continue
                pair = turn[i].T @ pair_mobility(place[i] - place[j], radius[i], radius[j]) @ turn[j]
                left, right = (np.linalg.inv(moves[bodies[k]].cholesky)[:, :3] for k in (i, j))
                carried[i, :, j, :] = left @ pair @ right.T
        closest = closest_norms(scene, moves, reachable)
        return cls(np.array(bodies, dtype=int), carried.reshape(6 * size, 6 * size), closest)

    def gain(self, modes: Sequence[np.ndarray]) -> float:
        """Largest rate over the largest of the bodies alone, where they start, with `modes` (6, 6) T of each body."""
        alone = max((float(np.linalg.eigvalsh(t)[-1]) for t in modes), default=0.0)
        if alone <= 0.0:
            return 1.0
        size = 6 * len(modes)
        root = np.zeros((size, size))
        for i, t in enumerate(modes):
            value, vector = np.linalg.eigh(t)
            root[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = (vector * np.sqrt(value.clip(0.0))) @ vector.T
        together = np.linalg.eigvalsh(root @ (np.eye(size) + self.carried) @ root)[-1]
        return max(float(together) / alone, 1.0)

    @property
    def largest_gain(self) -> float:
        """Bound of the gain wherever the bodies are: 1 and the largest row sum of the norms of E."""
        return 1.0 + float(self.closest.sum(axis=1).max())


def closest_norms(scene: Scene, moves: list[BodyMobility], bodies: Sequence[int]) -> np.ndarray:
    """(n, n) `CoupledRates.closest` of the bodies with these indices, zero on the diagonal."""
    radius = np.array([coupling_radius(moves[b]) for b in bodies])
    lone = np.array([len(scene.bodies[b].spheres) == 1 and bool(scene.bodies[b].colliding) for b in bodies])
    closest = np.zeros((len(bodies), len(bodies)))
    for i, j in np.argwhere(~np.eye(len(bodies), dtype=bool)):
        apart = radius[i] + radius[j] if lone[i] and lone[j] else 0.0
        nearest = pair_mobility(np.array([apart, 0.0, 0.0]), float(radius[i]), float(radius[j]))
        closest[i, j] = 6.0 * np.pi * np.sqrt(radius[i] * radius[j]) * np.linalg.norm(nearest, 2)
    return closest


def pair_mobility(way: np.ndarray, a: float, b: float) -> np.ndarray:
    """(3, 3) translational mobility of two spheres `way` apart [1/µm]; of those at one place that of the larger."""
    r = float(np.linalg.norm(way))
    if r <= abs(a - b):
        return np.eye(3) / (6.0 * np.pi * max(a, b))
    p, q = (float(v) for v in translation_translation(np.array(r), np.array(a), np.array(b)))
    return p * np.eye(3) + q * np.outer(way, way) / r**2
