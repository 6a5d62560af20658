"""Where the servo's thread and the thread of a device's driver meet, without either waiting for the other.

The servo puts the newest force and takes the newest sample, the driver's thread the other way round. Each value is one
tuple that is replaced whole, which CPython does in one step; there is no lock. The force that the driver takes fades
with its age, so a servo that has stopped, or was killed with its driver alive, leaves no force on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from otwarp.haptics.core.types import ZERO, DeviceLost, DeviceSample, Vec3

HOLD, GONE = 0.02, 0.1
"""Seconds after its writing at which a force starts to fall, and at which it is zero: those of the chain's watchdog."""
SILENCE = 0.1
"""Seconds without a sample after which the buttons count as released: nobody is known to hold them."""
LOST = 0.5
"""Seconds without a sample after which the device counts as gone, whatever its driver says."""


def share(age: float) -> float:
    """Share of a force that is rendered `age` seconds after it was written: 1, falling linearly, 0."""
    if age <= HOLD:
        return 1.0
    return (GONE - age) / (GONE - HOLD) if age < GONE else 0.0


class Exchange:
    """The newest force and the newest sample of one device, and whether it is lost.

    Args:
        name: Of the device, for messages.
        clock: Seconds; that of the force's age, which both threads read.
    """

    def __init__(self, name: str, clock: Callable[[], float] = time.perf_counter):
        self._name, self._clock = name, clock
        self._written: tuple[Vec3, float] = (ZERO, -math.inf)
        self._sample: tuple[int, Vec3, int] = (0, ZERO, 0)
        self._lost: str | None = None
        self._seen = 0
        self._heard: float | None = None

    # the servo's side

    def write(self, force: Vec3) -> None:
        """Leave a force [N] for the driver; one that is not finite counts as zero.

        Raises:
            DeviceLost: The driver has lost the device.
        """
        if self._lost is not None:
            raise DeviceLost(f"{self._name}: {self._lost}")
        x, y, z = force
        self._written = ((x, y, z) if math.isfinite(x + y + z) else ZERO, self._clock())

    def read(self, time: float) -> DeviceSample:
        """The newest sample at a time of the servo's clock [s].

        Raises:
            DeviceLost: The driver has lost the device, or has not spoken for `LOST`.
        """
        if self._lost is not None:
            raise DeviceLost(f"{self._name}: {self._lost}")
        count, position, buttons = self._sample
        fresh = count != self._seen
        if fresh or self._heard is None:
            self._seen, self._heard = count, time
        silent = time - self._heard
        if silent > LOST:
            raise DeviceLost(f"{self._name}: silent for {LOST:g} s")
        return DeviceSample(time, position, buttons if silent <= SILENCE else 0, fresh)

    # the driver's side

    def force(self) -> Vec3:
        """What to render now [N]: the newest force, fading with its age; never more than was written."""
        (x, y, z), when = self._written
        k = share(self._clock() - when)
        if k == 1.0:
            return (x, y, z)
        return (k * x, k * y, k * z) if k > 0.0 else ZERO

    def put(self, position: Vec3, buttons: int) -> bool:
        """Leave a sample [m] for the servo; False for a position that is not finite, which is dropped."""
        if not math.isfinite(position[0] + position[1] + position[2]):
            return False
        self._sample = (self._sample[0] + 1, position, buttons)
        return True

    def lose(self, why: str) -> None:
        """Tell the servo that the device is gone; the first reason stays."""
        if self._lost is None:
            self._lost = why
        self._written = (ZERO, -math.inf)

    @property
    def lost(self) -> str | None:
        """Why the device is gone, or None."""
        return self._lost

    @property
    def samples(self) -> int:
        """How many samples the driver has left."""
        return self._sample[0]
