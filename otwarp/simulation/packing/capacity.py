"""How many worlds fit into memory, found out before any of it is taken."""

from __future__ import annotations

import os

import warp as wp

from otwarp.errors import InputError
from otwarp.scene import Scene

BODY_NUMBERS = 3 + 4 + 3 + 1
"""Of a body in one world, in its state and its readout: position, orientation, contact force and load."""

TRAP_NUMBERS = 3 + 1 + 3 + 1 + 1
"""Of a trap: position, power, force, distance and time of escape."""

MOST_THREADS = 2**31 - 1
"""Largest length of an array's axis, and of a launch, in Warp."""


def world_bytes(scene: Scene, precision: str = "float32") -> int:
    """Bytes of one world's poses, traps and forces: the least that a world takes."""
    count = len(scene.bodies) * BODY_NUMBERS + len(scene.traps) * TRAP_NUMBERS
    return (8 if precision == "float64" else 4) * count


def most_worlds(scene: Scene, device: wp.Device, precision: str = "float32", copies: int = 0) -> int:
    """Upper bound of the worlds of `scene` on this machine; they may need more than the least.

    `copies` are those that the host holds beside what is on the device.
    """
    size = max(world_bytes(scene, precision), 1)
    bounds = [MOST_THREADS // max(len(scene.bodies), len(scene.traps), 1)]
    if hasattr(os, "sysconf") and copies + device.is_cpu:
        host = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        bounds.append(host // (size * (copies + device.is_cpu)))
    if device.is_cuda:
        bounds.append(device.total_memory // size)
    return max(1, min(bounds))


def check_worlds(scene: Scene, worlds: int, device: wp.Device, precision: str = "float32", copies: int = 0) -> None:
    """Refuse more worlds than memory can hold, before allocating any; arguments as `most_worlds`.

    Raises:
        InputError: Too many, in one line that names the largest number that fits.
    """
    most = most_worlds(scene, device, precision, copies)
    if worlds > most:
        raise InputError(f"worlds is {worlds}; allowed: 1 … {most}, which fit into the memory of this machine")
