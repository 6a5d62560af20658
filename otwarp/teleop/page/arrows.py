"""Force arrows: where they start and end, from a frame. A trap's arrow stands on the sphere it holds, a contact's on
the part of the body that touches."""

from __future__ import annotations

import numpy as np

from otwarp.scene.transforms import rotate
from otwarp.teleop.page.drawing import Drawing
from otwarp.teleop.page.messages import PageFrame

SHORTEST = 0.25
"""Arrows shorter than this many head lengths are left out."""
MOST_CONTACTS = 200
"""Contacts that are drawn, the largest: thousands of arrows say less than none."""
WEAKEST = 1e-3
"""Force below which no arrow is drawn, however long it would be [pN]."""


def trap_arrows(drawing: Drawing, frame: PageFrame, scale: float, head: float) -> np.ndarray:
    """(n, 2, 3) start and end of the arrows of traps [µm].

    Args:
        drawing: What is shown.
        frame: Forces of T traps.
        scale: Length per force [µm/pN].
        head: Length of an arrow's head [µm].
    """
    if not drawing.traps:
        return np.zeros((0, 2, 3), dtype=np.float32)
    held = np.array([trap.held for trap in drawing.traps])
    offset = np.array([trap.offset for trap in drawing.traps])
    radius = np.array([trap.radius for trap in drawing.traps])
    body = np.maximum(held, 0)
    if len(frame.position):
        centre = frame.position[body] + rotate(_unit(frame.orientation[body]), offset)
        start = np.where((held >= 0)[:, None], centre, frame.trap_position)
    else:
        start = frame.trap_position
    return _arrows(start, frame.trap_force, radius, scale, head)


def contact_arrows(drawing: Drawing, frame: PageFrame, scale: float, head: float) -> np.ndarray:
    """(n, 2, 3) start and end of the arrows of contacts [µm]; arguments as `trap_arrows`."""
    if not len(frame.contact_force):
        return np.zeros((0, 2, 3), dtype=np.float32)
    size = np.linalg.norm(frame.contact_force, axis=1)
    chosen = np.flatnonzero(size > WEAKEST)
    if len(chosen) > MOST_CONTACTS:
        chosen = chosen[np.argsort(-size[chosen], kind="stable")[:MOST_CONTACTS]]
    centres, reach = drawing.touching
    start = frame.position[chosen] + rotate(_unit(frame.orientation[chosen]), centres[chosen])
    return _arrows(start, frame.contact_force[chosen], reach[chosen], scale, head)


def _arrows(start: np.ndarray, force: np.ndarray, radius: np.ndarray, scale: float, head: float) -> np.ndarray:
    """Arrows that begin where the ball about `start` ends; none for forces that are not finite or too small."""
    size = np.linalg.norm(force, axis=1)
    good = np.isfinite(size) & (size > WEAKEST) & (size * scale > SHORTEST * head) & np.isfinite(start).all(axis=1)
    direction = force[good] / size[good, None]
    a = start[good] + radius[good, None] * direction
    return np.stack([a, a + scale * force[good]], axis=1).astype(np.float32)


def _unit(q: np.ndarray) -> np.ndarray:
    q = np.asarray(q, dtype=float)
    return q / np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), 1e-12)
