"""`Looker`: who reads the camera and asks the estimator, in the session's process or beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from otwarp.perception.camera import Camera, CameraInfo
from otwarp.perception.estimator import Estimator, Look, Wanted


@runtime_checkable
class Driven(Protocol):
    """A camera whose laboratory is moved by the session's traps."""

    def command(self, when: float, position: np.ndarray, power: np.ndarray) -> None:
        """Traps are told something; see `plant.Plant.follow`."""
        ...

    def restart(self) -> None:
        """Begin anew with the next command."""
        ...


class Looker(Protocol):
    """All calls come from the loop's thread; none but `start` and `await_look` waits."""

    @property
    def info(self) -> CameraInfo:
        """Of the camera."""
        ...

    def start(self, now: float) -> None:
        """Open the camera.

        Raises:
            InputError: It is not there.
        """
        ...

    def command(self, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """Where the traps are [µm, mW], for a camera that simulates its laboratory."""
        ...

    def want(self, wanted: Sequence[Wanted]) -> None:
        """Where bodies are to be looked for from now on."""
        ...

    def looks(self, now: float) -> list[Look]:
        """What came of frames since the last call.

        Raises:
            CameraLost: There will be no more.
        """
        ...

    def await_look(self, until: float) -> bool:
        """Return at `until` [s], or as soon as `looks` has some, and whether it has; at once if none can come."""
        ...

    def restart(self) -> None:
        """A simulated laboratory begins anew with the next command; a real one goes on."""
        ...

    def close(self) -> None:
        """Let go of the camera; may be called more than once."""
        ...


class DirectLooker:
    """Reads the camera and asks the estimator where it is called: for tests, benchmarks and replays.

    Args:
        camera: Not opened yet.
        estimator: Of its frames.
        delay: From the middle of an exposure to when its look is given out [s]; on a virtual clock that is the whole
            delay, for nothing there takes time by itself.
    """

    def __init__(self, camera: Camera, estimator: Estimator, *, delay: float = 0.0):
        self.camera, self._estimator, self._delay = camera, estimator, delay
        self._wanted: tuple[Wanted, ...] = ()
        self._waiting: list[Look] = []

    @property
    def info(self) -> CameraInfo:
        """See `Looker`."""
        return self.camera.info

    def start(self, now: float) -> None:
        """See `Looker`."""
        self.camera.open()

    def command(self, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """See `Looker`."""
        if isinstance(self.camera, Driven):
            self.camera.command(now, position, power)

    def want(self, wanted: Sequence[Wanted]) -> None:
        """See `Looker`."""
        self._wanted = tuple(wanted)
        self.camera.aim([w.region for w in wanted])

    def looks(self, now: float) -> list[Look]:
        """See `Looker`."""
        frame = self.camera.read(now)
        if frame is not None:
            self._waiting.append(self._estimator.look(frame, self._wanted, now))
        # a stamp that is ahead of the clock does not hold up its frame
        due = [look for look in self._waiting if min(look.time, look.read) + self._delay <= now + 1e-9]
        self._waiting = [look for look in self._waiting if look not in due]
        return due

    def await_look(self, until: float) -> bool:
        """See `Looker`: none does, the camera is read when looks are asked for."""
        return False

    def restart(self) -> None:
        """See `Looker`."""
        if isinstance(self.camera, Driven):
            self.camera.restart()

    def close(self) -> None:
        """See `Looker`."""
        self.camera.close()
