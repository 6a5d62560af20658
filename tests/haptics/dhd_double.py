"""A module with the functions of `forcedimension_core.dhd` that otwarp calls, for tests: same names, same arguments.

`test_forcedimension` compares the signatures with those of the package, where it is installed.
"""

from __future__ import annotations

import threading
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from types import ModuleType

PATIENCE = 60.0
"""Seconds after which a test that waits for the thread fails instead of hanging; nothing is measured by it."""
FUNCTIONS = (
    *("openID", "openSerial", "close", "stop", "enableForce", "setForce", "getPosition", "getButtonMask"),
    *("getDeviceCount", "getSerialNumber", "getSystemName", "getSystemType", "errorGetLastStr", "getStatus"),
)
EXPERT = ("enableExpertMode", "disableExpertMode", "setWatchdog")
"""Of `forcedimension_core.dhd.expert`."""


@dataclass
class Status:
    """What otwarp reads of `forcedimension_core.containers.Status`."""

    force: bool = False
    forceoffcause: int = 0


@dataclass
class Robot:
    """One device: axes of the SDK, metres, newtons."""

    serial: int
    type: int = 33
    name: str | None = "omega.3"
    plugged: bool = True
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    buttons: int = 0
    guarded: bool = False
    powered: bool = True
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    forces: list[tuple[float, float, float]] = field(default_factory=list)
    open: bool = False
    enabled: bool = False
    braked: bool = False
    watchdog: int | None = 0
    """Ticks; None where the firmware has none."""
    off_by: int = 0
    turns: int = 0
    threads: set[str] = field(default_factory=set)


class Dhd:
    """The SDK with some devices; ids are their places plus 3, lest an index pass for an id."""

    def __init__(self, *robots: Robot):
        self.robots = list(robots)
        self.mistakes: list[str] = []
        self.expert = False
        self.changed = threading.Condition()
        self._error = threading.local()

    def module(self) -> ModuleType:
        """What `import forcedimension_core` shall find."""
        package, dhd = ModuleType("forcedimension_core"), ModuleType("forcedimension_core.dhd")
        for name in FUNCTIONS:
            setattr(dhd, name, getattr(self, name))
        dhd.expert = ModuleType("forcedimension_core.dhd.expert")  # type: ignore[attr-defined]
        for name in EXPERT:
            setattr(dhd.expert, name, getattr(self, name))
        package.dhd = dhd  # type: ignore[attr-defined]
        return package

    def containers(self) -> ModuleType:
        """What `import forcedimension_core.containers` shall find."""
        module = ModuleType("forcedimension_core.containers")
        module.Status = Status  # type: ignore[attr-defined]
        return module

    def turn(self, robot: Robot, n: int = 2) -> None:
        """Wait until a robot was served n times more, the last time with what is so now."""
        with self.changed:
            until = robot.turns + n
            assert self.changed.wait_for(lambda: robot.turns >= until, PATIENCE), "it is not served"

    def _robot(self, ID: int, call: str) -> Robot | None:
        robot = self.robots[ID - 3] if 3 <= ID < 3 + len(self.robots) else None
        if robot is None or not robot.open:
            self.mistakes.append(f"{call} of {ID}, which is not open")
            self._error.text = "invalid device ID"
            return None
        robot.threads.add(threading.current_thread().name)
        if not robot.plugged:
            self._error.text = "communication error\n"
            return None
        return robot

    # the package's functions

    def errorGetLastStr(self) -> str:
        return getattr(self._error, "text", "no error")

    def getDeviceCount(self) -> int:
        return sum(robot.plugged for robot in self.robots)

    def openID(self, index: int) -> int:
        here = [robot for robot in self.robots if robot.plugged]
        return self._opened(here[index]) if 0 <= index < len(here) else self._none()

    def openSerial(self, serial: int) -> int:
        for robot in self.robots:
            if robot.plugged and robot.serial == serial:
                return self._opened(robot)
        return self._none()

    def _opened(self, robot: Robot) -> int:
        robot.open = True
        return self.robots.index(robot) + 3

    def _none(self) -> int:
        self._error.text = "no device found"
        return -1

    def close(self, ID: int = -1) -> int:
        robot = self.robots[ID - 3]
        if not robot.open:
            self.mistakes.append(f"close of {ID}, which is not open")
            return -1
        robot.open = robot.enabled = False
        with self.changed:
            self.changed.notify_all()
        return 0 if robot.plugged else -1

    def stop(self, ID: int = -1) -> int:
        if (robot := self._robot(ID, "stop")) is None:
            return -1
        robot.enabled, robot.braked = False, True
        return 0

    def enableForce(self, enable: bool, ID: int = -1) -> int:
        robot = self._robot(ID, "enableForce")
        if robot is None or not robot.powered:
            self._error.text = "device not ready"
            return -1
        robot.enabled, robot.braked = enable, False
        return 0

    def getStatus(self, out: Status, ID: int = -1) -> int:
        if (robot := self._robot(ID, "getStatus")) is None:
            return -1
        out.force, out.forceoffcause = robot.enabled, robot.off_by
        return 0

    def enableExpertMode(self) -> int:
        self.expert = True
        return 0

    def disableExpertMode(self) -> int:
        self.expert = False
        return 0

    def setWatchdog(self, duration: int, ID: int = -1) -> int:
        robot = self._robot(ID, "setWatchdog")
        if robot is None or not self.expert or robot.watchdog is None:
            return -1
        robot.watchdog = duration
        return 0

    def getSystemType(self, ID: int = -1) -> int:
        robot = self._robot(ID, "getSystemType")
        return robot.type if robot else 0

    def getSystemName(self, ID: int = -1) -> str | None:
        robot = self._robot(ID, "getSystemName")
        return robot.name if robot else None

    def getSerialNumber(self, ID: int = -1) -> int:
        robot = self._robot(ID, "getSerialNumber")
        return robot.serial if robot else -1

    def getButtonMask(self, ID: int = -1) -> int:
        robot = self._robot(ID, "getButtonMask")
        return robot.buttons if robot else 0

    def getPosition(self, out: MutableSequence[float], ID: int = -1) -> int:
        if (robot := self._robot(ID, "getPosition")) is None:
            return -1
        out[0], out[1], out[2] = robot.position
        with self.changed:
            robot.turns += 1
            self.changed.notify_all()
        return 1 if robot.guarded else 0

    def setForce(self, f: Sequence[float], ID: int = -1) -> int:
        if (robot := self._robot(ID, "setForce")) is None:
            return -1
        robot.force = (f[0], f[1], f[2])
        robot.forces.append(robot.force)
        return 2 if max(map(abs, robot.force)) > 10.0 else 0
