"""Whether the contacts of a scene of few bodies are solved for what they move the bodies, or for their forces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.kernels.contact.body_solve import MAX_NODES, SOFT, nodes_of
from otwarp.kernels.contact.contact import FIRST_OVERLAP
from otwarp.kernels.core.features import Features
from otwarp.scene import Body, Scene


def body_space(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], features: Features, time_step: float
) -> bool:
    """Whether some contact counts as soft in steps of `time_step` [s].

    With walls or coupling none, for bodies then do not move by a mobility of their own.
    """
    f = features
    if f.driver != "world" or not f.contacts or f.walls or f.coupling or nodes_of(f) > MAX_NODES:
        return False
    return _softest(scene, moves, features, time_step / float(values["medium_viscosity"].min())) <= SOFT


def _softest(scene: Scene, moves: list[BodyMobility], features: Features, scale: float) -> float:
    """A lower bound of κ of all contacts that can be, see `SOFT`; `scale` is dt/η [µm²/pN]."""
    factor = 2.0 * float(FIRST_OVERLAP) ** 0.5 * scale
    bodies = [(b, m) for b, m in zip(scene.bodies, moves, strict=True) if b.colliding]
    least = np.inf
    for k, (body, move) in enumerate(bodies):
        soft, give, radius = _compliance(body), _least_give(move), _least_radius(body)
        if features.obstacles:
            least = min(least, factor / soft * radius * give)
        for other, its in bodies[:k] if features.pairs else ():
            both = radius * _least_radius(other) / (radius + _least_radius(other))
            least = min(least, factor / (soft + _compliance(other)) * both * (give + _least_give(its)))
    return least


def _least_radius(body: Body) -> float:
    return min(element.radius for element in body.colliding)


def _compliance(body: Body) -> float:
    return (1.0 - body.material.poisson_ratio**2) / body.material.youngs_modulus


def _least_give(move: BodyMobility) -> float:
    """The least that a point of a body moves per force along it, at unit viscosity [1/µm]."""
    return float(np.linalg.eigvalsh(move.mobility[:3, :3])[0])
