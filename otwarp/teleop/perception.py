"""What a live loop asks of perception: a camera's images that say where the bodies of its twin are.

The loop knows no cameras and no networks; `otwarp.perception` has them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from otwarp.haptics.core import Vec3

if TYPE_CHECKING:  # frames are also read where nothing is simulated, as in the page's process
    from otwarp.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyNow:
    """A body that a camera follows.

    Attributes:
        body: Index in the scene.
        name: Of it.
        why: Why it is lost, one line; "" while it is seen.
        deviation: Standard deviations of its place along x, y, z [µm]; None before it was seen.
        levels: (height, width) grey levels of a frame of late where it was looked for, row 0 the lowest; None before.
        outline: (n, 3) its solids there, as estimated at the time of that frame: column, row, radius [pixels].
        spread: (2, 2) covariance of its place in the image [pixels²].
    """

    body: int
    name: str
    why: str
    deviation: Vec3 | None
    levels: np.ndarray | None = None
    outline: np.ndarray | None = None
    spread: np.ndarray | None = None


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


@dataclass(frozen=True, eq=False)
class PerceptionTurn:
    """A turn of the loop, for a recording: all that it takes to come to the same again.

    Attributes:
        told: For JSON; floats are whole.
        pictures: Pieces that were looked at, in the order in which `told` has them: name of their body, (height, width)
            grey levels, time of their light on the session's clock [s].
    """

    told: Mapping[str, Any]
    pictures: tuple[tuple[str, np.ndarray, float], ...]


class Perception(Protocol):
    """All calls come from the loop's thread, and none but `start` and `await_news` waits."""

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

    def await_news(self, until: float) -> bool:
        """Return at `until` [s], or as soon as there is something for `update`, and whether there is; at once if
        nothing is due by then."""
        ...

    @property
    def blind(self) -> Mapping[int, str]:
        """Traps that hold a body which should be seen and is not, and why, one line: their hands must feel nothing."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the operator must know, one line each."""
        ...

    def now(self) -> PerceptionNow:
        """What is seen."""
        ...

    def turn(self, beat: int | None) -> PerceptionTurn:
        """The last `update`, for a recording.

        Args:
            beat: Of the state that was published after it; None: none was.
        """
        ...

    def described(self) -> Mapping[str, Any]:
        """What looks at what, for a recording; JSON."""
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
