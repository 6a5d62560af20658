"""What of a body's pose can be seen: its centre, its long axis, and the turns after which it looks the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.scene import Scene
from otwarp.scene.transforms import quaternions, rotation_matrix
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.tracking.rotations import difference, product


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """A body as images show it; centre and axis are those of the labels of data sets (`Robot`).

    Attributes:
        arm: (3) from the centre of diffusion to the centre, in the frame of the prim [µm].
        origin: (3) from the centre of diffusion to the origin of the prim, in that frame [µm].
        axis: (3) unit vector along its long axis in that frame; zeros for a ball.
        reversible: Whether the axis and its opposite look the same.
        revolves: Whether any turn about the axis looks the same.
        group: (g, 4) quaternions of the turns after which it looks the same, the identity first; of a body that
            revolves, one for each end.
    """

    arm: np.ndarray
    origin: np.ndarray
    axis: np.ndarray
    reversible: bool
    revolves: bool
    group: np.ndarray

    @classmethod
    def of(cls, scene: Scene, body: str, reference: np.ndarray, axis: np.ndarray | None = None) -> Shape:
        """Of a body of a scene.

        Args:
            scene: The scene.
            body: Its name.
            reference: (3) its centre of diffusion in the frame of its prim [µm].
            axis: (3) direction that counts as its long axis; None: along which its volume reaches farthest.

        Raises:
            InputError: No such body.
        """
        robot = Robot.of_body(scene, body, axis)
        looks, frame = robot.symmetry(), robot.frame
        turns = np.array([frame.T @ np.array(turn) @ frame for turn in looks["rotations"]])
        ball = looks["spherical"]
        return cls(
            arm=robot.center - reference, origin=-np.asarray(reference, dtype=float),
            axis=np.zeros(3) if ball else frame[0], reversible=looks["flip"] and not ball,
            revolves=looks["axial"] and not ball, group=quaternions(turns[:1] if ball else turns),
        )  # fmt: skip

    def nearest(self, orientation: np.ndarray, to: np.ndarray) -> np.ndarray:
        """(4) of the orientations that look like `orientation` (4), the one nearest to `to` (4)."""
        choices = [product(orientation, g) for g in self.group] if len(self.group) > 1 else [orientation]
        if self.revolves:
            choices = [self._rolled(q, to) for q in choices]
        return min(choices, key=lambda q: float(np.linalg.norm(difference(q, to)))) if len(choices) > 1 else choices[0]

    def _rolled(self, orientation: np.ndarray, to: np.ndarray) -> np.ndarray:
        """An orientation of the same axis that is turned about it to be nearest to another."""
        x, y, z, w = orientation
        between = product((-x, -y, -z, w), to)
        # of all turns about the axis, the part of `between` that lies along it
        part = np.array([*(self.axis * float(between[:3] @ self.axis)), between[3]])
        length = np.linalg.norm(part)
        return orientation if length < 1e-9 else product(orientation, part / length)

    def visible(self, turn: np.ndarray) -> np.ndarray:
        """(k, 6) rows: the directions of error that images can show of a body with orientation `turn` (4)."""
        if not np.any(self.axis):
            return np.eye(3, 6)
        if not self.revolves:
            return np.eye(6)
        axis = rotation_matrix(turn) @ self.axis
        first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        first = first / np.linalg.norm(first)
        rows = np.zeros((5, 6))
        rows[:3, :3] = np.eye(3)
        rows[3, 3:], rows[4, 3:] = first, np.cross(axis, first)
        return rows

    def without_roll(self, turn: np.ndarray) -> np.ndarray:
        """(6, 6) that takes turns of a body of revolution about its axis out of an error: they mean nothing, and their
        growing variance would spoil that of the axis as this moves. For other bodies 1.

        Args:
            turn: (4) orientation of the body.
        """
        out = np.eye(6)
        if self.revolves:
            axis = rotation_matrix(turn) @ self.axis
            out[3:, 3:] -= np.outer(axis, axis)
        return out
