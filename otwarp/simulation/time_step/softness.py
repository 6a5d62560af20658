"""Whether all contacts of a scene are so soft against its time step that explicit contact forces serve."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.core.faults import OVERLAP_LIMIT
from otwarp.kernels.core.features import Features
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Body, Scene

EXPLICIT_PRODUCT = 1.8
"""Largest bound of the fastest contact relaxation rate × time step for explicit forces; 2 would be unstable.

It is that of the densest packing at the deepest overlap that does not stop a run, so what really happens is far inside.
"""

TURNS_PRODUCT = 100.0
"""Largest k·give of contacts between bodies, at the deepest overlap, that are solved one after the other."""

WALLS = 2.0
"""Obstacles that resist one motion of a sphere at once: the two sides of a slit."""


def stiffest(contacts: list[tuple[float, float, float, float]]) -> float:
    """Largest |dF/dgap| [pN/µm] of contacts (effective radius R, smaller radius r, 1/E*, adhesion slope).

    Hertz: 2E*√(Rδ) at the overlap δ = r/2 that stops a run; adhesion: 2πRW/range where it fades.
    """
    return max(
        (max(2.0 * math.sqrt(big * OVERLAP_LIMIT * small) / soft, 2.0 * math.pi * big * slope))
        for big, small, soft, slope in contacts
    )


def room_for(radius: float, other: float) -> float:
    """Spheres of radius `other` that find room on one of `radius`, at most: by the area that each one's cap covers."""
    sine = other / (radius + other)
    return 2.0 / (1.0 - math.sqrt(1.0 - sine * sine))


def contact_product(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], features: Features, time_step: float
) -> float:
    """Bound of the fastest relaxation rate of the contacts of lone spheres × time step.

    Forces of stiffness k on a sphere of mobility μ that n neighbours cover evenly pull it back at k·μ·n/3, and in two
    neighbours against each other at up to twice that; n is the room there is for the smallest ones.
    """
    kinds = {_kind(body, move): body for body, move in zip(scene.bodies, moves, strict=True) if _collides(body)}
    if not kinds:
        return 0.0
    scale = time_step / float(values["medium_viscosity"].min())
    smallest = min(body.spheres[0].radius for body in kinds.values())
    product = 0.0
    if features.pairs:
        pairs = [
            (a.spheres[0].radius, b.spheres[0].radius, _compliance(a) + _compliance(b), max(_slope(a), _slope(b)))
            for a in kinds.values()
            for b in kinds.values()
        ]
        k = stiffest([(ra * rb / (ra + rb), min(ra, rb), soft, slope) for ra, rb, soft, slope in pairs])
        covered = max(mobility * room_for(radius, smallest) / 3.0 for radius, mobility, *_ in kinds)
        product += 2.0 * k * covered * scale
    if features.obstacles:
        k = stiffest([(radius, radius, soft, slope) for radius, _, soft, slope in kinds])
        product += WALLS * k * max(mobility for _, mobility, *_ in kinds) * scale
    return product


def takes_turns(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], features: Features, time_step: float
) -> bool:
    """Whether the contacts of the grid driver may be solved one after the other, as a CPU does fastest.

    Rounds of turns grow with k·give where bodies lean on bodies in a row, give their mobilities × time step; it is
    taken at the overlap that stops a run. Harder scenes are left to sweeps, whose number does not.
    """
    if features.driver != "grid" or not features.contacts:
        return False
    shapes = {id(move): move for move in moves}
    easiest = {key: float(np.linalg.eigvalsh(move.mobility[:3, :3])[-1]) for key, move in shapes.items()}
    kinds: dict[tuple[float, ...], int] = {}
    for body, move in zip(scene.bodies, moves, strict=True):
        if body.colliding:
            largest = max(element.radius for element in body.colliding)
            kind = (largest, easiest[id(move)], _compliance(body), _slope(body))
            kinds[kind] = kinds.get(kind, 0) + 1
    scale = time_step / float(values["medium_viscosity"].min())
    for a in kinds:
        for b in kinds:
            if a == b and kinds[a] < 2:
                continue
            radii = (a[0] * b[0] / (a[0] + b[0]), min(a[0], b[0]))
            if stiffest([(*radii, a[2] + b[2], max(a[3], b[3]))]) * (a[1] + b[1]) * scale > TURNS_PRODUCT:
                return False
    return True


def soft_contacts(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], features: Features, time_step: float
) -> bool:
    """Whether the grid driver may take contact forces at the start of a step for all of it.

    Lone spheres alone, whose mobility is the same everywhere, under forces that one stage of the integrator serves.
    """
    if features.driver != "grid" or features.rigid or features.walls > 0 or not features.contacts:
        return False
    if INTEGRATORS[features.integrator].correct is not None:
        return False
    return contact_product(scene, moves, values, features, time_step) <= EXPLICIT_PRODUCT


def _collides(body: Body) -> bool:
    return any(s.collides for s in body.spheres)


def _compliance(body: Body) -> float:
    return (1.0 - body.material.poisson_ratio**2) / body.material.youngs_modulus


def _slope(body: Body) -> float:
    """Adhesion over its range [pN/µm²]."""
    return body.material.adhesion / body.material.adhesion_range if body.material.adhesion > 0.0 else 0.0


def _kind(body: Body, move: BodyMobility) -> tuple[float, float, float, float]:
    """Radius, mobility at unit viscosity, compliance and adhesion slope: equal bodies count once."""
    return body.spheres[0].radius, float(move.mobility[0, 0]), _compliance(body), _slope(body)
