"""Memory of the grid driver, and the sizes of its cells and skin."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.device import empty
from otwarp.errors import InputError
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.cpu.pair_block import PAIRS
from otwarp.kernels.drivers.grid.contacts import CHUNKS, RELAXATIONS
from otwarp.kernels.drivers.grid.data import (
    EntryData,
    GridData,
    Link,
    NeighbourData,
    PushData,
    in_columns,
    lifts_noise,
    shares_entries,
    whole_contacts,
)
from otwarp.kernels.drivers.grid.entries import parts
from otwarp.kernels.drivers.grid.move import two_stages
from otwarp.kernels.drivers.grid.neighbours import NEIGHBOURS
from otwarp.simulation.model import Model
from otwarp.simulation.state import State

SPREADS = 32.0
"""Skin in standard deviations of the thermal displacement of one step: lists then serve about ten steps, as the
farthest of a million spheres goes five standard deviations a step, and these add up as the root of the steps."""

SKIN_RANGE = (0.3, 1.2)
"""Least and largest skin, relative to the mean contact radius: neither new lists in every step nor long lists."""

CELL_EDGE = 1.00001
"""Edge of a cell over the largest distance of neighbours: what rounding may put into the next cell but one is none."""

WIDE_CELL = 2.01
"""The same across the sorted direction where a CPU tests many neighbours at once: of two columns, rather than three."""

MOST_CELLS = 1 << 30
"""Cells of all worlds, which int32 keys number."""


def choose_skin(model: Model) -> float:
    """Skin of the neighbour lists [µm]."""
    mean = float(model.data.contact.sphere.numpy()[:, 3].mean())
    energy = float(model.data.medium.thermal_energy.numpy().max()) if model.features.brownian else 0.0
    mobility = float(model.data.body.translation.numpy().max() / model.data.medium.viscosity.numpy().min())
    spread = math.sqrt(2.0 * energy * mobility * model.time_step)
    return float(np.clip(SPREADS * spread, SKIN_RANGE[0] * mean, SKIN_RANGE[1] * mean))


def largest_wander(model: Model) -> float:
    """Largest variance of the thermal motion of one element against another in a step [µm²]: `wander_of` of two."""
    if not model.features.brownian:
        return 0.0
    body = model.data.body
    shape, turns, bound = (a.numpy() for a in (body.shape, body.rigid, body.bound))
    mobility = body.translation.numpy()[shape].astype(float)
    if np.any(turns):
        own = np.diagonal(body.mobility.numpy(), axis1=1, axis2=2).astype(float)[shape]
        mobility = np.where(turns, own[:, :3].max(axis=1) + own[:, 3:].max(axis=1) * bound**2, mobility)
    medium = model.data.medium
    energy = medium.thermal_energy.numpy().max() / medium.viscosity.numpy().min()
    return float(2.0 * 2.0 * energy * model.time_step * mobility.max())


def choose_cells(
    extent: np.ndarray, edge: ArrayLike, elements: int, worlds: int, period: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[int, int, int]:
    """Cells along each axis, powers of two of at least 4: no more than four per element, where there is room for them.

    Args:
        extent: (3,) of the region where the elements start [µm]; elsewhere the cells repeat.
        edge: Of a cell [µm], one or along each axis; along a periodic axis at least.
        period: (3,) lengths that a whole number of cells fills [µm], 0 along an open axis.

    Raises:
        InputError: A period that has no room for four cells.
    """
    edges = np.broadcast_to(np.asarray(edge, dtype=float), 3)
    needed = [max(4, 1 << math.ceil(math.log2(max(x, 1.0)) - 1e-9)) for x in np.asarray(extent) / edges]
    for axis, length in enumerate(np.asarray(period, dtype=float)):
        if 0.0 < length < 4.0 * edges[axis]:
            raise InputError(
                f"ot:scene:period = {1e-6 * length:g} m along {'xyz'[axis]}; allowed: 0, or at least"
                f" {4e-6 * edges[axis]:g} m in a many-body scene of bodies of this size"
            )
        if length > 0.0:
            needed[axis] = 1 << math.floor(math.log2(length / edges[axis]))
    most = min(max(64, 4 * elements), max(64, MOST_CELLS // worlds))
    while math.prod(needed) > most:
        needed[needed.index(max(needed))] //= 2
    return needed[0], needed[1], needed[2]


def check_numbers(f: Features, worlds: int, elements: int) -> None:
    """Refuse more elements than int32 numbers the places of in neighbour lists, and the links of entries.

    Raises:
        InputError: Too many in all worlds together.
    """
    places = NEIGHBOURS if f.pairs else 0
    if shares_entries(f):
        # a link is twice the number of an entry, and its side
        places = max(places, 2 * MAX_BODY_CONTACTS)
    if worlds * elements * places >= 2**31:
        raise InputError(
            f"worlds is {worlds} with {elements} spheres that collide in each; allowed: {(2**31 - 1) // places} such "
            "spheres in all worlds together"
        )


def allocate_neighbours(model: Model, state: State) -> Annotated[Any, NeighbourData]:
    """Cells and lists; of no length where nothing can touch anything."""
    f, w, device = model.features, model.worlds, model.device
    data = NeighbourData()
    contact = model.data.contact
    sizes = contact.sphere.numpy()[:, 3] if f.contacts else np.zeros(0)
    elements = (f.bodies if f.soft_contacts else len(sizes)) if f.contacts else 0
    data.elements = elements
    cells = (4, 4, 4)
    if f.contacts:
        data.skin = choose_skin(model)
        # gaps that the free moves of a step may close
        sticky = contact.adhesion.numpy() > 0.0
        data.adhesion = float(contact.adhesion_range.numpy()[sticky].max(initial=0.0))
        data.wander = largest_wander(model)
        data.reach = data.adhesion + (0.0 if f.soft_contacts else 0.5 * data.skin)
        edge = CELL_EDGE * (2.0 * float(sizes.max()) + data.reach + data.skin)
        extent = np.ptp(state.position.numpy()[0].astype(float), axis=0)
        period = np.array(model.scene.settings.period)
        wide = WIDE_CELL if f.soft_contacts and f.lanes else 1.0
        edges = edge * np.where(period > 0.0, 1.0, [wide, wide, 1.0])
        cells = choose_cells(extent, edges, elements, w, period)
        data.edge = wp.vec3(*np.where(period > 0.0, period / np.array(cells), edges))
    data.cells = wp.vec3i(*cells)
    own = w if f.by_world else 1
    total, listed = w * elements, w * elements if f.pairs else 0
    check_numbers(f, w, elements)
    searched = w * math.prod(cells) if f.pairs and not f.by_world else 0
    sorted = 0 if f.by_world else listed
    counts = {"key": 2 * sorted, "item": 2 * sorted, "start": searched, "finish": searched, "count": total}
    slots = f.lanes and f.soft_contacts
    counts |= {"begin": listed if slots else 0, "full": w if slots else 0}
    counts |= {"walled": total if f.obstacles else 0, "stale": own, "builds": own}
    for name, size in counts.items():
        setattr(data, name, wp.zeros(size, dtype=wp.int32, device=device))
    data.reference = wp.zeros(total, dtype=wp.vec3, device=device)
    # filled up to `count` alone: pages that no list reaches are never touched
    data.neighbour = empty(listed * NEIGHBOURS + PAIRS, wp.int32, device)
    # neighbouring threads of a GPU read neighbouring words; one thread of a CPU reads its own list through
    data.stride, data.pitch = (NEIGHBOURS, 1) if device.is_cpu else (1, listed)
    return data


def allocate_grid(model: Model, state: State) -> Annotated[Any, GridData]:
    """Everything the kernels of the grid driver keep between launches."""
    f, w, device = model.features, model.worlds, model.device
    b = f.bodies
    own = 0 if f.soft_contacts else b
    data = GridData()
    data.near = allocate_neighbours(model, state)
    each = w if f.by_world else 1
    data.clock = wp.zeros(each, dtype=wp.int64, device=device)
    data.until = wp.zeros(each, dtype=wp.int64, device=device)
    for name in ("outside", "touching", "again"):
        setattr(data, name, wp.zeros(each, dtype=wp.int32, device=device))
    for name in ("left", "sweep", "unsettled", "row", "turn"):
        setattr(data, name, wp.zeros(1, dtype=wp.int32, device=device))
    data.linear = wp.zeros((w, own), dtype=wp.vec3, device=device)
    data.angular = wp.zeros((w, own if f.rigid else 0), dtype=wp.vec3, device=device)
    again = own if two_stages(f) or lifts_noise(f) else 0
    data.drift = wp.zeros((w, again), dtype=wp.vec3, device=device)
    data.turning = wp.zeros((w, again if f.rigid else 0), dtype=wp.vec3, device=device)
    touching = own if f.contacts else 0
    listed = 0 if shares_entries(f) else w * touching
    data.contact = empty((listed if whole_contacts(f) else 0, MAX_BODY_CONTACTS), Contact, device)
    data.link = empty((0 if whole_contacts(f) else listed, MAX_BODY_CONTACTS), Link, device)
    data.entry = allocate_entries(model, data.near.elements)
    data.count = wp.zeros((w, touching), dtype=wp.int32, device=device)
    data.row_sum = wp.zeros((w, touching), dtype=wp.float32, device=device)
    data.ahead = empty((listed, MAX_BODY_CONTACTS), wp.float32, device)
    data.active = wp.zeros(RELAXATIONS if touching else 0, dtype=wp.int32, device=device)
    data.moving = wp.zeros((w, RELAXATIONS if touching else 0), dtype=wp.int32, device=device)
    data.way = wp.zeros((w, touching if f.in_turn else 0), dtype=wp.float64, device=device)
    data.due = empty((listed if f.in_turn else 0, MAX_BODY_CONTACTS), wp.float64, device)
    data.share = wp.zeros((w, min(CHUNKS, touching)), dtype=wp.vec2, device=device)
    data.slot = wp.zeros((w, b if f.soft_contacts and f.inlet else 0), dtype=wp.int32, device=device)
    slots = w * b if f.soft_contacts else 0
    data.place = wp.zeros((2, slots), dtype=wp.vec4, device=device)
    listed_once = f.lanes and f.soft_contacts and f.pairs
    data.push = wp.zeros(slots if listed_once else 0, dtype=wp.vec4l, device=device)
    blocks = slots + PAIRS if listed_once else 0
    if in_columns(f):
        blocks = w * data.near.elements + PAIRS
    data.sorted = wp.zeros((4, blocks), dtype=wp.float32, device=device)
    ordered = w * b if f.soft_contacts or f.lanes or f.blocks else 0
    data.order = wp.zeros((2, ordered), dtype=wp.int32, device=device)
    return data


def allocate_entries(model: Model, elements: int) -> Annotated[Any, EntryData]:
    """Room for the contacts of worlds whose threads share them out; of no length in others."""
    f, w, device = model.features, model.worlds, model.device
    data = EntryData()
    own = w if shares_entries(f) else 0
    room = own * elements * MAX_BODY_CONTACTS
    data.total = wp.zeros(own, dtype=wp.int32, device=device)
    for name in ("pair", "body"):
        setattr(data, name, empty(room, wp.vec2i, device))
    data.part = empty((parts(f), room), wp.vec4, device)
    for name in ("load", "likely", "free", "row_sum"):
        setattr(data, name, empty(room, wp.float32, device))
    data.ahead = empty((2, room), wp.float32, device)
    data.link = empty((own * f.bodies, MAX_BODY_CONTACTS), wp.int32, device)
    data.touched = wp.zeros(own * f.bodies, dtype=wp.int32, device=device)
    data.touches = wp.zeros(own, dtype=wp.int32, device=device)
    data.links = wp.zeros((own, f.bodies), dtype=wp.int32, device=device)
    data.weight = wp.zeros((own, 2), dtype=wp.int64, device=device)
    data.sweeps = wp.zeros(own, dtype=wp.int32, device=device)
    return data


def allocate_push(model: Model) -> Annotated[Any, PushData]:
    """What the contacts move in a step."""
    w, f, device = model.worlds, model.features, model.device
    touching = f.bodies if f.contacts and not f.soft_contacts else 0
    push = PushData()
    push.linear = wp.zeros((w, touching), dtype=wp.vec3, device=device)
    push.angular = wp.zeros((w, touching if f.rigid else 0), dtype=wp.vec3, device=device)
    return push
