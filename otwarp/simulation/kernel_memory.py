"""What a GPU keeps for compiled kernels: the registers and the local memory of their threads."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import warp as wp

from otwarp.simulation.compilation import is_compiled, load_kernels

RESIDENT = {75: 1024, 86: 1536, 87: 1536, 88: 1536, 89: 1536, 110: 1536, 120: 1536, 121: 1536}
"""Most threads that a multiprocessor holds, by compute capability; 2,048 elsewhere (CUDA C++ Programming Guide,
table of technical specifications per compute capability)."""


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
