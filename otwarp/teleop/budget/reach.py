"""Which bodies the traps can come to in a session, how far the others are from that, and the scene without those.

A body is within reach if its surface can come as near to a focus as the farthest point of anything that a trap can
carry. The focus may be `sweep` away from its authored path, to any side (less if its speed limit does not let it come
so far in the session); the body may drift with the flow, sink, and diffuse meanwhile. Without traps nothing is within
reach, and distance is counted from the robots, or without these from the middle of the bodies.

Bodies beyond reach stand still as obstacles, or are not there. A frozen body is an obstacle where it started: rigid,
without adhesion, immovable. A body that touches it is pressed with its own elasticity alone, as by a wall of that
curvature, and feels twice the stiffness that two equal cells have for each other. That is not what the cell would do;
it keeps its neighbours from spreading into the room it left.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import IDENTITY, Body, Obstacle, Rod, Scene, Sphere, Track, Trap
from otwarp.scene.flow_profile import flow_velocity
from otwarp.scene.transforms import align_z, rotate
from otwarp.simulation.resolved import resting_loads
from otwarp.units import BOLTZMANN

SWEEP = 40.0
"""How far from its authored path an operator is taken to move a focus [µm]: two and a half strokes of a Touch (0.16 m)
at the default motion gain of 100 µm/m."""

DEVIATIONS = 3.0
"""Standard deviations of thermal motion along one axis over the session that count as reach."""

PATH_STEP = 1.0
"""Points of a trap's path nearer to each other than this count as one [µm]; it is added to the reach."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Reach:
    """How far each body of a scene is beyond the reach of its traps.

    Attributes:
        horizon: Length of the session [s].
        sweep: Farthest that any focus goes from its path [µm]; 0 without traps.
        carried: Farthest point of a body from a sphere of it that a trap can hold [µm]; 0 without traps.
        gap: (B,) distance of the body's surface from the space that the traps reach [µm]; 0 or less: within reach.
        bound: (B,) radius about the prim's origin that holds the body [µm].
        roam: (B,) how far the body moves by itself in the session, flow excepted [µm].
        drift: (B, 3) where the flow carries it [µm].
        anchor: What the distance is counted from: `traps`, `robots`, or `the middle of the bodies`.
    """

    horizon: float
    sweep: float
    carried: float
    gap: np.ndarray
    bound: np.ndarray
    roam: np.ndarray
    drift: np.ndarray
    anchor: str

    @classmethod
    def of(cls, scene: Scene, *, sweep: float = SWEEP, horizon: float | None = None) -> Reach:
        """The reach of a scene's traps.

        Args:
            sweep: How far the operator moves a focus from its authored path [µm].
            horizon: Length of the session [s]; None for the authored duration.

        Raises:
            InputError: A number out of range.
        """
        horizon = scene.settings.duration if horizon is None else horizon
        for name, value in (("sweep", sweep), ("horizon", horizon)):
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name} = {value!r}: must be 0 or more and finite")
        place = np.array([b.position for b in scene.bodies], dtype=float).reshape(-1, 3)
        bound = np.array([body_bound(b) for b in scene.bodies])
        drift = horizon * (np.zeros_like(place) if scene.flow is None else flow_velocity(scene.flow, place))
        roam = np.array(
            [_roam(scene, b, load.force, horizon) for b, load in zip(scene.bodies, resting_loads(scene), strict=True)]
        )
        carried = max((_carried(b) for b in scene.bodies), default=0.0) if scene.traps else 0.0
        sweeps = [min(sweep, trap.speed_limit * horizon) if horizon > 0.0 else 0.0 for trap in scene.traps]
        anchor, points, extra = _anchors(scene, place, [s + carried for s in sweeps])
        gap = np.full(len(place), math.inf)
        for point, reach in zip(points, extra, strict=True):
            gap = np.minimum(gap, _distance(point, place, drift) - reach)
        return cls(
            horizon=horizon,
            sweep=max(sweeps, default=0.0),
            carried=carried,
            gap=gap - bound - (roam if scene.traps else 0.0),
            bound=bound,
            roam=roam,
            drift=drift,
            anchor=anchor,
        )


def _ends(element: Sphere | Rod) -> tuple[np.ndarray, ...]:
    points = (element.offset,) if isinstance(element, Sphere) else (element.start, element.end)
    return tuple(np.array(p) for p in points)


def body_bound(body: Body) -> float:
    """Radius about a body's origin that holds all of it [µm]."""
    return max(float(np.linalg.norm(p)) + e.radius for e in (*body.spheres, *body.rods) for p in _ends(e))


def _carried(body: Body) -> float:
    """Farthest point of a body from a trapped sphere of it [µm], 0 if no trap acts on it."""
    held = [np.array(s.offset) for s in body.spheres if s.trapped]
    return max(
        (float(np.linalg.norm(p - h)) + e.radius for h in held for e in (*body.spheres, *body.rods) for p in _ends(e)),
        default=0.0,
    )


def _roam(scene: Scene, body: Body, load: float, horizon: float) -> float:
    """How far noise, weight and other steady forces take a body [µm], by the Stokes drag of its largest sphere."""
    mobility = 1.0 / (6.0 * math.pi * scene.medium.viscosity * max(s.radius for s in body.spheres))
    hot = scene.medium.temperature if scene.settings.brownian else 0.0
    thermal = DEVIATIONS * math.sqrt(2.0 * BOLTZMANN * hot * mobility * horizon)
    return thermal + load * mobility * horizon


def _path(trap: Trap) -> np.ndarray:
    """(n, 3) points of a trap's authored path, none farther than `PATH_STEP` from all of it [µm]."""
    points = trap.position.values
    kept = [points[0]]
    for a, b in pairwise(points):
        pieces = math.ceil(float(np.linalg.norm(b - a)) / PATH_STEP)
        for point in a + (b - a) * (np.arange(1, pieces + 1) / max(pieces, 1))[:, None]:
            if np.linalg.norm(point - kept[-1]) >= PATH_STEP:
                kept.append(point)
    return np.array(kept)


def _anchors(scene: Scene, place: np.ndarray, reaches: list[float]) -> tuple[str, np.ndarray, np.ndarray]:
    """What distance is counted from: its name, points (n, 3) and reach (n,) about each [µm]."""
    if scene.traps:
        paths = [_path(trap) for trap in scene.traps]
        extra = [np.full(len(p), r + PATH_STEP * (len(p) > 1)) for p, r in zip(paths, reaches, strict=True)]
        return "traps", np.concatenate(paths), np.concatenate(extra)
    robots = [i for i, b in enumerate(scene.bodies) if b.kind == "robot"]
    if robots:
        return "robots", place[robots], np.zeros(len(robots))
    return "the middle of the bodies", place.mean(axis=0)[None], np.zeros(1)


def _distance(point: np.ndarray, place: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """(n,) distance of `point` (3,) from the segments that begin at `place` (n, 3) and go along `drift` (n, 3)."""
    away = point - place
    along = np.einsum("ij,ij->i", drift, drift)
    part = np.einsum("ij,ij->i", away, drift) / np.where(along > 0.0, along, 1.0)
    return np.linalg.norm(away - np.clip(part, 0.0, 1.0)[:, None] * drift, axis=1)


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
            length = float(np.linalg.norm(along))
            axis, size = align_z(along / max(length, 1e-300)), (part.radius, 0.5 * length, 0.0)
        found.append(
            Obstacle(
                prim=name, shape=shape, position=Track.constant(centre), orientation=Track.constant(axis), size=size
            )
        )
    return tuple(found)


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
        scene, bodies=tuple(scene.bodies[i] for i in kept), obstacles=(*scene.obstacles, *obstacles), judged=True
    )
    left = np.setdiff1d(others, frozen)
    return Thinned(scene=reduced, kept=tuple(kept), frozen=tuple(map(int, frozen)), left=tuple(map(int, left)))


def _touchable(scene: Scene, kept: np.ndarray, others: np.ndarray, reach: Reach) -> np.ndarray:
    """(n,) whether each of `others` collides, stays where it is, and may be touched by one of `kept` in the session."""
    from scipy.spatial import KDTree

    place = np.array([b.position for b in scene.bodies])
    collides = np.array([bool(scene.bodies[i].colliding) for i in others])
    still = np.linalg.norm(reach.drift[others], axis=1) <= reach.bound[others]
    near, _ = KDTree(place[kept]).query(place[others])
    movers = reach.bound[kept] + reach.roam[kept] + np.linalg.norm(reach.drift[kept], axis=1)
    cells = [reach.bound[i] for i in kept if scene.bodies[i].kind == "cell"]
    pushed = 2.0 * max(cells, default=0.0) if scene.traps else -math.inf
    return collides & still & ((near <= reach.bound[others] + movers.max()) | (reach.gap[others] <= pushed))
