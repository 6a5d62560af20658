"""What is played back: moments of one world, by number, with what curves need of many of them at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from otwarp.scene import Scene
from otwarp.teleop import PaceNow
from otwarp.teleop.page.protocol import PageFrame

CURVED = ("position", "contact_load", "trap_distance", "trap_power")
"""What curves are made of."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Moments:
    """n moments of one world, float64.

    Attributes:
        time: (n,) [s].
        position: (n, B, 3), where space repeats as if it did not [µm].
        contact_load: (n, B) [pN].
        trap_distance, trap_power: (n, T) [µm], [mW].
        came_in: (n, B) how often a body has come in again at an inlet, zeros without one.
    """

    time: np.ndarray
    position: np.ndarray
    contact_load: np.ndarray
    trap_distance: np.ndarray
    trap_power: np.ndarray
    came_in: np.ndarray


class Source(Protocol):
    """A recorded run, or a trial that has been run again."""

    @property
    def title(self) -> str:
        """What a user calls it."""
        ...

    @property
    def scene(self) -> Scene:
        """What was simulated."""
        ...

    @property
    def time(self) -> np.ndarray:
        """(n,) times of all moments, rising [s]."""
        ...

    @property
    def held(self) -> np.ndarray:
        """(T,) index of the body that each trap holds, −1 for none."""
        ...

    @property
    def about(self) -> tuple[tuple[str, str], ...]:
        """What it is and how it was computed: names and values."""
        ...

    def frame(self, index: int) -> PageFrame:
        """The moment of a number, as the page draws it."""
        ...

    def moments(self, which: slice) -> Moments:
        """Many moments."""
        ...


def page_frame(index: int, time: float, arrays: dict[str, np.ndarray]) -> PageFrame:
    """A moment as the page draws it, without hands and pace.

    Args:
        index: Its number.
        time: [s].
        arrays: Fields of `PageFrame`: `position`, `orientation`, `trap_position`, `trap_power`, `trap_force`,
            `trap_distance`, `contact_force` and `contact_load`.
    """
    shown: dict[str, Any] = {name: np.asarray(values, dtype=np.float32) for name, values in arrays.items()}
    return PageFrame(
        stamp=0.0,
        beat=index,
        time=time,
        **shown,
        hand_force=np.zeros((2, 3), dtype=np.float32),
        hands=(),
        servo=None,
        pace=PaceNow(),
        warnings=(),
        task="",
        recording=None,
    )
