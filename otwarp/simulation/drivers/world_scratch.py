"""Memory of the `world` driver: what its threads know of the contacts of their worlds."""

from __future__ import annotations

from typing import Annotated, Any

import warp as wp

from otwarp.kernels.contact.body_solve import nodes_of
from otwarp.kernels.contact.contact_list import ContactList, unused_fields
from otwarp.kernels.core.features import KEPT_CONTACTS, WORLD_BLOCK, WORLD_LANES, Features, world_lanes
from otwarp.kernels.core.team import LARGEST
from otwarp.kernels.drivers.grid.data import shares_entries
from otwarp.kernels.drivers.world_room import SolveRoom, WorldScratch
from otwarp.simulation.packing.arrays import Place

THREADS_PER_MULTIPROCESSOR = 256
"""Threads up to which worlds are spread over a GPU: what its registers have room for."""

TEAM_THREADS = {LARGEST: 128, 8: 384}
"""Threads of teams of each size that a multiprocessor is to have at most; beyond, smaller teams take less time."""

BODIES_PER_THREAD = 2
"""Of a world that one kernel takes through many steps. With fewer threads for its bodies, or more worlds than a GPU has
threads for, it takes twice as long, and a kernel for each part of a step less: so with 31, 64 and 201 bodies on an H100
(docs/benchmarks/contact_forms.md)."""

WARP = 32
"""Threads that go together on a GPU."""


def spread_of(worlds: int, device: wp.Device) -> int:
    """One of so many threads steps a world: 1 where there are worlds enough, or on a CPU, else a power of two."""
    spread = 1
    while device.is_cuda and spread < WARP and 2 * spread * worlds <= THREADS_PER_MULTIPROCESSOR * device.sm_count:
        spread *= 2
    return spread


def keeps_contacts(f: Features, worlds: int, device: wp.Device) -> bool:
    """Whether a thread has the contacts of its world in local arrays: few ones, in the threads of a full GPU."""
    listed = f.driver == "world" and f.contacts and not (f.body_space or f.phased)
    return listed and f.max_contacts <= KEPT_CONTACTS and device.is_cuda and spread_of(worlds, device) == 1


def team_for(f: Features, worlds: int, device: wp.Device) -> int:
    """Threads that share out a world in phases: the more, the fewer worlds; one where rods collide, and on a CPU."""
    if f.phased and f.driver == "world" and not f.rods and device.is_cuda:
        for size, threads in TEAM_THREADS.items():
            if size * worlds <= threads * device.sm_count:
                return size
    return 1


def many_in_phases(f: Features, worlds: int, device: wp.Device) -> bool:
    """Whether worlds of some hundred bodies go through a step part by part: where they are many for a GPU."""
    if not (device.is_cuda and shares_entries(f)):
        return False
    lanes = WORLD_LANES
    while lanes * BODIES_PER_THREAD < f.bodies:
        lanes *= 2
    return worlds * lanes > WORLD_BLOCK * device.sm_count


def largest_launch(f: Features, worlds: int, device: wp.Device) -> int:
    """Threads of the largest launch over the traps or bodies of `worlds` worlds, of any driver or readout."""
    lanes = world_lanes(worlds, device.sm_count) if f.by_world and device.is_cuda else 1
    return worlds * max(f.traps + f.bodies, spread_of(worlds, device), lanes, f.team * f.bodies)


def allocate_world(features: Features, rows: int, place: Place) -> Annotated[Any, WorldScratch]:
    """Scratch of `rows` worlds that are stepped at once; of no length where nothing can touch anything."""
    lengths = _lengths(features)
    scratch = place.typed(WorldScratch)()
    for name, field in place.typed(WorldScratch).vars.items():
        dtype, length = field.type.dtype, lengths.get(name, 0)
        if field.type.ndim == 1:
            array = wp.zeros(length * rows, dtype=dtype, device=place.device)
        else:
            # the same field of neighbouring worlds lies side by side, as threads of a GPU read it
            shape = (length, rows) if length else (0, 0)
            array = wp.empty(shape, dtype=dtype, device=place.device).transpose()
        setattr(scratch, name, array)
    if lengths.get("rotation"):
        scratch.rotation.fill_(place.typed(wp.quat)(0.0, 0.0, 0.0, 1.0))
    return scratch


def _lengths(f: Features) -> dict[str, int]:
    """Entries that a world has in each array of the scratch; none where a name is not in it."""
    lengths = {}
    if f.contacts and f.driver == "world" and not f.keeps:
        unused = unused_fields(f) | (set(SolveRoom.vars) if f.body_space else set())
        lengths = {name: f.max_contacts for name in {**ContactList.vars, **SolveRoom.vars} if name not in unused}
        if "matrix" in lengths:
            lengths["matrix"] = f.max_contacts**2
    if f.phased:
        lengths |= dict.fromkeys(("linear", "angular", "free", "body_drift"), f.bodies)
        lengths |= {
            "count": 1,
            "partners": 1,
            "rotation": 0 if f.rigid else f.bodies,
            "moved": nodes_of(f) if f.body_space else 0,
        }
    return lengths
