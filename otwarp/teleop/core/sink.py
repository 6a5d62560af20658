"""`Outlet`: whoever watches a session and asks things of it: the page, ROS, a recording, a program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from otwarp.teleop.core.commands import Command
from otwarp.teleop.core.frame import LiveFrame


class Outlet(Protocol):
    """All calls come from the loop's thread and must not block: what cannot be sent now is dropped."""

    @property
    def interval(self) -> float:
        """Least time between two frames that it wants [s]; 0 for every frame."""
        ...

    def publish(self, live: LiveFrame) -> None:
        """Take a frame."""
        ...

    def commands(self) -> Sequence[Command]:
        """What was asked since the last call, in order."""
        ...

    def complain(self, line: str) -> None:
        """A command was refused, or something else went wrong that its user should read."""
        ...

    def close(self) -> None:
        """The session ends; may be called more than once."""
        ...
