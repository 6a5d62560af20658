"""Which bodies the traps can come to in a session, and how far the others are from that.

A body is within reach if its surface can come as near to a focus as the farthest point of anything that a trap can
carry. The focus may be `sweep` away from its authored path, to any side (less if its speed limit does not let it come
so far in the session); the body may drift with the flow, sink, and diffuse meanwhile. Without traps nothing is within
reach, and distance is counted from the robots, or without these from the middle of the bodies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.description import Body, Rod, Scene, Sphere, Trap
from otwarp.simulation.pack_bodies import weight
from otwarp.simulation.pack_traps import rotate
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
        drift = horizon * flow_velocity(scene, place)
        roam = np.array([_roam(scene, b, horizon) for b in scene.bodies])
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


def flow_velocity(scene: Scene, place: np.ndarray) -> np.ndarray:
    """(n, 3) velocity of the background flow [µm/s] at `place` (n, 3) [µm]; see `Flow`."""
    flow = scene.flow
    if flow is None:
        return np.zeros_like(place)
    turn = np.array(flow.orientation)
    height = rotate(turn * [-1.0, -1.0, -1.0, 1.0], place - flow.origin)[:, 2]
    if flow.kind == "uniform":
        speed = np.full(len(place), flow.speed)
    elif flow.kind == "shear":
        speed = flow.shear_rate * height
    else:
        speed = flow.speed * np.maximum(0.0, 1.0 - (height / flow.half_height) ** 2)
    return speed[:, None] * rotate(turn, np.array([1.0, 0.0, 0.0]))


def _roam(scene: Scene, body: Body, horizon: float) -> float:
    """How far diffusion and weight take a body in the session [µm], by the Stokes drag of its largest sphere."""
    mobility = 1.0 / (6.0 * math.pi * scene.medium.viscosity * max(s.radius for s in body.spheres))
    hot = scene.medium.temperature if scene.settings.brownian else 0.0
    thermal = DEVIATIONS * math.sqrt(2.0 * BOLTZMANN * hot * mobility * horizon)
    return thermal + (abs(weight(scene, body)) * mobility * horizon if scene.settings.gravity else 0.0)


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
