"""Sends the newest of what it is handed from a thread of its own, for links that make the sender wait.

A write to a HID device by USB waits until the transfer is done: some milliseconds, 5 s if the device hangs. A servo
that has 1 ms cannot do that. What is handed over while a transfer runs replaces what waits: old forces are of no use.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

ENDING = 0.5
"""Seconds that `close` waits for the last to be sent; a device that hangs longer is left to the thread."""


class LatestSender(Generic[T]):
    """A slot and the thread that empties it.

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
