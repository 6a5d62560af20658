"""SIGTERM, as batch schedulers send it, ends a run the way Ctrl-C does, with its files finished; neither gets lost."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Terminated(KeyboardInterrupt):
    """SIGTERM came."""


_asked = threading.Event()
_interrupted = threading.Event()


def check() -> None:
    """Raise `Terminated` if SIGTERM came; called once a frame.

    The handler raises as well, to end long work between frames, but an exception that appears inside a destructor or a
    callback of a library is swallowed there: the event is what counts.
    """
    if _asked.is_set():
        raise Terminated("terminated")


def check_interrupt() -> None:
    """Raise if Ctrl-C or SIGTERM came; called before what would not end by itself.

    An exception that appears while a library is being imported may be swallowed by it.
    """
    check()
    if _interrupted.is_set():
        raise KeyboardInterrupt


@contextmanager
def terminable() -> Iterator[None]:
    """Turn the first SIGTERM into an exception; further ones must not cut off the finishing of files.

    Ctrl-C raises `KeyboardInterrupt` each time, as ever, and is remembered.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _asked.clear()
    _interrupted.clear()

    def interrupt(number: int, frame: object) -> None:
        _interrupted.set()
        signal.default_int_handler(number, frame)  # type: ignore[arg-type]

    def stop(*_: object) -> None:
        if not _asked.is_set():
            _asked.set()
            raise Terminated("terminated")

    ends = [signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]  # a terminal that is closed
    before = {number: signal.getsignal(number) for number in ends}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN or number == signal.SIGTERM:  # `nohup` means it
            signal.signal(number, stop)
    was = signal.getsignal(signal.SIGINT)
    ours = was is signal.default_int_handler  # a program that ignores it, or has a handler of its own, keeps it
    if ours:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        _asked.clear()
