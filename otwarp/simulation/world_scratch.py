"""Memory of the `world` driver: what its threads know of the contacts of their worlds."""

from __future__ import annotations

from typing import Annotated, Any

import warp as wp

from otwarp.kernels.contact.contact_list import unused_fields
from otwarp.kernels.core.features import Features
from otwarp.kernels.drivers.world_room import SolveRoom, WorldScratch
from otwarp.simulation.packing.arrays import Place

THREADS_PER_MULTIPROCESSOR = 256
"""Threads up to which worlds are spread over a GPU: what its registers have room for."""

WARP = 32
"""Threads that go together on a GPU."""


def spread_of(worlds: int, device: wp.Device) -> int:
    """One of so many threads steps a world: 1 where there are worlds enough, or on a CPU, else a power of two."""
    spread = 1
    while device.is_cuda and spread < WARP and 2 * spread * worlds <= THREADS_PER_MULTIPROCESSOR * device.sm_count:
        spread *= 2
    return spread


def allocate_world(features: Features, rows: int, place: Place) -> Annotated[Any, WorldScratch]:
    """Scratch of `rows` worlds that are stepped at once; of no length where nothing can touch anything."""
    f = features
    unused = unused_fields(f) | (set(SolveRoom.vars) if f.body_space else set())
    scratch = place.typed(WorldScratch)()
    for name, field in place.typed(WorldScratch).vars.items():
        dtype = field.type.dtype
        if name in unused or not f.contacts or f.driver != "world":
            setattr(scratch, name, wp.empty((0, 0), dtype=dtype, device=place.device))
        else:
            length = f.max_contacts ** (2 if name == "matrix" else 1)
            # the same field of neighbouring worlds lies side by side, as threads of a GPU read it
            setattr(scratch, name, wp.empty((length, rows), dtype=dtype, device=place.device).transpose())
    return scratch
