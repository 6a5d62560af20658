"""Ctrl-C and SIGTERM wait until all files of a run have the same frames."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

NUMBERS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Call handlers of these signals when the block is left, and not within it.

    Signals that end the process without Python do so as ever. Handlers are called in the main thread alone: in others
    nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: handler for number in NUMBERS if callable(handler := signal.getsignal(number))}
    came: list[tuple[int, FrameType | None]] = []
    waiting = True

    def hear(number: int, frame: FrameType | None) -> None:
        """Remember the signal, or pass it on where it comes while handlers are put back."""
        if waiting:
            came.append((number, frame))
        else:
            handlers[number](number, frame)

    try:
        for number in handlers:
            signal.signal(number, hear)
        yield
    finally:
        waiting = False
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number, frame in came:
            handlers[number](number, frame)
