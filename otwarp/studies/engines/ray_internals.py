"""What reaches into Ray: everything that counts on more than the library promises stands here.

Seen in Ray 2.60; `tests/studies/test_ray_internals.py` fails when what is used here is not there any more.

- *What a driver prints of lost workers.* `log_to_driver=False` keeps what workers print to themselves, but not what a
  raylet says of a worker that was lost: it reaches the driver's standard output through a function without a switch.
- *Where sockets lie.* The name of a Unix socket may have 107 characters, and the folder of Ray's own choice can be too
  long for it. Its variable `RAY_TMPDIR` would change the environment of this process and of all that it starts; the
  argument of `ray.init` is one of those that "may change without notice".
- *A token for a cluster that is named.* The first cluster on a host leaves a token in the home folder, which heads that
  start there ask for ever after. A driver shows it to a cluster that it finds by itself, not to one that it is told.
"""

from __future__ import annotations

import contextlib
import importlib.util
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


def show_token() -> None:
    """Show the token that lies here, if any, to the cluster that is connected to; `RAY_AUTH_MODE` overrules this."""
    name = "ray._private.authentication.authentication_token_setup"
    if importlib.util.find_spec(name.rpartition(".")[0]) is None:
        return  # of a Ray that has no tokens
    show = getattr(importlib.import_module(name), "maybe_enable_token_auth_if_token_available", None)
    if show is not None:
        show(warn_if_disabled=False)
