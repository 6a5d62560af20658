"""`Recordings`: the take that a live loop writes, and those that are still being finished beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from otwarp.haptics.core.types import SceneFrame
from otwarp.teleop.core.commands import Command
from otwarp.teleop.core.frame import LiveFrame


class Take(Protocol):
    """A recording that is being written; but for `close`, nothing in it blocks."""

    @property
    def file(self) -> Path:
        """Where it will be once it is closed."""
        ...

    @property
    def complaint(self) -> str:
        """One line about what is missing in it, or ""."""
        ...

    def frame(self, live: LiveFrame, scene: SceneFrame | None) -> None:
        """A frame, and the state that was published to the servo with it."""
        ...

    def command(self, command: Command, wall: float) -> None:
        """A command that was carried out."""
        ...

    def end(self) -> bool:
        """Begin to finish the file, or go on with it; whether that is done."""
        ...

    def close(self) -> None:
        """Finish the file, and wait for it."""
        ...


class Recordings:
    """At most one take that is written, and any number that have ended."""

    def __init__(self) -> None:
        self.take: Take | None = None
        self._ending: list[Take] = []

    @property
    def file(self) -> Path | None:
        """That is being written."""
        return self.take.file if self.take else None

    @property
    def complaint(self) -> str:
        """What is missing in it, or ""."""
        return self.take.complaint if self.take else ""

    def end(self) -> None:
        """No more comes; to wait for the disk here would be a stall that disarms the hands."""
        take, self.take = self.take, None
        if take is not None:
            take.end()
            self._ending.append(take)

    def finished(self) -> list[OSError]:
        """Let go of those that are finished; why some could not be."""
        return self._close([take for take in self._ending if take.end()])

    def close(self) -> None:
        """Finish all, and wait for them.

        Raises:
            OSError: One could not be finished.
        """
        self.end()
        for error in self._close(tuple(self._ending)):
            raise error

    def _close(self, takes: Sequence[Take]) -> list[OSError]:
        errors: list[OSError] = []
        for take in takes:
            self._ending.remove(take)
            try:
                take.close()
            except OSError as error:
                errors.append(error)
        return errors
