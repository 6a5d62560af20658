"""SIGTERM, as batch schedulers send it, ends a run the way Ctrl-C does, with its files finished; neither gets lost."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

EXIT_INTERRUPTED = 130


class Terminated(KeyboardInterrupt):
    """Raised in a run that SIGTERM ends."""


answered = False
"""Whether an interrupt has come to where it ends the command: those that follow while the last line is written are let
go. Set by an assignment, between which and the `except` above no handler is called."""

_asked = threading.Event()
_interrupted = threading.Event()
_begun = threading.Event()


def begin() -> None:
    """From now on there are files or processes that an interrupt must not leave unfinished; raises if one came."""
    check()
    _begun.set()


def check_terminated() -> None:
    """Raise `Terminated` if SIGTERM came."""
    if _asked.is_set():
        raise Terminated("terminated")


def check() -> None:
    """Raise if Ctrl-C or SIGTERM came; called once a frame, and before what would not end by itself.

    The handlers raise as well, to end long work between frames, but an exception that appears inside a destructor, a
    callback or an import of a library may be swallowed there: the events are what counts.
    """
    check_terminated()
    if _interrupted.is_set():
        raise KeyboardInterrupt


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle Ctrl-C: raise, or while modules are imported and nothing has begun, end the process.

    Libraries in C may swallow an exception, or go on half imported, where their imports are cut short.
    """
    if answered:
        return
    _interrupted.set()
    if not _begun.is_set() and _importing(frame):
        os.write(2, b"otwarp: interrupted\n")
        os._exit(EXIT_INTERRUPTED)
    raise KeyboardInterrupt


def leave(code: int) -> int:
    """What a process ends with; an interrupt from now on ends it at once, with the same code and without a word.

    Python goes on for a while: it joins threads, calls what was registered, and lets go of handlers, after which Ctrl-C
    would end the process by the signal. Call `forget_at_the_end` as early as possible as well.
    """

    def quit_at_once(*_: object) -> None:
        """Write what is still to be written, and go."""
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):  # whoever read it has gone, or the signal came while it was flushed
                stream.flush()
        os._exit(code)

    if signal.getsignal(signal.SIGINT) is interrupt:
        signal.signal(signal.SIGINT, quit_at_once)
    return code


def forget_at_the_end() -> None:
    """Ignore Ctrl-C behind all that is registered later for the end of the process; the rest takes half a second."""
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def terminable() -> Iterator[None]:
    """Turn the first SIGTERM into an exception; further ones must not cut off the finishing of files.

    Ctrl-C raises `KeyboardInterrupt` each time, as ever, and is remembered.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    global answered
    answered = False
    for event in (_asked, _interrupted, _begun):
        event.clear()

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
        for event in (_asked, _interrupted, _begun):
            event.clear()
