"""Where the servo's thread and the thread of a device's driver meet, without either waiting for the other.

The servo puts the newest force and takes the newest sample, the driver's thread the other way round. Each value is one
tuple that is replaced whole, which CPython does in one step; there is no lock. The force that the driver takes fades
with its age, so a servo that has stopped, or was killed with its driver alive, leaves no force on.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from otwarp.haptics.core import ZERO, DeviceLost, DeviceSample, Vec3

HOLD, GONE = 0.02, 0.1
"""Seconds after its writing at which a force starts to fall, and at which it is zero: those of the chain's watchdog."""
SILENCE = 0.1
"""Seconds without a sample after which the buttons count as released: nobody is known to hold them."""
LOST = 0.5
"""Seconds without a sample after which the device counts as gone, whatever its driver says."""
ENDING = 0.5
"""Seconds that `close` waits for the last to be sent; a device that hangs longer is left to the thread."""

T = TypeVar("T")


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


class LatestSender(Generic[T]):
    """Sends the newest of what it is handed from a thread of its own, for links that make the sender wait.

    A write to a HID device by USB waits until the transfer is done: some milliseconds, 5 s if the device hangs. A servo
    that has 1 ms cannot do that. What is handed over while a transfer runs replaces what waits: old forces are of no
    use.

    Args:
        send: Sends one; called from the thread only. After an OSError nothing more is sent.
        ended: Called by the thread when nothing more will be sent and `close` was called: closes what `send` writes to,
            which must not vanish, or become another file, while a write is under way.
    """

    def __init__(self, send: Callable[[T], None], ended: Callable[[], None]):
        self._send, self._ended = send, ended
        self._slot: deque[T] = deque(maxlen=1)
        self._error: OSError | None = None
        self._ending = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name="latest-sender", daemon=True)
        self._thread.start()

    def put(self, latest: T) -> None:
        """Hand over the newest; never waits.

        Raises:
            OSError: One that was handed over before could not be sent.
        """
        if self._error is not None:
            raise self._error
        self._slot.append(latest)
        self._wake.set()

    def close(self, last: T, wait: bool = True) -> None:
        """Send the last, if that is still possible, and end; without `wait` behind the caller's back."""
        self._slot.append(last)
        self._ending = True
        self._wake.set()
        if wait:
            self._thread.join(ENDING)

    def _run(self) -> None:
        try:
            while True:
                self._wake.wait()
                self._wake.clear()
                ending = self._ending  # before the slot: `close` fills them in the other order
                if self._error is None:
                    self._empty()
                if ending:
                    return
        finally:
            self._ended()

    def _empty(self) -> None:
        """Send what is in the slot, if anything."""
        try:
            self._send(self._slot.pop())
        except (IndexError, BlockingIOError):
            pass  # nothing there, or no room in the kernel's queue: a newer one will come
        except OSError as error:
            self._error = error
