"""What reaches into Ray: everything that counts on more than the library promises stands here.

Seen in Ray 2.60; `tests/studies/test_ray_internals.py` fails when what is used here is not there any more.

- *What a driver prints of lost workers.* `log_to_driver=False` keeps what workers print to themselves, but not what a
  raylet says of a worker that was lost: it reaches the driver's standard output through a function without a switch.
- *Where sockets lie.* The name of a Unix socket may have 107 characters, and the folder of Ray's own choice can be too
  long for it. Its variable `RAY_TMPDIR` would change the environment of this process and of all that it starts; the
  argument of `ray.init` is one of those that "may change without notice".
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def silent_workers() -> Iterator[None]:
    """Without what a raylet says of lost workers; a Ray that has no such function says it."""
    worker: Any = importlib.import_module("ray._private.worker")
    said = getattr(worker, "print_worker_logs", None)
    if said is None:
        yield
        return
    worker.print_worker_logs = lambda *_: None
    try:
        yield
    finally:
        worker.print_worker_logs = said


def sockets_in(folder: str) -> dict[str, str]:
    """What `ray.init` is told to put the files of its session, sockets as well, into a folder."""
    return {"_temp_dir": folder}
