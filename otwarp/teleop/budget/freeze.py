"""A scene with fewer moving bodies: the others stand still as obstacles, or are not there.

A frozen body is an obstacle where it started: rigid, without adhesion, immovable. A body that touches it is pressed
with its own elasticity alone, as by a wall of that curvature, and feels twice the stiffness that two equal cells have
for each other. That is not what the cell would do; it keeps its neighbours from spreading into the room it left.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from otwarp.scene import IDENTITY, Body, Obstacle, Quat, Scene, Sphere, Track
from otwarp.simulation.pack_traps import rotate
from otwarp.teleop.budget.reach import Reach


@dataclass(frozen=True, eq=False, kw_only=True)
class Thinned:
    """A scene with fewer moving bodies.

    Attributes:
        scene: It.
        kept, frozen, left: Indices of bodies in the scene it was made from, ascending.
    """

    scene: Scene
    kept: tuple[int, ...]
    frozen: tuple[int, ...]
    left: tuple[int, ...]


def frozen_body(body: Body) -> tuple[Obstacle, ...]:
    """The colliding spheres and rods of a body as obstacles at rest where it starts."""
    place, turn = np.array(body.position), np.array(body.orientation)
    parts = body.colliding
    found = []
    for i, part in enumerate(parts):
        name = body.name if len(parts) == 1 else f"{body.name}/{part.prim.rsplit('/', 1)[-1]}_{i}"
        if isinstance(part, Sphere):
            centre, axis, shape = place + rotate(turn, np.array(part.offset)), IDENTITY, "sphere"
            size = (part.radius, 0.0, 0.0)
        else:
            ends = place + rotate(turn, np.array([part.start, part.end]))
            centre, along, shape = ends.mean(axis=0), ends[1] - ends[0], "capsule"
            axis, size = _turn_to(along), (part.radius, 0.5 * float(np.linalg.norm(along)), 0.0)
        found.append(
            Obstacle(
                prim=name, shape=shape, position=Track.constant(centre), orientation=Track.constant(axis), size=size
            )
        )
    return tuple(found)


def _turn_to(axis: np.ndarray) -> Quat:
    """A rotation that takes +Z to `axis`."""
    x, y, z = axis / max(float(np.linalg.norm(axis)), 1e-300)
    if z < -1.0 + 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    w = 1.0 + z
    length = math.sqrt(x * x + y * y + w * w)
    return -y / length, x / length, 0.0, w / length


def thin_out(scene: Scene, keep: Iterable[int], reach: Reach, *, freeze: bool = True) -> Thinned:
    """The scene with the bodies `keep` alone; of the others those freeze that one of these may touch.

    A body beyond the reach of the traps may be touched by a kept one that roams to it, or that a trap pushed to the
    edge of its reach. What the flow would carry away by more than its size leaves: frozen, it would stand in a stream
    that it should go with.

    Args:
        keep: Indices of bodies.
        freeze: Whether any freezes; otherwise all others leave.
    """
    kept = sorted(set(keep))
    others = np.setdiff1d(np.arange(len(scene.bodies)), kept)
    some = freeze and len(others) > 0 and len(kept) > 0
    frozen = others[_touchable(scene, np.array(kept), others, reach)] if some else others[:0]
    obstacles = tuple(o for i in frozen for o in frozen_body(scene.bodies[i]))
    reduced = dataclasses.replace(
        scene, bodies=tuple(scene.bodies[i] for i in kept), obstacles=(*scene.obstacles, *obstacles)
    )
    left = np.setdiff1d(others, frozen)
    return Thinned(scene=reduced, kept=tuple(kept), frozen=tuple(map(int, frozen)), left=tuple(map(int, left)))


def _touchable(scene: Scene, kept: np.ndarray, others: np.ndarray, reach: Reach) -> np.ndarray:
    """(n,) whether each of `others` collides, stays where it is, and may be touched by one of `kept` in the session."""
    from scipy.spatial import cKDTree

    place = np.array([b.position for b in scene.bodies])
    collides = np.array([bool(scene.bodies[i].colliding) for i in others])
    still = np.linalg.norm(reach.drift[others], axis=1) <= reach.bound[others]
    near, _ = cKDTree(place[kept]).query(place[others])
    movers = reach.bound[kept] + reach.roam[kept] + np.linalg.norm(reach.drift[kept], axis=1)
    cells = [reach.bound[i] for i in kept if scene.bodies[i].kind == "cell"]
    pushed = 2.0 * max(cells, default=0.0) if scene.traps else -math.inf
    return collides & still & ((near <= reach.bound[others] + movers.max()) | (reach.gap[others] <= pushed))
