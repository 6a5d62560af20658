"""Pieces of shared memory by name: made with all their pages, attached without taking over, let go by their owner."""

from __future__ import annotations

import os
import sys
import threading
import weakref
from contextlib import suppress
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Self

from otwarp.errors import InputError

PLACE = Path("/dev/shm")
"""Where Linux keeps it: a file system with a size of its own, in a container often of 64 MB."""

_attach_lock = threading.Lock()


def create_memory(what: str, size: int) -> SharedMemory:
    """New shared memory under a fresh name, all of it there: a write into it never asks for a page.

    Without that the system hands out pages as they are written, and where it has none left it ends the writer with
    SIGBUS, an armed servo as well.

    Args:
        what: It is for, for messages.
        size: Bytes.

    Raises:
        InputError: There is no room.
    """
    try:
        memory = SharedMemory(create=True, size=size)
    except OSError as error:
        raise _no_room(what, size, error) from None
    try:
        if hasattr(os, "posix_fallocate") and PLACE.is_dir():
            with (PLACE / memory.name).open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, size)
    except OSError as error:
        memory.close()
        memory.unlink()
        raise _no_room(what, size, error) from None
    return memory


def _no_room(what: str, size: int, error: OSError) -> InputError:
    """The line that says where, how much, and how much there is."""
    if not PLACE.is_dir():
        return InputError(f"shared memory for {what}: {size} bytes cannot be had ({error.strerror})")
    disk = os.statvfs(PLACE)
    free = disk.f_bavail * disk.f_frsize
    return InputError(
        f"shared memory for {what}: {PLACE} needs {size} bytes, {free} are free ({error.strerror}); remove files "
        "there, or give it more: mount -o remount,size=1G /dev/shm, docker run --shm-size=1g"
    )


def attach_memory(what: str, name: str) -> SharedMemory:
    """Shared memory of another process, unknown to this process's resource tracker.

    Python 3.11 registers what it attaches; the tracker of an unrelated process would then remove the name when that
    process ends, under the feet of the owner (python/cpython#82300; `track=False` exists from 3.13).

    Args:
        what: It is, for messages.
        name: Of it.

    Raises:
        InputError: There is none of that name.
    """
    register = resource_tracker.register

    def skip(tracked: str, rtype: str) -> None:
        if tracked.lstrip("/") != name:
            register(tracked, rtype)  # another thread creates one meanwhile

    try:
        if sys.version_info >= (3, 13):
            return SharedMemory(name, track=False)
        with _attach_lock:
            resource_tracker.register = skip
            try:
                return SharedMemory(name)
            finally:
                resource_tracker.register = register
    except (OSError, ValueError) as error:
        raise InputError(f"{what} {name!r}: cannot be attached ({error}); is its creator running?") from None


def bytes_of(memory: SharedMemory) -> memoryview:
    """What it holds.

    Raises:
        InputError: It was closed.
    """
    shared = memory.buf
    if shared is None:
        raise InputError(f"shared memory {memory.name!r}: was closed")
    return shared


def _let_go(memory: SharedMemory, views: tuple[memoryview, ...], owner: int) -> None:
    """Unmap; remove the name if this process (not a fork of it) is the owner."""
    for view in views:
        view.release()
    memory.close()
    if owner == os.getpid():
        with suppress(FileNotFoundError):
            memory.unlink()


class NamedMemory:
    """Shared memory and views of it, which are let go of once: by `close`, after a `with`, or at exit."""

    def __init__(self, memory: SharedMemory, views: tuple[memoryview, ...], owner: bool):
        self.name = memory.name
        # before Python takes its modules apart
        self._let_go = weakref.finalize(self, _let_go, memory, views, os.getpid() * owner)

    def close(self) -> None:
        """Let go of the memory, and remove its name if this side created it; may be called more than once."""
        self._let_go()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
