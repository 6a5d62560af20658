"""Compiles and loads the kernels of a simulation before its first step, and tells whoever has to wait for it."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import warp as wp

LOG = logging.getLogger("otwarp")
"""Where it is logged, at level INFO; `otwarp run` prints it."""

_BINARIES = {".o", ".ptx", ".cubin"}


def usable_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_kernels(kernels: Iterable[Any], device: wp.Device) -> None:
    """Compile these kernels, as many modules at a time as there are cores, and load them.

    Logs how many modules are not in Warp's cache, and each one that is there at last; nothing where all are. The
    variant is the one that launches use: one thread per block on a CPU.
    """
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
