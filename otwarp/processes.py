"""Work in several fresh interpreters, which end with the one that began them; one that dies first is told in a line."""

from __future__ import annotations

import contextlib
import os
import pickle
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from otwarp.errors import InputError


@contextlib.contextmanager
def worker_processes(
    count: int, begin: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Processes that tasks are submitted to; when the block is left by an error they end in the middle of a task.

    They are spawned: warnings belong to a process, and Warp does not outlive a fork. As everywhere with these, a script
    that begins them has its calls below `if __name__ == "__main__":`.

    Args:
        count: Processes at most.
        begin: Called first in each of them, a function of a module.
        arguments: Its arguments. They go through a file, not through the pipe that a process is begun with: what a
            pipe does not hold (64 KiB) keeps the parent waiting for ever for a process that ended before it read it.

    Raises:
        InputError: A process ended before its work was done.
    """
    context = get_context("spawn")
    told, end = context.Pipe(duplex=False)  # closing `end` ends the processes
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "begin"
        file.write_bytes(pickle.dumps((begin, arguments)))
        try:
            with ProcessPoolExecutor(count, context, _begin, (os.getpid(), told, file)) as pool:
                try:
                    yield pool
                except BaseException:
                    end.close()
                    pool.shutdown(wait=True, cancel_futures=True)
                    raise
        except BrokenProcessPool:
            raise InputError(
                f"one of {count} processes ended before its work was done (killed, out of memory, or begun by a script "
                "that begins them again when it is imported); allowed: fewer, or 1; in a script, calls under "
                'if __name__ == "__main__":'
            ) from None
        finally:
            end.close()
            told.close()


def _begin(parent: int, told: Connection, file: Path) -> None:
    """Have the process end with its parent, or when the other end of `told` is closed; then begin."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers Ctrl-C
    threading.Thread(target=_end_with, args=(parent, told), daemon=True).start()
    begin, arguments = pickle.loads(file.read_bytes())
    if begin is not None:
        begin(*arguments)


def _end_with(parent: int, told: Connection) -> None:
    while os.getppid() == parent and not told.poll(0.5):
        pass
    os._exit(1)
