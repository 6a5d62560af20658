"""What space that repeats goes with: axes long enough for nearest images, obstacles and a flow that repeat as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from otwarp.scene.description import Body, Flow, Obstacle, Rod, Settings
from otwarp.scene.flow_profile import PROFILES
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.transforms import rotation_matrix
from otwarp.scene.vocabulary.values import authored, bad

LEEWAY = 1.1
"""How much longer a period is than twice what must fit into half of it: bodies feel each other before they touch."""

ALONG = 1e-6
"""Largest component of a direction across an axis that counts as none."""

_AXES = "xyz"


def check_period(
    where: str,
    root: str,
    settings: Settings,
    bodies: Sequence[Body],
    obstacles: Sequence[Obstacle],
    flow: Flow | None,
) -> None:
    """Refuse periodic axes along which nearest images are not all there is, or something does not repeat.

    Args:
        where: What errors name first.
        root: Path of the default prim.

    Raises:
        InputError: One line.
    """
    for axis, length in enumerate(settings.period):
        if length < 0.0:
            raise bad(where, root, "ot:scene:period", _shown(settings), f"at least 0 m along {_AXES[axis]}")
        if length == 0.0:
            continue
        if settings.coupling and len(bodies) > 1:
            allowed = "0 m along all axes with ot:scene:hydrodynamicCoupling: its tensors are those of open space"
            raise bad(where, root, "ot:scene:period", _shown(settings), allowed)
        extents = sorted((extent(body) for body in bodies if body.colliding), reverse=True)
        _check_bodies(where, root, settings, axis, extents)
        for obstacle in obstacles if extents else ():
            _check_obstacle(where, obstacle, axis, length, extents[0])
        if flow is not None:
            _check_flow(where, flow, axis, length)


def extent(body: Body) -> float:
    """Farthest that any point of a body can be from a point among its spheres and rods [µm]."""
    ends = [
        (np.array(end), e.radius)
        for e in (*body.spheres, *body.rods)
        for end in ((e.start, e.end) if isinstance(e, Rod) else (e.offset,))
    ]
    return max(float(np.linalg.norm(a - b)) + radius for a, _ in ends for b, radius in ends)


def _shown(settings: Settings) -> str:
    metres = [f"{authored(length, 'length'):g}" for length in settings.period]
    return f"({', '.join(metres)})"


def _check_bodies(where: str, root: str, settings: Settings, axis: int, extents: list[float]) -> None:
    least = 2.0 * LEEWAY * sum(extents[:2])
    if settings.period[axis] < least:
        allowed = f"0 or at least {authored(least, 'length'):g} m along {_AXES[axis]}, for bodies of this size"
        raise bad(where, root, "ot:scene:period", _shown(settings), allowed)


def _check_obstacle(where: str, obstacle: Obstacle, axis: int, period: float, body: float) -> None:
    """It repeats with the period if bodies meet one image of it at a time, or if it looks the same all along."""
    turns = [rotation_matrix(q / np.linalg.norm(q)) for q in obstacle.orientation.values]
    if obstacle.shape == "plane":
        if any(abs(turn[axis, 2]) > ALONG for turn in turns):
            raise bad(where, obstacle.prim, "orientation", "a plane", f"parallel to {_AXES[axis]}, which is periodic")
        return
    low, high = np.array([_span(obstacle, turn[axis]) for turn in turns]).T
    if max(-low.min(), high.max()) + LEEWAY * body <= 0.5 * period:
        return
    through = 0.5 * period + LEEWAY * body
    if low.max() <= -through and high.min() >= through and all(_straight(obstacle, turn[axis]) for turn in turns):
        return
    allowed = (
        f"within {0.5 * period - LEEWAY * body:g} µm of its origin along {_AXES[axis]}, which is periodic, or straight"
        f" along it from -{through:g} to {through:g} µm"
    )
    raise bad(where, obstacle.prim, "extent", f"{low.min():g} … {high.max():g} µm", allowed)


def _span(obstacle: Obstacle, row: np.ndarray) -> tuple[float, float]:
    """Least and largest coordinate along an axis, of which `row` are the components in the obstacle's frame [µm]."""
    size = np.array(obstacle.size)
    if obstacle.shape == "mesh":
        along = obstacle.vertices @ row
        return float(along.min()), float(along.max())
    if SHAPES[obstacle.shape].round:
        flat = obstacle.shape != "capsule" and abs(row[2]) > 1.0 - ALONG
        half = size[1] * abs(row[2]) + (0.0 if flat else size[0])
    else:
        half = float(np.abs(row) @ size) if obstacle.shape == "box" else float(size[0])
    return -half, half


def _straight(obstacle: Obstacle, row: np.ndarray) -> bool:
    """Whether its section is the same all along the axis; of a mesh that is left to its author."""
    shape = SHAPES[obstacle.shape]
    if shape.round:
        return abs(row[2]) > 1.0 - ALONG and shape.top in (None, 1.0)
    return obstacle.shape == "mesh" or (obstacle.shape == "box" and np.abs(row).max() > 1.0 - ALONG)


REPEATS = 1e-3
"""How far a velocity field may fail to repeat, relative to its extent and its largest velocity."""


def _check_flow(where: str, flow: Flow, axis: int, period: float) -> None:
    turn = rotation_matrix(np.array(flow.orientation))
    if flow.field is not None:
        along = int(np.abs(turn[axis]).argmax())
        length = flow.field.high[along] - flow.field.low[along]
        ends = flow.field.velocity.take((0, -1), axis=along)
        leap = np.abs(np.subtract(*np.moveaxis(ends, along, 0))).max()
        even = abs(abs(turn[axis, along]) - 1.0) < ALONG and abs(length - period) < REPEATS * period
        if not even or leap > REPEATS * flow.field.fastest:
            allowed = f"one as long as the period of {period:g} µm along {_AXES[axis]}, which ends as it begins"
            raise bad(where, flow.prim, "ot:flow:file", f"a field of {length:g} µm", allowed)
    for across in PROFILES[flow.kind].across:
        if abs(turn[axis, across]) > ALONG:
            allowed = f"one that does not vary along {_AXES[axis]}, which is periodic"
            raise bad(where, flow.prim, "ot:flow:kind", flow.kind, allowed)
