"""`Frame`: what one moment of a run looked like, on the host."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.scene import Scene

SHAPES: dict[str, tuple[str, int]] = {
    "position": ("body", 3),
    "orientation": ("body", 4),
    "trap_position": ("trap", 3),
    "trap_power": ("trap", 0),
    "trap_force": ("trap", 3),
    "trap_distance": ("trap", 0),
    "escape_time": ("trap", 0),
    "contact_force": ("body", 3),
    "contact_load": ("body", 0),
}
"""Field → what its second axis counts, and the length of its last axis (0: none)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """One recorded moment of W worlds with B bodies and T traps. Obstacle poses are functions of time.

    Attributes:
        step: Steps taken since the start.
        time: Simulated time [s].
        position: (W, B, 3) origins of the bodies' prims [µm].
        orientation: (W, B, 4) quaternions (x, y, z, w) of the bodies' prims.
        trap_position: (W, T, 3) foci [µm].
        trap_power: (W, T) [mW].
        trap_force: (W, T, 3) force of each trap on the bodies [pN].
        trap_distance: (W, T) between a trap and the sphere it holds, nan if it holds none [µm].
        escape_time: (W, T) when the held sphere was first out of its trap's reach, nan if it never was [s].
        contact_force: (W, B, 3) net contact force [pN].
        contact_load: (W, B) sum of the magnitudes of the normal forces [pN].
    """

    step: int
    time: float
    position: np.ndarray
    orientation: np.ndarray
    trap_position: np.ndarray
    trap_power: np.ndarray
    trap_force: np.ndarray
    trap_distance: np.ndarray
    escape_time: np.ndarray
    contact_force: np.ndarray
    contact_load: np.ndarray

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return self.position.shape[0]

    def check(self, scene: Scene, worlds: int | None = None) -> None:
        """Compare every shape with the scene.

        Args:
            scene: The scene that is being run.
            worlds: Number of worlds wanted, or None for whatever `position` has.

        Raises:
            ValueError: An array of another shape, or a time that is not finite.
        """
        count = {"body": len(scene.bodies), "trap": len(scene.traps)}
        worlds = self.worlds if worlds is None else worlds
        for name, (axis, width) in SHAPES.items():
            wanted = (worlds, count[axis], *((width,) if width else ()))
            if getattr(self, name).shape != wanted:
                raise ValueError(f"frame {name} has shape {getattr(self, name).shape}; allowed: {wanted}")
        if not np.isfinite(self.time):
            raise ValueError(f"frame time is {self.time}; allowed: a finite time [s]")
