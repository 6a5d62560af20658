"""A pointer of the page as a device: the page says where it wants the hand, the hand goes there at a limited speed.

The page runs in a process of its own and writes into a mailbox that the owner of the servo creates. It writes at least
every `SILENCE` seconds while it lives, also if nothing moved: one that has gone holds no dead-man switch.
"""

from __future__ import annotations

import math

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.core.shared_memory import Mailbox, RecordLayout
from otwarp.haptics.devices import DeviceSpec

POINTER = RecordLayout(b"pointer", "3dQ")
"""Target x, y, z [m] in the device's frame, and buttons."""
SILENCE = 0.5
"""Seconds without a word from the page after which its buttons count as released."""
SPEED = 0.5
"""Fastest that the hand follows the pointer [m/s]: that of a hand, so that a jump of the pointer is none of a trap."""
LONGEST_STEP = 0.1
"""Seconds of movement that one reading may catch up."""


class MouseDevice:
    """A point that follows a pointer of the page.

    Args:
        pointer: Name of the mailbox (`Mailbox.create(POINTER)`) that the page writes.
        name: As the user named it.
        speed: Fastest that it follows [m/s].
    """

    def __init__(self, pointer: str, name: str = "mouse", speed: float = SPEED):
        if not 0.0 < speed <= 100.0:
            raise InputError(f"speed = {speed!r} m/s: must be above 0 and at most 100")
        self._pointer, self._speed = pointer, speed
        self.info = DeviceInfo(name=name, kind="mouse")
        self._box: Mailbox[tuple[float, ...]] | None = None
        self._position: Vec3 = ZERO
        self._target: Vec3 = ZERO
        self._buttons = 0
        self._heard = self._time = -math.inf

    def open(self) -> None:
        """Find the page's mailbox.

        Raises:
            InputError: There is none of that name.
        """
        self.close()
        self._box = Mailbox.attach(POINTER, self._pointer)
        self._heard = self._time = -math.inf

    def read(self, time: float) -> DeviceSample:
        """See `Device`; a target that is not finite is ignored."""
        if self._box is None:
            raise DeviceLost(f"{self.info.name} is not open")
        word = self._box.read()
        if word is not None:
            x, y, z, buttons = word
            self._buttons, self._heard = int(buttons), time
            if math.isfinite(x + y + z):
                self._target = (x, y, z)
        silent = time - self._heard > SILENCE
        self._follow(min(max(time - self._time, 0.0), LONGEST_STEP))
        self._time = time
        return DeviceSample(time, self._position, 0 if silent else self._buttons, not silent)

    def _follow(self, seconds: float) -> None:
        """Go towards the target, no farther than the speed allows."""
        (x, y, z), (u, v, w) = self._position, self._target
        dx, dy, dz = u - x, v - y, w - z
        distance, reach = math.sqrt(dx * dx + dy * dy + dz * dz), self._speed * seconds
        if distance <= reach:
            self._position = self._target
        elif distance < math.inf:
            k = reach / distance
            self._position = (x + k * dx, y + k * dy, z + k * dz)

    def write(self, force: Vec3) -> None:
        """Ignores the force: there are no motors."""

    def close(self) -> None:
        """See `Device`."""
        box, self._box = self._box, None
        if box is not None:
            box.close()


def create(spec: DeviceSpec) -> MouseDevice:
    """`mouse`, for a hand with a pointer mailbox."""
    if spec.pointer is None:
        raise InputError(f"device {spec.text!r}: needs a page; hand {spec.hand} has no pointer mailbox")
    return MouseDevice(spec.pointer, spec.text)
