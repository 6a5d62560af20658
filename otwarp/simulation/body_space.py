"""Whether the contacts of a scene of few bodies are solved for what they move the bodies, or for their forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.kernels.contact.body_solve import MAX_NODES, SOFT, nodes_of
from otwarp.kernels.contact.contact import FIRST_OVERLAP
from otwarp.kernels.core.features import Features
from otwarp.scene import Body, Scene


def body_space(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], features: Features, time_step: float
) -> Literal["", "some", "all"]:
    """Which contacts count as soft in steps of `time_step` [s]: all, some or none.

    With walls or coupling none, for bodies then do not move by a mobility of their own.
    """
    f = features
    if f.driver != "world" or not f.contacts or f.walls or f.coupling or nodes_of(f) > MAX_NODES:
        return ""
    products = _products(scene, moves, features, time_step / float(values["medium_viscosity"].min()))
    if max(high for _, high in products) <= SOFT:
        return "all"
    return "some" if min(low for low, _ in products) <= SOFT else ""


def _products(scene: Scene, moves: list[BodyMobility], features: Features, scale: float) -> list[tuple[float, float]]:
    """Bounds of κ of all contacts that can be, see `SOFT`; `scale` is dt/η [µm²/pN]."""
    factor = 2.0 * float(FIRST_OVERLAP) ** 0.5 * scale
    bodies = [(b, m) for b, m in zip(scene.bodies, moves, strict=True) if _radii(b)]
    found = []
    for k, (body, move) in enumerate(bodies):
        soft, gives, radii = _compliance(body), _gives(body, move), _radii(body)
        if features.obstacles:
            found.append((factor / soft * min(radii) * gives[0], factor / soft * max(radii) * gives[1]))
        for other, its in bodies[:k] if features.pairs else ():
            both = soft + _compliance(other)
            theirs, others = _gives(other, its), _radii(other)
            low, high = (r * s / (r + s) for r, s in ((min(radii), min(others)), (max(radii), max(others))))
            found.append((factor / both * low * (gives[0] + theirs[0]), factor / both * high * (gives[1] + theirs[1])))
    return found or [(np.inf, np.inf)]


def _radii(body: Body) -> list[float]:
    return [s.radius for s in body.spheres if s.collides] + [r.radius for r in body.rods if r.collides]


def _compliance(body: Body) -> float:
    return (1.0 - body.material.poisson_ratio**2) / body.material.youngs_modulus


def _gives(body: Body, move: BodyMobility) -> tuple[float, float]:
    """Bounds of the displacement per force of a point of a body along the force, at unit viscosity [1/µm]."""
    points = [s.offset for s in body.spheres] + [p for r in body.rods for p in (r.start, r.end)]
    size = max(float(np.linalg.norm(np.array(p) - move.reference)) for p in points)
    translation = np.linalg.eigvalsh(move.mobility[:3, :3])
    # J M Jᵀ of J = (n, arm × n), whose halves move by M_tt and M_rr: at most twice the sum of what each moves alone
    turning = float(np.linalg.eigvalsh(move.mobility[3:, 3:])[-1])
    most = float(translation[-1]) if size == 0.0 else 2.0 * (float(translation[-1]) + size**2 * turning)
    return float(translation[0]), most
