"""How many trials a device has room for at once: a study runs in batches that fit, to the same bits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.simulation.packing.capacity import world_bytes
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.rows import origin_of
from otwarp.warp_internals import fields, is_struct

SHARE = 0.5
"""Of the free memory that a batch may take: others compute on the same machine."""

LARGEST = 2**20
"""Trials at once, at most."""

ROUGHLY = 32
"""A world takes less than so many times its poses, traps and forces; only where that is too much it is measured."""

HOST = 3
"""Copies of a world that the host makes on its way to a device, and back."""

PROBED = (2**7, 2**8)
"""Worlds that are made to see what one takes."""


@dataclass(frozen=True)
class Room:
    """What trials take on a device.

    Attributes:
        device: Its name.
        free: Memory that is free there [bytes].
        each: What a trial takes [bytes].
        worlds: Trials that run at once, at most.
    """

    device: str
    free: int
    each: int
    worlds: int


def free_bytes(device: str) -> int:
    """Free memory of a device: of a GPU as Warp says, of the host what is available to this process's group."""
    place = wp.get_device(device)
    if place.is_cuda:
        return int(place.free_memory)
    bounds = [_available(), _group_allows()]
    return min([b for b in bounds if b is not None], default=2**62)


def _available() -> int | None:
    """What Linux says is available; None where nothing says so."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError):
        return None


def _group_allows() -> int | None:
    """What the control group of this process may take beyond what it has: a container's limit, or a job's."""
    try:
        own = Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines()
        path = Path("/sys/fs/cgroup") / next(line for line in own if line.startswith("0::"))[3:].strip().lstrip("/")
        limits = []
        for group in (path, *path.parents):
            if (group / "memory.max").is_file() and (most := (group / "memory.max").read_text().strip()) != "max":
                limits.append(int(most) - int((group / "memory.current").read_text()))
        return max(min(limits), 0) if limits else None
    except (OSError, StopIteration, ValueError):
        return None


def worlds_at_once(study: AnyStudy, device: str) -> int:
    """Trials of a study that run at once on a device, at most; known without making any where there is plenty."""
    roughly = ROUGHLY * HOST * world_bytes(study.design.scene, study.options.precision)
    if LARGEST * roughly <= SHARE * free_bytes(device):
        return LARGEST
    return room_of(study, device).worlds


def rough_worlds(scene: Scene, precision: str, device: str) -> int:
    """Worlds of a scene that surely fit on a device."""
    fit = int(SHARE * free_bytes(device)) // (ROUGHLY * HOST * world_bytes(scene, precision))
    return int(np.clip(fit, 1, LARGEST))


def room_of(study: AnyStudy, device: str | None = None) -> Room:
    """What the trials of a study take on a device, from a few worlds that are made there, and how many fit."""
    place = str(pick_device(device))
    points, values = study.design.groups(np.arange(min(study.design.points, 2)))[0]
    scene = study.design.scene_of(values)
    at = {t: v for t, v in study.design.at(points).items() if not t.grouped}
    # steps that weak traps of the points can take may be too long for the scene's own, and here none is taken
    short = math.ceil(study.horizon / origin_of(scene, study.options).time_step)
    runner = study.runner.in_steps(max(study.runner.steps, short))
    sizes = []
    for count in PROBED:
        which = np.resize(np.arange(len(points), dtype=np.int32), count)
        sim = runner.simulation(scene, at, np.arange(count), which=which, device=place)
        sizes.append(_size(sim))
    first, last = sizes
    each = max(-(-(last - first) // (PROBED[1] - PROBED[0])), world_bytes(scene, study.options.precision))
    each *= 1 if place.startswith("cuda") else HOST
    free = free_bytes(place)
    return Room(place, free, each, int(np.clip(int(SHARE * free) // each, 1, LARGEST)))


def _size(item: Any) -> int:
    """Bytes of the arrays that an object of this package refers to, each once."""
    found: dict[int, int] = {}
    seen: set[int] = set()
    waiting = [item]
    while waiting:
        item = waiting.pop()
        if isinstance(item, wp.array):
            found[item.ptr or 0] = item.capacity
            continue
        if id(item) in seen:
            continue
        seen.add(id(item))
        if is_struct(item):
            waiting += fields(item).values()
        elif isinstance(item, list | tuple):
            waiting += item
        elif isinstance(item, dict):
            waiting += item.values()
        elif type(item).__module__.startswith("otwarp.simulation"):
            waiting += vars(item).values()
    return sum(found.values())
