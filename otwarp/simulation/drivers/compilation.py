"""Compiles and loads the kernels of a simulation, tells whoever has to wait for it, and what a GPU keeps for them."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp as wp

LOG = logging.getLogger("otwarp")
"""Where it is logged, at level INFO; `otwarp run` prints it."""

_BINARIES = {".o", ".ptx", ".cubin"}

_IN_TURN = threading.Lock()
"""Warp loads a module anew for each thread that does not find it, and drops what the one before may already run."""

RESIDENT = {75: 1024, 86: 1536, 87: 1536, 88: 1536, 89: 1536, 110: 1536, 120: 1536, 121: 1536}
"""Most threads that a multiprocessor holds, by compute capability; 2,048 elsewhere (CUDA C++ Programming Guide,
table of technical specifications per compute capability)."""


def usable_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_kernels(kernels: Iterable[Any], device: wp.Device) -> None:
    """Compile these kernels, as many modules at a time as there are cores, and load them.

    Logs how many modules are not in Warp's cache, and each one that is there at last; nothing where all are. The
    variant is the one that launches use: one thread per block on a CPU. Threads that step simulations side by side come
    here before they launch: then a module is loaded once.
    """
    with _IN_TURN:
        _load(kernels, device)


def _load(kernels: Iterable[Any], device: wp.Device) -> None:
    modules = list(dict.fromkeys(kernel.module for kernel in kernels))
    logged = LOG.isEnabledFor(logging.INFO)
    missing = {module for module in modules if logged and not is_compiled(module, device)}
    if missing:
        LOG.info(
            "compiling %d of %d kernel modules for %s, some seconds each; the next run finds them in %s",
            *(len(missing), len(modules), device.alias, wp.config.kernel_cache_dir),
        )
    block = 1 if device.is_cpu else None
    with ThreadPoolExecutor(usable_cores()) as pool:
        loading = {pool.submit(module.load, device, block): module for module in modules}
        compiled = 0
        for done in as_completed(loading):
            if done.result() is None:
                raise RuntimeError(f"Warp could not compile {loading[done].name}")
            if len(missing) > 1 and loading[done] in missing:
                compiled += 1
                LOG.info("compiled %d of %d", compiled, len(missing))


def is_compiled(module: wp.Module, device: wp.Device) -> bool:
    """Whether Warp's cache has the binary of a module that a launch on the device will look for."""
    folder = Path(wp.config.kernel_cache_dir or "") / module.get_module_identifier(1 if device.is_cpu else None)
    return folder.is_dir() and any(
        file.suffix in _BINARIES and device.is_cpu == (file.suffix == ".o") for file in folder.iterdir()
    )


@dataclass(frozen=True)
class KernelMemory:
    """What one kernel takes of a GPU.

    Attributes:
        kernel: Its name.
        registers: Per thread.
        local: Local memory per thread [bytes].
        reserved: Device memory that the driver sets aside while the kernel can run [bytes]: its local memory, for as
            many threads as the device holds at once, however few are launched. Kernels share it: the largest counts.
    """

    kernel: str
    registers: int
    local: int
    reserved: int


def resident_threads(device: wp.Device) -> int:
    """Threads that a CUDA device holds at once."""
    return device.sm_count * RESIDENT.get(device.arch, 2048)


def kernel_memory(kernels: Iterable[wp.Kernel], device: wp.Device, *, load: bool) -> list[KernelMemory] | None:
    """What each kernel takes of a CUDA device; nothing on a CPU, whose threads use their stack.

    Args:
        kernels: Of a step.
        device: Where they run.
        load: Compile those that are not in Warp's cache.

    Returns:
        One row per kernel, the largest first, or None where one is not compiled and `load` is false.
    """
    if device.is_cpu:
        return []
    kernels = list(kernels)
    if load:
        load_kernels(kernels, device)
    elif not all(is_compiled(kernel.module, device) for kernel in kernels):
        return None
    rows = []
    for kernel in kernels:
        of = wp.get_cuda_kernel_properties(kernel, device)
        local = of["local_memory_size"]
        rows.append(KernelMemory(kernel.key, of["register_count"], local, local * resident_threads(device)))
    return sorted(rows, key=lambda row: -row.local)
