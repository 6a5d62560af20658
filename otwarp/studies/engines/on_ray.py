"""Ray: the blocks of a study as tasks on several GPUs or hosts, which may come and go.

Tasks take the study as data and write whole blocks into the store, whose folder all hosts share; the driver gives them
out and keeps nothing. A task whose worker is lost runs once more, elsewhere, to the same bits.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import os
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.engines.local import Progress, compute_and_keep, tasks
from otwarp.studies.engines.ray_internals import show_token, silent_workers, sockets_in
from otwarp.studies.engines.sent import packed, unpacked
from otwarp.studies.store import Store, versions

RETRIES = 20
"""Times that a task may lose its worker."""
LOOK = 0.5
"""Time [s] after which a driver that waits for tasks looks whether it was asked to end."""
PATIENCE = 5.0
"""Time [s] within which a cluster has to answer."""
LONGEST_FOLDER = 40
"""Characters of the folder in which Ray's sockets lie, whose whole names may have 107."""


@dataclass(frozen=True)
class RayEngine:
    """Computes blocks as tasks of Ray; made by `ray_engine`.

    Attributes:
        address: Of the cluster; None: all of this host.
        device: `cpu`, `cuda`, or None for what there is.
    """

    address: str | None
    device: str | None

    def __call__(self, study: AnyStudy, store: Store, todo: Sequence[int], progress: Progress) -> None:
        """Give blocks out, until all are in the store."""
        with _connected(self.address) as ray:
            _give_out(ray, study, store, todo, progress, self.device)

    def connected(self) -> contextlib.AbstractContextManager[Any]:
        """Ray, connected for several calls: on this host alone it takes seconds to start."""
        return _connected(self.address)


def ray_engine(address: str | None = None, *, device: str | None = None) -> RayEngine:
    """The engine of a Ray cluster.

    Args:
        address: `HOST:PORT` of its head, from a host that belongs to it; `auto`: the one that runs on this host; None:
            that of `RAY_ADDRESS`, or all of this host for as long as the study runs.
        device: `cpu`, or None: a task takes a GPU where the cluster has some, else a core.

    Raises:
        InputError: Ray is not installed, nothing answers there, or another device.
    """
    if device not in (None, "cpu", "cuda"):
        raise InputError(f"--device is {device}; allowed with --engine ray: cpu, cuda: which of them is Ray's choice")
    if importlib.util.find_spec("ray") is None:
        raise InputError("--engine ray needs Ray; install otwarp[ray]")
    address = address or os.environ.get("RAY_ADDRESS")
    if address == "auto":
        with _connected(address):  # found out before a folder is made
            pass
    elif address is not None:
        check_reachable(address)
    return RayEngine(address, device)


def check_reachable(address: str) -> None:
    """Find out at once whether a Ray head answers: Ray itself tries for minutes.

    Raises:
        InputError: Nothing answers, or it is no Ray.
    """
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 2**16 or "/" in host:
        raise InputError(f"--address is {address}; allowed: HOST:PORT of a Ray head, such as node01:6379, or auto")
    preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])  # an empty SETTINGS frame
    try:
        with socket.create_connection((host, int(port)), timeout=PATIENCE) as peer:
            peer.sendall(preface)
            answer = peer.recv(9)
    except OSError as error:
        why = error.strerror or str(error) or type(error).__name__
        raise InputError(f"--address is {address}, where nothing answers ({why}); allowed: a Ray head") from None
    if len(answer) < 4 or answer[3] != 4:
        raise InputError(f"--address is {address}, where something else than Ray answers; allowed: a Ray head")


@contextlib.contextmanager
def _connected(address: str | None) -> Iterator[Any]:
    """Ray, connected; interrupts and SIGTERM stay the program's own.

    Raises:
        InputError: This host does not belong to the cluster, or its Ray is of another version.
    """
    import ray

    kept = {number: signal.getsignal(number) for number in _handled()}
    begun = not ray.is_initialized()
    if begun:
        how: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
        how |= {"address": address} if address else {"address": "local", "include_dashboard": False, **_short_folder()}
        try:
            with _quiet():
                if address is not None:
                    show_token()
                ray.init(**how)
        except (ConnectionError, RuntimeError, ValueError) as error:
            where = f"--address is {address}" if address else "--engine is ray"
            token = ", with its token in RAY_AUTH_TOKEN or ~/.ray/auth_token" if _asks_for_token(error) else ""
            raise InputError(f"{where}: {_first_line(error)}; allowed: a Ray head, from a host on which "
                             f"`ray start` has joined it{token}") from None  # fmt: skip
    try:
        _handle(kept)
        with silent_workers():  # a lost worker is no news worth a hundred lines on standard output
            yield ray
    finally:
        if begun:
            ray.shutdown()
            _handle(kept)


def _asks_for_token(error: BaseException) -> bool:
    """Whether a cluster has refused us for want of its token, which Ray tells deep within another error."""
    return "InvalidAuthToken" in f"{error} {error.__cause__}"


def _handle(handlers: dict[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _handled() -> tuple[signal.Signals, ...]:
    """Signals that Ray takes over, where a thread may have them back."""
    return (signal.SIGTERM, signal.SIGINT) if threading.current_thread() is threading.main_thread() else ()


def _short_folder() -> dict[str, str]:
    """Where Ray puts its sockets on this host, if its own choice were too long for them."""
    usual = os.environ.get("RAY_TMPDIR") or os.environ.get("TMPDIR") or "/tmp"
    return {} if len(usual) <= LONGEST_FOLDER or os.name == "nt" else sockets_in(f"/tmp/ray-{os.getuid()}")


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without what Ray's C++ writes to standard error while it connects."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def wanted_by_a_task(resources: Mapping[str, float], device: str | None) -> dict[str, int]:
    """What a task asks Ray for: a GPU of its own where there are some, and a core.

    Args:
        resources: What the cluster has, by Ray's names.
        device: `cpu`, `cuda`, or None for what there is.

    Raises:
        InputError: A GPU is wanted, and there is none.
    """
    gpus = resources.get("GPU", 0) >= 1
    if device == "cuda" and not gpus:
        raise InputError("--device is cuda; allowed in this cluster: cpu, it has no GPU")
    return {"num_gpus": 1, "num_cpus": 1} if gpus and device != "cpu" else {"num_cpus": 1}


def _give_out(
    ray: Any, study: AnyStudy, store: Store, todo: Sequence[int], progress: Progress, device: str | None
) -> None:
    """Give tasks out, more than there are workers for, so that those who join find some."""
    resources = ray.cluster_resources()
    wanted = wanted_by_a_task(resources, device)
    gpu = "num_gpus" in wanted
    if not gpu and resources.get("CPU", 0) < 1:
        warnings.warn("the cluster has no free core yet: waiting for workers to join", stacklevel=2)
    work = ray.remote(max_retries=RETRIES, **wanted)(_work)
    given = ray.put((versions(), packed(study, store.scene.absolute())))
    count, done = len(study.blocks()), len(store.finished())
    folder = str(store.folder.absolute())
    running = {
        work.remote([given], folder, numbers, "cuda:0" if gpu else "cpu"): len(numbers)
        for numbers in tasks(study, todo, gpu=gpu, workers=int(resources.get("GPU" if gpu else "CPU", 1)))
    }
    try:
        while running:
            found, _ = ray.wait(list(running), num_returns=1, timeout=LOOK)
            for task in found:
                _result(ray, task)
                done += running.pop(task)
                progress(done, count)
    except BaseException:
        for task in running:
            with contextlib.suppress(Exception):  # what ended first counts
                ray.cancel(task)
        raise


def _result(ray: Any, task: Any) -> None:
    """Pass on what went wrong in a task as what it was there."""
    try:
        ray.get(task)
    except ray.exceptions.RayError as error:
        cause = error.cause if isinstance(error, ray.exceptions.RayTaskError) else error
        if isinstance(cause, ray.exceptions.RayError):  # of a task as well, whose cluster goes
            raise OSError(f"Ray gave a block up: {_first_line(cause)}; the same line goes on") from None
        raise cause if isinstance(cause, Exception) else error from None


def _first_line(error: BaseException) -> str:
    line = next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)
    return line.partition(". ")[0].removesuffix(".")


@functools.lru_cache(maxsize=1)
def _study_of(given: Any) -> tuple[dict[str, str], AnyStudy]:
    """The study that tasks are of, once per worker."""
    import ray

    wanted, data = ray.get(given)
    return wanted, unpacked(data)


def _work(given: list[Any], folder: str, numbers: list[int], device: str) -> None:
    """Compute blocks and write them: what a worker does."""
    host = socket.gethostname()
    store = Store(Path(folder))
    if not store.scene.exists():
        raise InputError(f"--out is {folder}, which worker {host} does not see; allowed: a folder that all hosts share")
    wanted, study = _study_of(given[0])
    if wanted != versions():
        raise InputError(f"worker {host} has {versions()}, the driver {wanted}; allowed: the same on all hosts")
    todo = [n for n in numbers if not store.done(n)]  # a task that lost its worker late has kept some
    if todo:
        compute_and_keep(study, store, todo, device, threads=None if device.startswith("cuda") else 1)
