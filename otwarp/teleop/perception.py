"""What a live loop asks of perception: a camera's images that say where the bodies of its twin are.

The loop knows no cameras and no networks; `otwarp.perception` has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from otwarp.haptics.core import Vec3
from otwarp.simulation.simulation import Simulation


class Picture(Protocol):
    """A piece of a camera's frame."""

    @property
    def levels(self) -> np.ndarray:
        """(height, width) grey levels, row 0 the lowest."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyNow:
    """A body that a camera follows.

    Attributes:
        body: Index in the scene.
        name: Of it.
        why: Why it is lost, one line; "" while it is seen.
        deviation: Standard deviations of its place along x, y, z [µm]; None before it was seen.
        piece: Of the newest frame, where it was looked for; None if there was no new one.
    """

    body: int
    name: str
    why: str
    deviation: Vec3 | None
    piece: Picture | None


@dataclass(frozen=True, eq=False, kw_only=True)
class PerceptionNow:
    """What a camera sees at present.

    Attributes:
        camera: Its name.
        ended: Why it gives no more frames, or "".
        rate: Frames that are looked at per second.
        bodies: Those that are followed.
    """

    camera: str
    ended: str
    rate: float
    bodies: tuple[BodyNow, ...]


class Perception(Protocol):
    """All calls come from the loop's thread, and none but `start` waits."""

    def start(self) -> None:
        """Open the camera.

        Raises:
            InputError: It is not there.
        """
        ...

    def update(self, sim: Simulation, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """Put the bodies that are seen where they are now, by where the traps are [µm, mW]."""
        ...

    def published(self) -> None:
        """The state that came of it is with the servo."""
        ...

    @property
    def blind(self) -> frozenset[int]:
        """Traps that hold a body which should be seen and is not: their hands must feel nothing."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the operator must know, one line each."""
        ...

    def now(self) -> PerceptionNow:
        """What is seen."""
        ...

    def restart(self) -> None:
        """The session begins anew."""
        ...

    def summary(self) -> dict[str, Any]:
        """Figures of the session; `text` says them to a reader."""
        ...

    def close(self) -> None:
        """Let go of the camera; may be called more than once."""
        ...
