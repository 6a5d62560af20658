"""Starting Warp without a word on the terminal, and choosing a device."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.warp_internals import is_running, share_headers

_NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver"


def start_warp() -> None:
    """Initialise Warp quietly; harmless when it runs already.

    Without an NVIDIA driver the native library writes a line straight to the process's standard error, past Python
    and past `wp.config.log_level`. File descriptor 2 is therefore held back during start-up; whatever else was
    written there is passed on.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    if is_running():
        share_headers()
        return
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as held:
        os.dup2(held.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            held.seek(0)
            for line in held:
                if not line.startswith(_NO_DRIVER):
                    os.write(2, line)
    share_headers()


def pick_device(name: str | wp.Device | None) -> wp.Device:
    """The named device, or for None the first CUDA device if there is one, else the CPU.

    Raises:
        InputError: No such device; the message lists those there are.
    """
    start_warp()
    if isinstance(name, wp.Device):
        return name
    known = [d.alias for d in wp.get_devices()]
    if name is None:
        return wp.get_device("cuda:0" if "cuda:0" in known else "cpu")
    if name not in known and name != "cuda":
        raise InputError(f"device is {name!r}; allowed: {', '.join(known)}")
    try:
        return wp.get_device(name)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"device is {name!r}; allowed: {', '.join(known)}") from error


def empty(shape: int | tuple[int, ...], dtype: Any, device: Any) -> wp.array:
    """`wp.empty` of any type: Warp's hints know numbers alone, not vectors and structs.

    Args:
        shape: Of the array.
        dtype: Warp type of its elements, or a struct.
        device: Warp device or its name.
    """
    return wp.empty(shape=shape, dtype=dtype, device=device)


def reading(arrays: Sequence[wp.array], device: wp.Device) -> Callable[[], list[np.ndarray]]:
    """What waits for all that a device was given until now, and brings arrays to the host.

    A GPU may be given more meanwhile, by another thread as well: the copies wait for what came before, and for no more.

    Args:
        arrays: Contiguous, on the device, and not written again.
        device: Where.
    """
    if device.is_cpu:
        return lambda: [array.numpy() for array in arrays]
    event = device.stream.record_event()

    def read() -> list[np.ndarray]:
        """Wait, and copy."""
        stream = wp.Stream(device)
        wp.synchronize_event(event)
        copies = [wp.empty(array.shape, dtype=array.dtype, device="cpu") for array in arrays]
        for copy, array in zip(copies, arrays, strict=True):
            wp.copy(copy, array, stream=stream)
        wp.synchronize_stream(stream)
        return [copy.numpy() for copy in copies]

    return read


@contextlib.contextmanager
def beside_queued(device: wp.Device) -> Iterator[None]:
    """What is begun here does not wait for what a GPU was given before; what it is given after waits for this.

    A copy from ordinary memory keeps the host until its turn in the stream has come, so that in the stream of queued
    steps it would wait for all of them.

    Args:
        device: Where; a CPU has no queue.
    """
    if device.is_cpu:
        yield
        return
    before = device.stream
    device.set_stream(wp.Stream(device), sync=False)
    try:
        yield
    finally:
        device.set_stream(before)  # which waits for what was begun here
