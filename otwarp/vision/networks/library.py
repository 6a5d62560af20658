"""The library that networks run on, where it is installed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from otwarp.errors import InputError, is_full_memory

ELSEWHERE = "--device cpu, or a GPU with more memory that is free"
"""Where there is room."""


def torch_library() -> Any:
    """The package torch.

    Raises:
        InputError: It is not installed.
    """
    try:
        import torch
    except ImportError:
        raise InputError("networks need torch, which cannot be imported; install otwarp[vision]") from None
    return torch


def check_device_name(name: str | None) -> None:
    """Refuse what is no device anywhere, before torch is imported.

    Raises:
        InputError: It is none.
    """
    if name is not None and not re.fullmatch(r"cpu|cuda(:\d+)?", name):
        raise InputError(f"device is {name!r}; allowed: cpu, cuda:0, …")


def torch_device(name: str | None) -> Any:
    """The device of torch that a user names.

    Args:
        name: `cpu`, `cuda`, `cuda:1`, …; None for a GPU if there is one.

    Raises:
        InputError: No such device.
    """
    check_device_name(name)
    torch = torch_library()
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if name is None:
        return torch.device("cuda:0" if gpus else "cpu")
    known = ["cpu", *(f"cuda:{n}" for n in range(gpus))]
    if name not in known and not (name == "cuda" and gpus):
        raise InputError(f"device is {name!r}; allowed: {', '.join(known)}")
    return torch.device("cuda:0" if name == "cuda" else name)


@contextmanager
def threads_of(count: int) -> Iterator[None]:
    """A number of threads for torch on a CPU, until the end; 0 leaves it."""
    torch = torch_library()
    before = torch.get_num_threads()
    if count:
        torch.set_num_threads(count)
    try:
        yield
    finally:
        if count:
            torch.set_num_threads(before)


@contextmanager
def repeatable(seed: int) -> Iterator[None]:
    """Random numbers of torch from a seed, and algorithms that give the same bits every time; both as before after it.

    Raises:
        InputError: torch is not installed.
    """
    import os

    torch = torch_library()
    # cuBLAS is deterministic with workspaces of a fixed size only; it reads this when it starts
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    filling = torch.utils.deterministic
    before = (torch.are_deterministic_algorithms_enabled(), torch.backends.cudnn.benchmark,
              filling.fill_uninitialized_memory, torch.is_deterministic_algorithms_warn_only_enabled())  # fmt: skip
    devices = list(range(torch.cuda.device_count())) if torch.cuda.is_available() else []
    with torch.random.fork_rng(devices=devices):
        torch.manual_seed(seed)
        # an algorithm of a GPU that has no such form is named by a warning, and does not end the training
        torch.use_deterministic_algorithms(True, warn_only=True)
        torch.backends.cudnn.benchmark = False
        filling.fill_uninitialized_memory = False  # nothing here reads what was not written
        try:
            yield
        finally:
            torch.use_deterministic_algorithms(before[0], warn_only=before[3])
            torch.backends.cudnn.benchmark = before[1]
            filling.fill_uninitialized_memory = before[2]


@contextmanager
def memory_named(what: str, device: Any, allowed: str = ELSEWHERE) -> Iterator[None]:
    """Say what did not fit the memory of a GPU.

    Args:
        what: A batch, say, in words that go before `does not fit`.
        device: Whose memory.
        allowed: What would.

    Raises:
        InputError: It did not.
    """
    try:
        yield
    except RuntimeError as error:
        if not is_full_memory(error):
            raise
        words = " ".join(str(error).split())[:100]
        raise InputError(f"{what} does not fit the memory of {device} ({words}); allowed: {allowed}") from None
