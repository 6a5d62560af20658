"""Symmetries of a set of spheres and rods, so that a covering's small unevenness does not break them in the mobility.

The covering is laid out along axes that turn with the body, and the result is averaged over the body's symmetries: the
mobility of a body in any pose is the same to rounding, and what symmetry makes zero or equal is so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.covering import Elements

MATCH = 1e-6
"""Distance, relative to the size of the body, below which two places are the same: authored coordinates are rounded."""

MANY = 64
"""Number of elements beyond which only the identity is tried; the search grows with its fourth power."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """One orthogonal map about the origin that carries the body into itself.

    Attributes:
        turn: (3, 3) orthogonal matrix, proper or not.
        image: (m,) element that each element is carried to.
    """

    turn: np.ndarray
    image: np.ndarray

    @property
    def wrench_map(self) -> np.ndarray:
        """(6, 6) how force and torque, or velocity and angular velocity, transform: the latter are axial vectors."""
        out = np.zeros((6, 6))
        out[:3, :3], out[3:, 3:] = self.turn, np.linalg.det(self.turn) * self.turn
        return out


def body_frame(elements: Elements) -> np.ndarray:
    """(3, 3) rows: orthonormal axes that turn with the body, found from its elements in their order."""
    points = _points(elements)
    first, second = _basis(points)
    if first is None:
        return np.eye(3)
    x = points[first] / np.linalg.norm(points[first])
    y = points[second] if second is not None else np.eye(3)[int(np.argmin(np.abs(x)))]
    y = y - (y @ x) * x
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def symmetries(elements: Elements) -> list[Symmetry]:
    """All symmetries of elements that are centred on the origin, the identity first.

    The infinite group of a body of revolution is replaced by a finite one that leaves the same 6×6 matrices unchanged:
    three turns about the axis, and the mirror planes through it.
    """
    count = len(elements.radius)
    identity = Symmetry(np.eye(3), np.arange(count))
    points = _points(elements)
    first, second = _basis(points)
    if count > MANY or first is None:
        return [identity]
    turns = _turns_of_line(points[first]) if second is None else _turns(points, first, second)
    found = [identity]
    for turn in turns:
        if any(np.allclose(turn, s.turn, atol=1e3 * MATCH) for s in found):
            continue
        image = _image(elements, turn)
        if image is not None:
            found.append(Symmetry(turn, image))
    return found


def _points(elements: Elements) -> np.ndarray:
    return np.concatenate([elements.start, elements.end])


def _size(points: np.ndarray) -> float:
    return float(np.linalg.norm(points, axis=1).max())


def _basis(points: np.ndarray) -> tuple[int | None, int | None]:
    """The point farthest from the origin and the one farthest from its axis; None where there is none. Among equals the
    earliest, so that rounding does not choose."""
    distance = np.linalg.norm(points, axis=1)
    size = distance.max()
    if size == 0.0:
        return None, None
    first = int(np.argmax(distance >= size * (1.0 - MATCH)))
    off = np.linalg.norm(np.cross(points, points[first] / distance[first]), axis=1)
    if off.max() <= MATCH * size:
        return first, None
    return first, int(np.argmax(off >= off.max() * (1.0 - MATCH)))


def _turns_of_line(axis: np.ndarray) -> list[np.ndarray]:
    """Candidates for elements on one line: turns by a third, a mirror plane along it, and the exchange of its ends."""
    z = axis / np.linalg.norm(axis)
    x = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    frame = np.stack([x, np.cross(z, x), z])
    out = []
    for flip in (1.0, -1.0):
        for mirror in (1.0, -1.0):
            for angle in (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0):
                c, s = np.cos(angle), np.sin(angle)
                out.append(frame.T @ np.array([[c, -mirror * s, 0.0], [s, mirror * c, 0.0], [0.0, 0.0, flip]]) @ frame)
    return out


def _turns(points: np.ndarray, first: int, second: int) -> list[np.ndarray]:
    """Orthogonal maps that carry the two basis points to points equally far from the origin and from each other."""
    a, b = points[first], points[second]
    tolerance = MATCH * _size(points)
    inverse = np.linalg.inv(np.stack([a, b, np.cross(a, b)], axis=1))
    length = np.linalg.norm(points, axis=1)
    out = []
    for a_image in points[np.abs(length - length[first]) < tolerance]:
        apart = np.linalg.norm(points - a_image, axis=1)
        fits = (np.abs(length - length[second]) < tolerance) & (np.abs(apart - np.linalg.norm(b - a)) < tolerance)
        for b_image in points[fits]:
            for hand in (1.0, -1.0):
                turn = np.stack([a_image, b_image, hand * np.cross(a_image, b_image)], axis=1) @ inverse
                u, _, v = np.linalg.svd(turn)
                out.append(u @ v)
    return out


def _image(elements: Elements, turn: np.ndarray) -> np.ndarray | None:
    """Which element each is carried to, or None if the map is no symmetry."""
    start, end = elements.start @ turn.T, elements.end @ turn.T
    tolerance = MATCH * max(_size(_points(elements)), float(elements.radius.max()))

    def near(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.linalg.norm(p[:, None] - q[None], axis=-1) < tolerance

    same = near(start, elements.start) & near(end, elements.end)
    same |= near(start, elements.end) & near(end, elements.start)
    same &= np.abs(elements.radius[:, None] - elements.radius[None]) < tolerance
    image = same.argmax(axis=1)
    whole = same.any(axis=1).all() and len(np.unique(image)) == len(image)
    return image if whole else None
