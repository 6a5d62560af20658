"""Tells, before a simulation starts, that kernels are about to be compiled: the first run of a scene waits for it."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import warp as wp

LOG = logging.getLogger("otwarp")
"""Where it is told, at level INFO; `otwarp run` prints it."""

_BINARIES = {".o", ".ptx", ".cubin"}


def tell_of_compilation(kernels: Iterable[Any], device: wp.Device) -> None:
    """Log how many modules of these kernels are not in Warp's cache; nothing where all are, or nobody listens."""
    if not LOG.isEnabledFor(logging.INFO):
        return
    modules = list(dict.fromkeys(kernel.module for kernel in kernels))
    missing = [module for module in modules if not is_compiled(module, device)]
    if missing:
        LOG.info(
            "compiling %d of %d kernel modules for %s, some seconds each; the next run finds them in %s",
            *(len(missing), len(modules), device.alias, wp.config.kernel_cache_dir),
        )


def is_compiled(module: wp.Module, device: wp.Device) -> bool:
    """Whether Warp's cache has the binary of a module that a launch on the device will look for."""
    folder = Path(wp.config.kernel_cache_dir or "") / module.get_module_identifier(1 if device.is_cpu else None)
    return folder.is_dir() and any(
        file.suffix in _BINARIES and device.is_cpu == (file.suffix == ".o") for file in folder.iterdir()
    )
