"""How wrong a step makes the thermal rotation of rigid bodies: orientations, and displacements in axes that turn.

One step of the scheme of `kernels.bodies.rotational_noise`, averaged by quadrature over its deviates, against
rotational diffusion. A lone sphere has no orientation: nothing depends on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.hydrodynamics.rpy import cross_matrix
from otwarp.kernels.forces.force import Load
from otwarp.kernels.integrate.integrators import PROMISED, Integrator
from otwarp.scene import Scene
from otwarp.simulation.packing.bodies import is_rigid
from otwarp.simulation.packing.coupling import takes_coupling
from otwarp.simulation.packing.walls import hydrodynamic_walls
from otwarp.simulation.time_step.observables import ErrorSource
from otwarp.units import BOLTZMANN

WIDEST = 1.0
"""Largest variance of a rotation vector about its fastest axis that any accuracy is given [rad²]."""

SHARED = 1.5
"""Error of orientations by a scheme whose steps share noise, over that by uncorrected variances. Found by simulation of
free rotors, isotropic and with one axis twice and four times as fast: 1.5 to 1.6."""

PART = math.sqrt(0.5)
"""Of the rotation of a step by which displacements are turned along."""

_NODES = {
    "gaussian": np.polynomial.hermite_e.hermegauss(8),
    "threePoint": np.polynomial.hermite_e.hermegauss(3),
    "uniform": (math.sqrt(3.0) * np.polynomial.legendre.leggauss(6)[0], np.polynomial.legendre.leggauss(6)[1]),
}
"""Deviates and weights that integrate a distribution of the noise."""


@dataclass(frozen=True, eq=False)
class Rotor:
    """Diffusion of a rigid body in the principal axes of its rotation, and how its steps are made.

    Attributes:
        turning: (3,) principal rotational diffusion [1/s].
        moving: (3, 3) translational diffusion in these axes [µm²/s].
        noise: Distribution of the deviates.
        second_order: Whether rotations are those of `rotational_noise`, as away from hydrodynamic walls and without
            coupling; else their variances are 2 D_r dt.
        frozen: Whether displacements have the axes of the start of the step: those by noise if rotations are not of
            second order, and those by a steady force if the scheme has one stage.
        shared: Whether steps share noise.
    """

    turning: np.ndarray
    moving: np.ndarray
    noise: str
    second_order: bool
    frozen: bool
    shared: bool

    def orientation_error(self, step: float) -> float:
        """Relative error of the rate at which ⟨n(0)·n(t)⟩ of an axis of the body decays, the largest with its sign."""
        variances = 2.0 * step * self.turning
        fitted = second_order(variances) if self.second_order and not self.shared else variances
        weight, turns = _rotations(fitted, self.noise)
        kept = np.einsum("n,nkk->k", weight, turns)
        rates = -np.log(np.maximum(kept, 1e-300)) / (0.5 * (variances.sum() - variances)) - 1.0
        return float(rates[np.argmax(np.abs(rates))]) * (SHARED if self.shared else 1.0)

    def axis_error(self, step: float) -> float:
        """Relative error of the mean squared displacement of one step along an axis that the body has at its start.

        Over more steps it is smaller, over all times it is of displacements across another one of the other sign.
        """
        variances = 2.0 * step * self.turning
        found = self.moving
        if not self.frozen:
            weight, turns = _rotations(second_order(variances), self.noise, PART)
            found = np.einsum("n,nij,jk,nlk->il", weight, turns, self.moving, turns)
        one, generator = np.eye(3), np.zeros((9, 9))
        for variance, axis in zip(variances, one, strict=True):
            turn = cross_matrix(axis)
            generator += 0.5 * variance * np.linalg.matrix_power(np.kron(turn, one) - np.kron(one, turn.T), 2)
        rate, mode = np.linalg.eigh(generator)
        mean = np.where(np.abs(rate) > 1e-12, np.expm1(rate) / np.where(np.abs(rate) > 1e-12, rate, 1.0), 1.0)
        exact = ((mode * mean) @ (mode.T @ self.moving.ravel())).reshape(3, 3)
        ratios = np.diag(found) / np.diag(exact) - 1.0
        return float(ratios[np.argmax(np.abs(ratios))])

    def longest(self, error: Callable[[float], float], allowed: float) -> float:
        """Longest step [s], up to `WIDEST`, below which an error stays within `allowed`."""
        high = WIDEST / (2.0 * float(self.turning.max()))
        low = 1e-6 * high
        while low < high and abs(error(min(2.0 * low, high))) <= allowed:
            low = min(2.0 * low, high)
        high = min(2.0 * low, high)
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if abs(error(middle)) <= allowed else (low, middle)
        return low


def second_order(variances: np.ndarray) -> np.ndarray:
    """(3,) variances that rotation vectors are drawn with, from 2 D_r dt; these where there are none [rad²]."""
    total = variances.sum()
    out = variances + 0.25 * np.prod(variances) / np.maximum(variances, 1e-300)
    out -= variances * (total - variances) / 6.0
    return out if np.all(out > 0.0) else variances


def rotors(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], loads: list[Load], scheme: Integrator
) -> list[Rotor]:
    """The rigid bodies of a scene that turn fastest: by themselves, and times how much faster they move along an axis
    than across; at most two, none without noise."""
    rigid = {id(m): m for body, m in zip(scene.bodies, moves, strict=True) if is_rigid(body)}
    hot = float(values["medium_temperature"].max())
    if not scene.settings.brownian or hot <= 0.0 or not rigid:
        return []
    plain = takes_coupling(scene) or bool(hydrodynamic_walls(scene))
    pulled = any(load.force > 0.0 for body, load in zip(scene.bodies, loads, strict=True) if is_rigid(body))
    shared = scheme.noise_ahead > 0
    rate = BOLTZMANN * hot / float(values["medium_viscosity"].min())
    found = []
    for move in rigid.values():
        turning, axes = np.linalg.eigh(rate * move.mobility[3:, 3:])
        found.append(
            Rotor(
                turning=turning,
                moving=rate * (axes.T @ move.mobility[:3, :3] @ axes),
                noise=scene.settings.noise,
                second_order=not plain,
                frozen=plain or shared or (pulled and scheme.correct is None),
                shared=shared,
            )
        )
    stretched = [np.ptp(np.linalg.eigvalsh(r.moving)) / np.trace(r.moving) * r.turning.max() for r in found]
    chosen = {int(np.argmax([r.turning.max() for r in found])), int(np.argmax(stretched))}
    return [found[k] for k in sorted(chosen)]


def in_rotation(turning: list[Rotor], accuracy: float) -> list[ErrorSource]:
    """What the rotation of bodies within a step makes wrong."""
    return [
        ErrorSource(
            name=name,
            error=error,
            longest=rotor.longest(error, PROMISED * accuracy),
            limit="rotational diffusion and wanted accuracy",
        )
        for rotor in turning
        for name, error in (("orientation", rotor.orientation_error), ("axis", rotor.axis_error))
    ]


@lru_cache(maxsize=8)
def _deviates(noise: str) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n,) and deviates (n, 3) of a distribution."""
    x, w = _NODES[noise]
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.einsum("i,j,k->ijk", w, w, w).ravel() / w.sum() ** 3, grid


def _rotations(variances: np.ndarray, noise: str, part: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n,) and matrices (n, 3, 3) of `part` of the rotations of a step, by Rodrigues' formula."""
    weight, grid = _deviates(noise)
    vectors = part * grid * np.sqrt(variances)
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = np.cross(vectors[:, None, :], np.eye(3)).transpose(0, 2, 1)
    return weight, np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * cross @ cross
