"""What a camera is, whatever is behind it: frames with the time of their light, and where it is to look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class CameraLost(Exception):
    """A camera that was open gives no more frames; one line says why."""


@dataclass(frozen=True, slots=True)
class Region:
    """A piece of a camera's frame.

    Attributes:
        left, low: Column and row of its first pixel; row 0 is the lowest. It may reach beyond the frame.
        width, height: [pixels].
    """

    left: int
    low: int
    width: int
    height: int

    @property
    def middle(self) -> tuple[int, int]:
        """Column and row of its middle pixel, (width // 2, height // 2) of it."""
        return self.left + self.width // 2, self.low + self.height // 2


@dataclass(frozen=True, eq=False)
class Piece:
    """What a camera recorded of a region.

    Attributes:
        left, low: Column and row of its first pixel in the camera's frame.
        levels: (height, width) grey levels, row 0 the lowest.
    """

    left: int
    low: int
    levels: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraFrame:
    """One exposure.

    Attributes:
        number: Counts the camera's exposures; one that is missing was lost or skipped.
        time: Middle of the exposure, on the session's clock, as the source says [s].
        exposure: [s].
        pieces: The whole frame, or those regions that were asked for.
        made: What computing it took, where a simulation stands for the camera [s]; else 0.
        sent: When the source handed it on, on the session's clock [s].
    """

    number: int
    time: float
    exposure: float
    pieces: tuple[Piece, ...]
    made: float = 0.0
    sent: float = 0.0


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """What a camera is.

    Attributes:
        name: As the user named it.
        kind: Its row in `kinds.KINDS`.
        simulated: Whether a simulation stands for it.
        stand_in: What this binding was tested with, where no camera has met it; "" where one has, or none is needed.
        stamped: Whether its times are those of the light; else of the arrival of a frame, less half an exposure.
        size: Pixels of its whole frames (width, height), where they are known before the first one.
    """

    name: str
    kind: str
    simulated: bool = False
    stand_in: str = ""
    stamped: bool = True
    size: tuple[int, int] | None = None

    @property
    def met_hardware(self) -> bool:
        """Whether nothing had to stand in for the hardware."""
        return not self.stand_in

    @property
    def caution(self) -> str:
        """One line for who uses a camera whose binding never met one, or ""."""
        if self.met_hardware:
            return ""
        return f"camera {self.name}: this way was tested with {self.stand_in}; no camera has met it"


class Camera(Protocol):
    """A source of frames; all calls come from one thread, and none but `open` waits."""

    @property
    def info(self) -> CameraInfo:
        """What it is."""
        ...

    def open(self) -> None:
        """Find it and start it.

        Raises:
            InputError: It is not there, or gives what nobody can use; one line.
        """
        ...

    def aim(self, regions: Sequence[Region]) -> None:
        """Where it is to look from now on; a camera that has only whole frames gives these."""
        ...

    def read(self, now: float) -> CameraFrame | None:
        """The latest frame, if it is new; older ones that nobody read are dropped.

        Args:
            now: Time of the session's clock [s].

        Raises:
            CameraLost: There will be no more.
        """
        ...

    def close(self) -> None:
        """Let go of it; may be called at any time, more than once."""
        ...
