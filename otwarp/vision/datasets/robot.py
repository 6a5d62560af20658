"""A robot as solids in its own frame, centre at the origin, long axis along x; its turns and symmetries."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Body, Scene
from otwarp.vision.specimen import Specimen
from otwarp.vision.view import solids_of

SAME = 1e-3
"""Distance of solids that count as one where symmetries are sought [µm]."""


@dataclass(frozen=True, eq=False)
class Robot:
    """Spheres and rods around their centre of volume; solids that overlap count twice for it.

    Attributes:
        start, end: (n, 3) centres of their rounded ends [µm], equal for spheres.
        radius: (n) [µm].
        index: (n) refractive indices.
        center: (3) where the origin is in the frame in which the robot was given [µm].
        frame: (3, 3) its axes in that frame, as rows.
        name: Of the prim, or empty.
    """

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray
    index: np.ndarray
    center: np.ndarray
    frame: np.ndarray
    name: str = ""

    @classmethod
    def of_solids(
        cls,
        start: np.ndarray,
        end: np.ndarray,
        radius: np.ndarray,
        index: np.ndarray,
        *,
        axis: np.ndarray | None = None,
        name: str = "",
    ) -> Robot:
        """Solids in any frame, moved and turned into the robot's own.

        Args:
            start, end: (n, 3) centres of rounded ends [µm].
            radius, index: (n).
            axis: (3) the long one; None: along which volume reaches farthest, pointing to the larger coordinate.
            name: Of the prim.

        Raises:
            InputError: No solids, or numbers that cannot be.
        """
        if not len(radius):
            raise InputError("the robot has no spheres; allowed: one or more")
        Specimen(start, end, radius, index)  # refuses what is not finite, thin or optically impossible
        length = np.linalg.norm(end - start, axis=1)
        volume = math.pi * radius**2 * (4.0 / 3.0 * radius + length)
        center = np.average(0.5 * (start + end), axis=0, weights=volume)
        if axis is None:
            axis = _longest(start - center, end - center, volume)
        size = float(np.linalg.norm(axis))
        if not (math.isfinite(size) and size > 0.0):
            raise InputError(f"axis of the robot is {axis.tolist()}; allowed: three finite numbers, not all 0")
        frame = _frame(axis / size)
        return cls((start - center) @ frame.T, (end - center) @ frame.T, radius, index, center, frame, name)

    @classmethod
    def of_body(cls, scene: Scene, name: str | None = None, axis: np.ndarray | None = None) -> Robot:
        """A body of a scene, or its only one.

        Raises:
            InputError: No such body, or several where none is named.
        """
        body = _body(scene, name)
        columns = zip(*solids_of(body), strict=True)
        start, end, radius, index = (np.array(column, dtype=float) for column in columns)
        return cls.of_solids(start, end, radius, index, axis=axis, name=body.name)

    def varied(self, *, radius_scale: float = 1.0, length_scale: float = 1.0, index: float | None = None) -> Robot:
        """Another robot of the class: all radii, all distances, or the refractive index of all solids changed."""
        refraction = self.index if index is None else np.full_like(self.index, index)
        return Robot(self.start * length_scale, self.end * length_scale, self.radius * radius_scale, refraction,
                     self.center, self.frame, self.name)  # fmt: skip

    def at(self, tilt: float, yaw: float = 0.0, roll: float = 0.0) -> Specimen:
        """The robot turned, its centre at the origin.

        Args:
            tilt: Of the long axis out of the focal plane, towards where light goes [deg].
            yaw: Azimuth of the long axis in the image [deg].
            roll: About the long axis, before that [deg].
        """
        turn = rotation(tilt, yaw, roll)
        return Specimen(self.start @ turn.T, self.end @ turn.T, self.radius, self.index)

    def described(self) -> dict[str, Any]:
        """For a manifest: solids in the robot's frame, and that frame within the prim's."""
        spheres = np.all(self.start == self.end, axis=1)
        solids = zip(spheres, self.start, self.end, self.radius, self.index, strict=True)
        found: dict[str, Any] = {"prim": self.name, "center": self.center.tolist(), "frame": self.frame.tolist()}
        found |= {"spheres": [], "rods": []}
        for ball, start, end, radius, index in solids:
            rest = {"radius": float(radius), "index": float(index)}
            if ball:
                found["spheres"].append({"center": start.tolist(), **rest})
            else:
                found["rods"].append({"start": start.tolist(), "end": end.tolist(), **rest})
        return found

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Robot:
        """The robot that `described` wrote.

        Args:
            said: As of a manifest.
        """
        solids = [(s["center"], s["center"], s["radius"], s["index"]) for s in said["spheres"]]
        solids += [(r["start"], r["end"], r["radius"], r["index"]) for r in said["rods"]]
        start, end, radius, index = (np.array(column, dtype=float) for column in zip(*solids, strict=True))
        center, frame = np.array(said.get("center", np.zeros(3))), np.array(said.get("frame", np.eye(3)))
        return cls(start, end, radius, index, center, frame, said.get("prim", ""))

    @property
    def length(self) -> float:
        """Along the long axis, from end to end [µm]."""
        ends = np.concatenate([self.start, self.end])[:, 0]
        thick = np.tile(self.radius, 2)
        return float((ends + thick).max() - (ends - thick).min())

    def same(self, other: Robot) -> bool:
        """Whether another robot has the same solids at the same places, but for where it is and how it is turned.

        Args:
            other: In any frame.
        """
        if len(self.radius) != len(other.radius):
            return False
        own, their = (Robot.of_solids(r.start, r.end, r.radius, r.index) for r in (self, other))
        for flip in (np.eye(3), _about(2, 180.0)):
            turned = their.turned(flip)
            if any(own.matches(turned.turned(_about(0, angle))) for angle in own._rolls(turned)):
                return True
        return False

    def turned(self, turn: np.ndarray) -> Robot:
        """The same robot in a frame that is turned.

        Args:
            turn: (3, 3).
        """
        return dataclasses.replace(self, start=self.start @ turn.T, end=self.end @ turn.T)

    def _rolls(self, other: Robot) -> list[float]:
        """Angles about the long axis [deg] that bring a solid of another robot to this one's farthest from the axis."""
        middle, theirs = 0.5 * (self.start + self.end), 0.5 * (other.start + other.end)
        ends = np.concatenate([middle, self.start])
        n = int(np.argmax(np.hypot(ends[:, 1], ends[:, 2])))
        if math.hypot(*ends[n, 1:]) < SAME:
            return [0.0]
        points = theirs if n < len(middle) else np.concatenate([other.start, other.end])
        near = np.abs(np.hypot(points[:, 1], points[:, 2]) - math.hypot(*ends[n, 1:])) < 2.0 * SAME
        away = np.arctan2(ends[n, 2], ends[n, 1]) - np.arctan2(points[near, 2], points[near, 1])
        return np.degrees(away).tolist()

    def matches(self, other: Robot) -> bool:
        """Whether each solid of one robot lies where one of its kind of the other does.

        Args:
            other: With as many solids, in the same frame.
        """
        taken = np.zeros(len(other.radius), dtype=bool)
        for n in range(len(self.radius)):
            like = (np.abs(other.radius - self.radius[n]) < SAME) & (np.abs(other.index - self.index[n]) < SAME)
            pairs = ((other.start, other.end), (other.end, other.start))
            away = [np.maximum(np.abs(a - self.start[n]).max(axis=1), np.abs(b - self.end[n]).max(axis=1))
                    for a, b in pairs]  # fmt: skip
            found = np.flatnonzero((np.minimum(*away) < 3.0 * SAME) & like & ~taken)
            if not len(found):
                return False
            taken[found[0]] = True
        return True

    def symmetry(self) -> dict[str, Any]:
        """Rotations that leave the robot as it is.

        Returns:
            `axial`: by any angle about its long axis. `order`: by how many equal angles about it (1: none).
            `flip`: some half turn reverses the axis. `rotations`: the finite ones, 3 × 3, in the robot's frame; where
            it is axial, without those about the axis. `spherical`: any rotation at all.
        """
        on_axis = max(np.abs(self.start[:, 1:]).max(), np.abs(self.end[:, 1:]).max()) < SAME
        spherical = bool(on_axis and max(np.abs(self.start).max(), np.abs(self.end).max()) < SAME)
        order = 1
        if not on_axis:
            order = max(n for n in range(1, 13) if self._unchanged(_about(0, 360.0 / n)))
        spins = [_about(0, 360.0 * k / order) for k in range(order)]
        # a half turn about an axis across: a few directions, in steps that divide all orders sought
        half = [_about(0, a) @ _about(2, 180.0) @ _about(0, -a) for a in np.arange(0.0, 180.0, 2.5)]
        flip = next((turn for turn in (half[:1] if on_axis else half) if self._unchanged(turn)), None)
        finite = spins + ([] if flip is None else [flip @ spin for spin in spins])
        return {"axial": bool(on_axis), "order": order, "flip": flip is not None, "spherical": spherical,
                "rotations": [np.round(turn, 12).tolist() for turn in finite]}  # fmt: skip

    def _unchanged(self, turn: np.ndarray) -> bool:
        """Whether each solid comes to lie where one of its kind was."""
        start, end = self.start @ turn.T, self.end @ turn.T
        for n in range(len(self.radius)):
            like = (np.abs(self.radius - self.radius[n]) < SAME) & (np.abs(self.index - self.index[n]) < SAME)
            there = [(self.start, self.end), (self.end, self.start)]
            found = [(np.abs(a - start[n]).max(axis=1) < SAME) & (np.abs(b - end[n]).max(axis=1) < SAME)
                     for a, b in there]  # fmt: skip
            if not np.any((found[0] | found[1]) & like):
                return False
        return True


def rotation(tilt: float, yaw: float, roll: float = 0.0) -> np.ndarray:
    """(3, 3) from the robot's frame to the camera's: roll about x, then tilt, which lifts x to z, then yaw about z.

    Args:
        tilt, yaw, roll: [deg].
    """
    return _about(2, yaw) @ _about(1, -tilt) @ _about(0, roll)


def _about(axis: int, degrees: float) -> np.ndarray:
    """Rotation about a coordinate axis."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    return turn


def _longest(start: np.ndarray, end: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Axis of the largest second moment of volume."""
    points = np.concatenate([start, end])
    moment = np.einsum("n,ni,nj->ij", np.tile(volume, 2), points, points)
    if np.abs(moment).max() < SAME**2 * volume.sum():
        return np.array([1.0, 0.0, 0.0])  # concentric spheres have no axis
    axis = np.linalg.eigh(moment)[1][:, -1]
    return np.round(axis * np.sign(axis[np.argmax(np.abs(axis))]), 12)


def _frame(x: np.ndarray) -> np.ndarray:
    """Rows: x as given, z as near to the third coordinate as can be, or to the first where x is the third."""
    up = np.eye(3)[2 if abs(x[2]) < 0.999 else 0]
    z = up - (up @ x) * x
    z /= np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def _body(scene: Scene, name: str | None) -> Body:
    names = [b.name for b in scene.bodies]
    if name is None and len(names) == 1:
        return scene.bodies[0]
    if name not in names:
        shown = ", ".join(itertools.islice(names, 8)) or "nothing, the scene has no body"
        raise InputError(f"body is {name}; allowed: {shown}")
    return scene.bodies[names.index(name)]
