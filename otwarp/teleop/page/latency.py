"""How old the state is that a browser shows: from the session's `publish` to an answer of the browser that has it.

The browser answers a request that it takes from the same connection, after the messages of the frame. The way back is
in the figure, and the drawing after it is not: an upper bound of the arrival, not of the light on the screen.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser

INTERVAL = 1.0
GIVE_UP = 2.0
"""Seconds between two requests, and after which one counts as unanswered: a window in the background sleeps."""
KEY = "otwarp-echo"


class Latency:
    """Asks one browser after the other, in a thread of its own."""

    def __init__(self, server: viser.ViserServer, clock: Callable[[], float]):
        self._server, self._clock = server, clock
        self._stamp: float | None = None
        self._asked = threading.Event()
        self._turn = 0
        self.delay: float | None = None
        """The latest answer [s], None without one."""
        threading.Thread(target=self._run, daemon=True, name="page-latency").start()

    def shown(self, stamp: float) -> None:
        """A frame of this time was handed to the connections just now; asks if it is time to."""
        if not self._asked.is_set():
            self._stamp = stamp
            self._asked.set()

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._measure()
            time.sleep(INTERVAL)
            self._asked.clear()

    def _measure(self) -> None:
        clients, stamp = list(self._server.get_clients().values()), self._stamp
        if not clients or stamp is None:
            self.delay = None
            return
        self._turn += 1
        try:
            clients[self._turn % len(clients)].local_storage.get_item(KEY, timeout=GIVE_UP)
            self.delay = self._clock() - stamp
        except (RuntimeError, TimeoutError):
            self.delay = None
