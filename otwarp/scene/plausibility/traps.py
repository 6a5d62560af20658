"""Traps that hold nothing, share a sphere from afar, stand in an obstacle, or leap away from what they hold."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from otwarp.scene.description import Obstacle, Trap
from otwarp.scene.finding import Finding
from otwarp.scene.meshes import inside_mesh
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.plausibility.holding import Hold, Trapped, anchors, believable_reach, holds, lit, reach, strongest
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import conjugate, rotate

_DEPTH = 1e-6
"""A focus is inside an obstacle when it is this deep [µm]: rounding of what is authored."""


def odd_traps(scene: Scene) -> Iterator[Finding]:
    """Warnings about traps that are ever lit."""
    spheres = Trapped.of(scene)
    traps = [(trap, hold) for trap, hold in zip(scene.traps, holds(scene, spheres), strict=True) if lit(trap)]
    for trap, hold in traps:
        yield from _out_of_reach(trap, hold, spheres)
        yield from _buried(trap, scene.obstacles)
    pairs = [(trap, hold) for trap, hold in traps if hold is not None]
    yield from _apart(pairs)
    yield from _leaps(scene, pairs)


def _out_of_reach(trap: Trap, hold: Hold | None, spheres: Trapped) -> Iterator[Finding]:
    """A trap that is near no sphere at the start nor on its way, or far from the one that it holds."""
    if hold is None:
        gap, radius = _nearest(trap, spheres)
        if not math.isfinite(gap):
            yield Finding(prim=trap.prim, message="acts on nothing: the scene has no sphere that traps act on")
        elif gap > (limit := reach(trap, radius)):
            way = "comes" if trap.position.animated else "is"
            message = f"no sphere {way} within its reach of {limit:.3g} µm: the nearest starts {gap:.3g} µm away"
            yield Finding(prim=trap.prim, message=message)
        return
    limit = min(hold.reach, believable_reach(trap, hold.radius))
    if hold.gap > limit:
        message = f"starts {hold.gap:.3g} µm from the sphere that it holds; usual: within {limit:.3g} µm"
        endless = "; a force curve without a cutoff pulls from everywhere" if math.isinf(hold.reach) else ""
        yield Finding(prim=trap.prim, message=message + endless)


def _nearest(trap: Trap, spheres: Trapped) -> tuple[float, float]:
    """Distance [µm] from the path of a trap to the nearest sphere at the start, inf for none; and its radius."""
    if not len(spheres.radii):
        return math.inf, 0.0
    path = anchors(trap, trap.position.times)
    best = (math.inf, 0.0)
    for start, end in zip(path, path[1:] if len(path) > 1 else path, strict=False):
        step = end - start
        ways = spheres.centres - start
        along = np.clip(ways @ step / max(float(step @ step), np.finfo(float).tiny), 0.0, 1.0)
        gaps = np.linalg.norm(ways - along[:, None] * step, axis=1)
        n = int(gaps.argmin())
        best = min(best, (float(gaps[n]), float(spheres.radii[n])))
    return best


def _buried(trap: Trap, obstacles: Sequence[Obstacle]) -> Iterator[Finding]:
    """A focus inside an obstacle while the trap is lit."""
    for obstacle in obstacles:
        times = np.unique(np.concatenate([trap.position.times, trap.power.times, obstacle.position.times, [0.0]]))
        times = times[(times >= 0.0) & (trap.power.at_times(times)[:, 0] > 0.0)]
        inside, depth = _inside(obstacle, trap.position.at_times(times), times)
        if inside.any():
            when = float(times[inside][0])
            how = f", {depth[inside][0]:.3g} µm deep," if np.isfinite(depth[inside][0]) else ""
            yield Finding(prim=trap.prim, message=f"its focus is inside {obstacle.prim}{how} at {when:g} s")
            return


def _inside(obstacle: Obstacle, points: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which points (n, 3) are inside an obstacle at `times` (n,), and how deep (n,), inf for a mesh [µm]."""
    turn = obstacle.orientation.at_times(times)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    local = rotate(conjugate(turn), points - obstacle.position.at_times(times))
    distance = SHAPES[obstacle.shape].distance
    if distance is None:
        return inside_mesh(local, obstacle.vertices, obstacle.triangles), np.full(len(points), np.inf)
    depth = -distance(local, np.array(obstacle.size))
    return depth > _DEPTH, depth


def _apart(pairs: Sequence[tuple[Trap, Hold]]) -> Iterator[Finding]:
    """Two traps that hold one sphere and are further from each other than it is wide."""
    first: dict[tuple[int, int], Trap] = {}
    for trap, hold in pairs:
        other = first.setdefault((hold.body, hold.sphere), trap)
        gap = float(np.linalg.norm(anchors(trap, np.zeros(1)) - anchors(other, np.zeros(1))))
        limit = 2.0 * hold.radius + trap.wavelength
        if gap > limit:
            message = f"holds the same sphere as {other.prim}, {gap:.3g} µm away; usual: within {limit:.3g} µm"
            yield Finding(prim=trap.prim, message=message)


def _leaps(scene: Scene, pairs: Sequence[tuple[Trap, Hold]]) -> Iterator[Finding]:
    """Traps that move faster than they can pull, for further than they reach."""
    pull = {body: 0.0 for body in {hold.body for _, hold in pairs}}
    for trap, hold in pairs:
        pull[hold.body] += strongest(trap, hold.radius)
    for trap, hold in pairs:
        if not trap.position.animated:
            continue
        # the body drags no less than this one sphere of it alone, and all its traps together pull no more
        drag = 6.0 * math.pi * scene.medium.viscosity * hold.radius
        fastest, limit = pull[hold.body] / drag, min(hold.reach, believable_reach(trap, hold.radius))
        lost = _left_behind(trap, fastest, limit)
        if lost is not None:
            (t0, t1), distance = trap.position.times[lost - 1 : lost + 1], _steps(trap)[lost - 1]
            message = (
                f"leaps {distance:.3g} µm from {t0:.4g} s to {t1:.4g} s, {distance / (t1 - t0):.3g} µm/s; its sphere "
                f"follows at {fastest:.3g} µm/s at most and is held up to {limit:.3g} µm"
            )
            yield Finding(prim=trap.prim, message=message)


def _steps(trap: Trap) -> np.ndarray:
    """(n − 1,) distances between the keys of a trap [µm]."""
    return np.linalg.norm(np.diff(trap.position.values, axis=0), axis=1)


def _left_behind(trap: Trap, fastest: float, limit: float) -> int | None:
    """Key at which a sphere that pursues a trap straight and at most `fastest` [µm/s] is `limit` [µm] behind."""
    spans = np.diff(trap.position.times)
    if np.all(_steps(trap) <= fastest * spans):
        return None
    place = trap.position.values[0]
    for key, (focus, span) in enumerate(zip(trap.position.values[1:], spans, strict=True), start=1):
        way = focus - place
        gap = float(np.linalg.norm(way))
        stride = min(gap, fastest * span)
        if gap - stride > limit:
            return key
        place = place + way * (stride / gap if gap else 0.0)
    return None
