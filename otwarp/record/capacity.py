"""How many worlds fit into memory, found out before any of it is taken."""

from __future__ import annotations

import os
from typing import Any

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.frame import SHAPES

COPIES = 3
"""Frames held on the host at the same time: the one that is read, the last one, and sums for the statistics."""

MOST_THREADS = 2**31 - 1
"""Largest length of an array's axis, and of a launch, in Warp."""


def frame_bytes(scene: Scene, precision: str = "float32") -> int:
    """Bytes of one world's poses, traps and forces: the least that a world takes."""
    count = {"body": len(scene.bodies), "trap": len(scene.traps)}
    return (8 if precision == "float64" else 4) * sum(count[axis] * max(width, 1) for axis, width in SHAPES.values())


def most_worlds(scene: Scene, device: Any, precision: str = "float32") -> int:
    """Upper bound of the worlds that a run of `scene` can have on this machine; it may need more than the least."""
    size = max(frame_bytes(scene, precision), 1)
    bodies = max(len(scene.bodies), len(scene.traps), 1)
    host = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 2**63
    bounds = [MOST_THREADS // bodies, host // (size * (COPIES + device.is_cpu))]
    if device.is_cuda:
        bounds.append(device.total_memory // size)
    return max(1, min(bounds))


def check_worlds(scene: Scene, worlds: int, device: str | None = None, precision: str = "float32") -> None:
    """Refuse more worlds than memory can hold, before allocating any.

    Args:
        scene: What is to be run.
        worlds: Wanted.
        device: Warp device; None for the best there is.
        precision: Of the run, `float32` or `float64`.

    Raises:
        InputError: Too many, in one line that names the largest number that fits; or no such device.
    """
    most = most_worlds(scene, pick_device(device), precision)
    if worlds > most:
        raise InputError(f"worlds is {worlds}; allowed: 1 … {most}, which fit into the memory of this machine")
