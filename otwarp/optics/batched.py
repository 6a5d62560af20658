"""Exact forces in batches on a Warp device: tables of one beam and sphere, buckets of capacity, launches."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.device import empty
from otwarp.errors import InputError
from otwarp.kernels.core.exact_data import ROW, ExactData
from otwarp.kernels.optics.exact import exact_force_kernel
from otwarp.kernels.optics.exact_room import WARP, room_of
from otwarp.optics.beam import Beam
from otwarp.optics.exact import checked_points, evaluate, quadrature_nodes
from otwarp.optics.harmonics import gauss_legendre, wigner_d
from otwarp.optics.mie import Particle, highest_order, mie_coefficients

GROWTH = 1.25
"""Nodes of a rule of quadrature over those of the one before, nearly."""

MOST_NODES = 4096
"""Nodes of the largest rule: a thread keeps 0.3 MB. Points beyond, over 700 µm away, are left to NumPy."""

MOST_ENTRIES = 3e7
"""Entries of the largest table, 0.25 GB: for spheres of many multipoles it ends the rules earlier."""

NEGLIGIBLE = 1e-17
"""Part of the largest weight, or of the beam's amplitude in a row of the table, that is left out."""

LAUNCH_SHARE = 1.0 / 32.0
"""Part of a GPU's memory that the threads of one launch keep: enough of them to fill an H200 up to 1024 nodes."""

CHUNK_PER_CORE = 64
"""Points of one launch on a CPU, whose cores share out the launches."""

BLOCK = 64
"""Threads per block: enough to share rows of the table, few enough to find room for their local arrays."""


@dataclass(frozen=True, eq=False)
class _Rule:
    """Quadrature of one beam up to one distance: nodes, weights, angular functions; see `ExactData`."""

    cosine: np.ndarray
    sine: np.ndarray
    weight: np.ndarray
    first_node: np.ndarray
    table: np.ndarray


@dataclass(frozen=True, eq=False)
class PackedForce:
    """Tables of one beam and sphere on a device, and the room their kernel needs.

    Attributes:
        data: For `exact_force_term` and `exact_force_kernel`.
        orders, nodes: Capacities to compose them with.
        reach: Largest distance from the focus that is served [µm].
    """

    data: Annotated[Any, ExactData]
    orders: int
    nodes: int
    reach: float

    def with_room(self, threads: int) -> Annotated[Any, ExactData]:
        """`data` for a launch of up to so many threads of a GPU, with room for what they keep."""
        return in_room(self.data, room_for(threads, self.orders, self.nodes, self.data.table.device))


def batched_force(
    beam: Beam, sphere: Particle, points: np.ndarray, *, device: wp.Device | str | None = None
) -> np.ndarray:
    """Dimensionless force Q, in float64, as `otwarp.optics.force` but on a Warp device.

    Agrees with NumPy to 1e-10 for spheres up to 3 µm and to 1e-8 up to 10 µm. The first call for a range of sizes
    compiles a kernel, the first one for a beam, sphere and distance makes tables.

    Args:
        beam: The incident beam.
        sphere: The sphere.
        points: (n, 3) centres of the sphere relative to the focus [µm].
        device: Warp device or its name, None for Warp's default.

    Returns:
        (n, 3) Q: the force is `beam.force_scale`·Q.

    Raises:
        InputError: As `otwarp.optics.evaluate`, or no such device.
    """
    places, orders = checked_points(beam, sphere, points)
    where = _device(device)
    # a little more, so that the device cannot round a point beyond the rule chosen here
    extent = beam.wavenumber * np.linalg.norm(places, axis=1) * (1.0 + 1e-12)
    far = extent > _furthest(beam, orders)
    out = np.empty_like(places)
    if np.any(far):
        out[far] = evaluate(beam, sphere, places[far]).force
    near = np.flatnonzero(~far)
    if len(near) == 0:
        return out
    rule = _rule_of(orders, extent)
    packed = _packed(beam.with_power(1.0), sphere, int(rule[near].max()) + 1, where.alias)
    # neighbours in a batch should do the same work: the same rule, and Bessel functions of like argument
    sequence = near[np.lexsort((np.hypot(places[near, 0], places[near, 1]), rule[near]))]
    kernel = exact_force_kernel(packed.orders, packed.nodes, shared=where.is_cuda)
    if where.is_cpu:
        # once, before threads may race for it
        kernel.module.load(where, 1)
        out[sequence] = _on_cores(kernel, packed.data, places[sequence], where)
        return out
    most = LAUNCH_SHARE * where.total_memory / (16 * room_of(packed.orders, packed.nodes))
    chunk = max(1, min(len(sequence), int(most)))
    data = packed.with_room(chunk)
    for first in range(0, len(sequence), chunk):
        chosen = sequence[first : first + chunk]
        there = wp.array(places[chosen], dtype=wp.vec3d, device=where)
        found = empty(len(chosen), wp.vec3d, where)
        wp.launch(kernel, dim=len(chosen), inputs=[data, there, 0], outputs=[found], device=where, block_dim=BLOCK)
        out[chosen] = found.numpy()
    return out


def _on_cores(kernel: wp.Kernel, data: Annotated[Any, ExactData], places: np.ndarray, device: wp.Device) -> np.ndarray:
    """Q at `places`, in launches that the cores of this process share."""
    points = wp.array(np.ascontiguousarray(places), dtype=wp.vec3d, device=device)
    found = empty(len(places), wp.vec3d, device)

    def launch(first: int) -> None:
        count = min(CHUNK_PER_CORE, len(places) - first)
        wp.launch(kernel, dim=count, inputs=[data, points, first], outputs=[found], device=device)

    starts = range(0, len(places), CHUNK_PER_CORE)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if len(starts) == 1 or cores == 1:
        for first in starts:
            launch(first)
    else:
        with ThreadPoolExecutor(cores) as pool:
            list(pool.map(launch, starts))
    return found.numpy()


def _device(device: wp.Device | str | None) -> wp.Device:
    try:
        return wp.get_device(device)
    except (RuntimeError, ValueError) as error:
        known = ", ".join(d.alias for d in wp.get_devices())
        raise InputError(f"device is {str(device)!r}; allowed: {known}") from error


def _extent_of(orders: int, rule: np.ndarray | int) -> np.ndarray:
    """Largest k·distance that a rule serves: the number of nodes is nearly proportional to orders + 70 + extent."""
    return (orders + 70.0) * (np.power(GROWTH, np.add(rule, 1)) - 1.0)


def _rule_of(orders: int, extent: np.ndarray) -> np.ndarray:
    """Number of the rule that serves each k·distance."""
    rule = np.ceil(np.log1p(extent / (orders + 70.0)) / math.log(GROWTH)).astype(int) - 1
    rule = np.maximum(rule, 0)
    # rounding must not put a point beyond the extent of its rule
    return rule + (extent > _extent_of(orders, rule))


def _furthest(beam: Beam, orders: int) -> float:
    """Extent of the largest rule that has at most `MOST_NODES` and `MOST_ENTRIES`."""
    most = min(MOST_NODES, MOST_ENTRIES / orders**2)
    extents = _extent_of(orders, np.arange(32))
    return float(max((e for e in extents if quadrature_nodes(orders, float(e) + beam.aberration) <= most), default=0.0))


def pack_force(beam: Beam, sphere: Particle, *, reach: float, device: wp.Device | str | None = None) -> PackedForce:
    """Tables for the force within `reach` [µm] of the focus; the last few are kept.

    Raises:
        InputError: A sphere too large to converge, a reach too large for the kernel, or no such device.
    """
    _, orders = checked_points(beam, sphere, np.zeros((0, 3)))
    furthest = _furthest(beam, orders) / beam.wavenumber
    if not 0.0 < reach <= furthest:
        raise InputError(f"reach of the exact force is {reach:g} µm; allowed: above 0, up to {furthest:.3g} µm")
    rules = int(_rule_of(orders, np.array([beam.wavenumber * reach]))[0]) + 1
    return _packed(beam.with_power(1.0), sphere, rules, _device(device).alias)


@lru_cache(maxsize=8)
def _packed(beam: Beam, sphere: Particle, rules: int, device: str) -> PackedForce:
    orders = highest_order(beam.wavenumber * sphere.radius)
    extents = _extent_of(orders, np.arange(rules))
    parts = [_rule(beam, orders, quadrature_nodes(orders, float(e) + beam.aberration)) for e in extents]
    counts = [len(p.cosine) for p in parts]
    right, left = beam.helicities()

    def put(values: np.ndarray | list, kind: type) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=device)

    def pairs(values: np.ndarray) -> wp.array:
        return put(np.stack([np.real(values), np.imag(values)], axis=-1), wp.vec2d)

    data = ExactData()
    data.wavenumber, data.orders, data.charge = beam.wavenumber, orders + 1, beam.charge
    data.right, data.left = abs(right) ** 2, abs(left) ** 2
    mixed = right.conjugate() * left
    data.mixed = wp.vec2d(mixed.real, mixed.imag)
    data.extent = put(extents, wp.float64)
    data.node_start = put(np.cumsum([0, *counts]), wp.int32)
    data.table_start = put(np.cumsum([0, *(p.table.size for p in parts)])[:-1], wp.int64)
    data.cosine = put(np.concatenate([p.cosine for p in parts]), wp.float64)
    data.sine = put(np.concatenate([p.sine for p in parts]), wp.float64)
    data.weight = pairs(np.concatenate([p.weight for p in parts]))
    data.row_start = put(_row_start(orders + 1), wp.int32)
    data.first_node = put(np.stack([p.first_node for p in parts]), wp.int32)
    data.table = put(np.concatenate([p.table for p in parts]), wp.float64)
    data.root = put(np.sqrt(np.maximum(np.arange(2 * orders + 8) - 1.0, 0.0)), wp.float64)
    same, cross, turn = _responses(beam, sphere, orders)
    data.same, data.cross, data.turn = pairs(same), pairs(cross), pairs(turn)
    return PackedForce(
        data=data,
        orders=_capacity(orders + 1, 32),
        nodes=_capacity(max(counts), 128),
        reach=float(extents[-1]) / beam.wavenumber,
    )


def room_for(threads: int, orders: int, nodes: int, device: wp.Device) -> wp.array:
    """What up to so many threads of a GPU keep of exact forces with these capacities; of length 0 on a CPU."""
    warps = -(-threads // WARP) if device.is_cuda else 0
    return empty(warps * WARP * room_of(orders, nodes), wp.vec2d, device)


def in_room(data: Annotated[Any, ExactData], room: wp.array) -> Annotated[Any, ExactData]:
    """A copy of `data` whose threads keep what they need in `room`."""
    out = ExactData()
    for name in ExactData.vars:
        setattr(out, name, getattr(data, name))
    out.room = room
    return out


def _capacity(needed: int, least: int) -> int:
    """Room in powers of two, so that few kernels serve all sizes."""
    return max(least, 1 << (needed - 1).bit_length())


def _row_start(orders: int) -> np.ndarray:
    """(orders + 2) first row of each |m| = 0 … orders, and the number of rows."""
    rows = [-(-(orders + 1 - max(m, 1)) // ROW) for m in range(orders + 1)]
    return np.cumsum([0, *rows])


def _responses(beam: Beam, sphere: Particle, orders: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`same`, `cross` and `turn` of `ExactData`, for n = 0 … orders + 2.

    A wave of order n leaves with the fraction 1 − 2b_n (a_n if magnetic) of its amplitude; b'* + b − 2b'* b is the
    momentum that two neighbours exchange. u_n = √(n² − 1)/(n √(4n² − 1)) is the part of cos t that depends on n alone.
    """
    a, b = np.zeros(orders + 3, dtype=complex), np.zeros(orders + 3, dtype=complex)
    ratio = complex(sphere.index) / beam.medium_index
    a[1 : orders + 1], b[1 : orders + 1] = mie_coefficients(beam.wavenumber * sphere.radius, ratio, orders)

    def exchange(upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
        return np.conj(upper) + lower - 2.0 * np.conj(upper) * lower

    n = np.arange(1.0, orders + 3)
    u = np.sqrt(n * n - 1.0) / (n * np.sqrt(4.0 * n * n - 1.0))
    sums, differences = exchange(b[1:], b[:-1]), exchange(a[1:], a[:-1])
    same, cross, turn = (np.zeros(orders + 3, dtype=complex) for _ in range(3))
    same[1:], cross[1:] = u * (sums + differences), u * (sums - differences)
    turn[1:] = exchange(b, a)[1:] / (n * (n + 1.0))
    return same, cross, turn


@lru_cache(maxsize=8)
def _rule(beam: Beam, orders: int, nodes: int) -> _Rule:
    """Gauss–Legendre rule of `nodes` nodes, less those where the beam is dark, and its table up to n = orders + 1."""
    x, w = gauss_legendre(nodes)
    t = 0.5 * beam.edge * (x + 1.0)
    measure = 0.5 * beam.edge * w * np.sin(t)
    weight = beam.amplitude(t) * measure
    power = 2.0 * math.pi * float(np.sum(measure * np.abs(beam.amplitude(t)) ** 2))
    weight *= 2.0 * math.pi / math.sqrt(power)
    lit = np.abs(weight) > NEGLIGIBLE * np.abs(weight).max()
    t, weight = t[lit], weight[lit]
    highest = orders + 1
    row_start = _row_start(highest)
    first_node = np.zeros(row_start[-1], dtype=np.int32)
    table = np.zeros((row_start[-1], len(t), 2, ROW))
    for m in range(highest + 1):
        lowest, rows = max(m, 1), slice(row_start[m], row_start[m + 1])
        padded = np.zeros((2, len(t), ROW * (row_start[m + 1] - row_start[m])))
        for i, helicity in enumerate((1, -1)):
            padded[i, :, : highest + 1 - lowest] = wigner_d(highest, m, helicity, np.cos(t))[:, lowest:]
        table[rows] = padded.reshape(2, len(t), -1, ROW).transpose(2, 1, 0, 3)
        share = np.abs(table[rows]).max(axis=(2, 3)) * np.abs(weight)
        first_node[rows] = np.argmax(np.cumsum(share, axis=1) > NEGLIGIBLE, axis=1)
    return _Rule(np.cos(t), np.sin(t), weight, first_node, table.ravel())
