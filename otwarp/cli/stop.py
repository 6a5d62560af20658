"""SIGTERM, as batch schedulers send it: ends a run the way Ctrl-C does, with its files finished."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Terminated(KeyboardInterrupt):
    """SIGTERM came."""


_asked = threading.Event()


def check() -> None:
    """Raise `Terminated` if SIGTERM came; called once a frame.

    The handler raises as well, to end long work between frames, but an exception that appears inside a destructor or a
    callback of a library is swallowed there: the event is what counts.
    """
    if _asked.is_set():
        raise Terminated("terminated")


@contextmanager
def terminable() -> Iterator[None]:
    """Turn the first SIGTERM into an exception; further ones must not cut off the finishing of files."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _asked.clear()

    def stop(*_: object) -> None:
        if not _asked.is_set():
            _asked.set()
            raise Terminated("terminated")

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before if before is not None else signal.SIG_DFL)
        _asked.clear()
