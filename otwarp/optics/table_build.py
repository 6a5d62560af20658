"""Making a force table: exact samples on coarse grids, splines through them, and nodes taken from the splines.

An exact force costs far more than a spline's value, and the field is band-limited by the light's wavelength, so a
fifth-order spline through exact samples λ/6n apart is already within 1e-4 of the peak. Each level refines its samples
until the spline is right on random points, then its nodes until they are right on the spline, and the finished table is
checked on points that nothing before has seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import RectBivariateSpline

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.laws.table import BLEND, STENCILS, Interpolation
from otwarp.optics import table_cache
from otwarp.optics.analysis import TrapProperties, trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.field import Field, force
from otwarp.optics.mie import Particle
from otwarp.optics.table import (
    ForceTable,
    TableLevel,
    check_accuracy,
    combine,
    layer_count,
    major_axis,
    steepest_slope,
)

SAMPLE_SHARE, NODE_SHARE = 0.2, 0.7
"""Shares of the tolerance for the splines through exact samples and for the interpolation between nodes."""

STUCK = 2.5
"""Times its share that a spline's error may be where finer samples do not lower it; the finished table is judged all
the same."""

PROBES = 300
"""Random points on which a level's spline is judged."""

UNSEEN = 3000
"""Points on which a finished table is judged."""

MOST_NODES = 2e7
"""Nodes of one level, times layers, beyond which a table is refused: a quarter of a gigabyte, and ten times that while
it is made."""

MIRROR = 8
"""Samples mirrored to ρ < 0, so that the spline knows the symmetry of the axis."""

MARGIN = 3
"""Samples beyond a level's radius."""

_PARITY = np.array([-1.0, -1.0, 1.0])
"""Of F_ρ, F_φ, F_z under (ρ, φ) → (−ρ, φ + π), which is the same place; cos 2φ and sin 2φ do not change."""


def build_table(
    beam: Beam,
    sphere: Particle,
    *,
    tolerance: float = 1e-3,
    interpolation: Interpolation = "bilinear",
    cache: Path | bool = True,
    device: str | None = None,
) -> ForceTable:
    """Take a table from the disk cache, or make it.

    Args:
        beam: The beam; its power does not matter.
        sphere: The sphere.
        tolerance: Largest error of the force over its peak, 1e-5 to 0.1.
        interpolation: `bilinear`, which is fastest, or `bicubic`, which is smooth and smaller.
        cache: Folder of the cache, True for the user's, False for none.
        device: Name of the Warp device that evaluates exact forces; None for the best there is.

    Raises:
        InputError: A tolerance out of range, an unknown interpolation, a field that does not converge, or a table that
            would grow too large.
    """
    check_accuracy(tolerance, interpolation)
    folder = table_cache.cache_folder() if cache is True else cache
    table = table_cache.load(folder, beam, sphere, tolerance, interpolation) if folder else None
    if table is None:
        table = _made(beam, sphere, tolerance=tolerance, interpolation=interpolation, device=device)
        if folder:
            table_cache.save(folder, table)
    return table


def _made(
    beam: Beam, sphere: Particle, *, tolerance: float, interpolation: Interpolation, device: str | None
) -> ForceTable:
    """A table whose error on unseen points is below `tolerance`·peak."""
    where = pick_device(device).alias

    def field(points: np.ndarray) -> np.ndarray:
        return force(beam, sphere, points, device=where)

    core = 1.2 * sphere.radius + 1.5 * beam.wavelength
    near = core + abs(beam.focus_shift)
    peak = _peak(field, beam, sphere, near)
    cutoff = _cutoff(field, near, tolerance * peak)
    count = 1 + max(0, math.floor(math.log2(cutoff / near)))
    rng = np.random.default_rng(20240607)
    shrink = 1.0
    for _ in range(4):
        levels, inner = [], 0.0
        for n in range(count):
            radius = cutoff / 2 ** (count - 1 - n)
            spline = _refine(field, beam, inner, radius, core, shrink * SAMPLE_SHARE * tolerance * peak, rng)
            levels.append(_nodes(spline, inner, radius, shrink * NODE_SHARE * tolerance * peak, interpolation))
            inner = radius
        table = ForceTable(
            beam=beam.with_power(1.0),
            sphere=sphere,
            tolerance=tolerance,
            interpolation=interpolation,
            peak=peak,
            error=math.inf,
            properties=None,
            steepest=0.0,
            levels=tuple(levels),
        )
        points = unseen_points(table, UNSEEN, rng)
        error = float(np.linalg.norm(table.force(points) - field(points), axis=1).max()) / peak
        # what a few thousand points find is short of the largest error by a few per cent
        if error <= 0.9 * tolerance:
            measured = {"error": error, "properties": _properties(table, where), "steepest": steepest_slope(table)}
            return ForceTable(**(vars(table) | measured))
        shrink *= 0.7 * tolerance / error
    raise InputError(
        f"force table of a sphere of radius {sphere.radius:g} µm missed tolerance {tolerance:g} with {error:.3g}; "
        "allowed: a larger one"
    )


def _properties(table: ForceTable, device: str) -> TrapProperties | None:
    try:
        return trap_properties(table.beam, table.sphere, device=device)
    except InputError:
        return None


def unseen_points(table: ForceTable, count: int, rng: np.random.Generator) -> np.ndarray:
    """(about 1.25 count, 3) random points, uniform in (ρ, z).

    Shared equally by the levels and the shell beyond the cutoff, and a quarter more about the focus.
    """
    bounds = [0.0, *(level.radius for level in table.levels), 1.2 * table.cutoff]
    rows = []
    for n in range(len(bounds) - 1):
        share = count // (len(bounds) - 1)
        rho, z = _in_annulus(bounds[n], bounds[n + 1], share, rng)
        phi = rng.uniform(0.0, 2.0 * math.pi, share)
        rows.append(np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=1))
    core = 1.2 * table.sphere.radius + 1.5 * table.beam.wavelength
    rho, z = _about_focus(table.beam, core, count // 4, rng)
    phi = rng.uniform(0.0, 2.0 * math.pi, len(rho))
    rows.append(np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=1))
    return np.concatenate(rows)


def _in_annulus(inner: float, outer: float, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    distance = np.sqrt(rng.uniform(inner**2, outer**2, count))
    angle = rng.uniform(0.0, math.pi, count)
    return distance * np.sin(angle), distance * np.cos(angle)


def _about_focus(beam: Beam, core: float, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    rho, z = _in_annulus(0.0, core, count, rng)
    return rho, z + beam.focus_shift


def _peak(field: Field, beam: Beam, sphere: Particle, near: float) -> float:
    """Largest |Q|, on a grid that resolves the wavelength, along and across the polarization."""
    step = min(0.12 * beam.wavelength, 0.1 * near)
    axis = np.arange(0.0, near, step)
    rho, z = (a.ravel() for a in np.meshgrid(axis, np.concatenate([-axis[:0:-1], axis]), indexing="ij"))
    turn = major_axis(beam)
    # cos 2φ alone is extreme at 0 and 90°; with sin 2φ it may be anywhere
    sides = turn + {1: np.zeros(1), 2: np.array([0.0, 0.5]), 3: np.arange(8) / 8.0}[layer_count(beam)] * math.pi
    q = [field(np.stack([rho * math.cos(p), rho * math.sin(p), z], axis=1)) for p in sides]
    return float(max(np.linalg.norm(f, axis=1).max() for f in q))


def _cutoff(field: Field, near: float, limit: float) -> float:
    """Radius of the last level: from `BLEND` of it on, the force is below `limit`."""
    angle = np.linspace(0.0, math.pi, 61)
    azimuth = np.array([0.0, 0.25, 0.5, 0.75]) * math.pi
    theta, phi = (a.ravel() for a in np.meshgrid(angle, azimuth, indexing="ij"))
    way = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    distance = near
    while True:
        force_there = float(np.linalg.norm(field(distance * way), axis=1).max())
        if force_there <= 0.8 * limit:
            return distance / BLEND
        # the force falls as 1/d² far away, faster near the focus: step carefully
        distance *= min(1.5, max(1.04, 0.97 * math.sqrt(force_there / (0.8 * limit))))


@dataclass(frozen=True, eq=False)
class _Spline:
    """Fifth-order splines of all components, on ρ from −MIRROR samples to the radius and beyond."""

    parts: list[list[RectBivariateSpline]]
    spacing: float

    def at(self, rho: np.ndarray, z: np.ndarray) -> np.ndarray:
        """(n, layers, 3) at scattered points."""
        return np.stack([np.stack([s.ev(rho, z) for s in row], axis=-1) for row in self.parts], axis=-2)

    def grid(self, rho: np.ndarray, z: np.ndarray, dr: int = 0, dz: int = 0) -> np.ndarray:
        """(rows, columns, layers, 3) at the products of two axes, or a derivative there."""
        return np.stack(
            [np.stack([s(rho, z, dx=dr, dy=dz).T for s in row], axis=-1) for row in self.parts],
            axis=-2,
        )


def sample_layers(field: Field, beam: Beam, rho: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(n, layers, 3): the constant, cos 2φ and sin 2φ parts of F_ρ, F_φ, F_z, from one or three azimuths."""
    count = layer_count(beam)
    azimuths = np.arange(1 if count == 1 else 3) * math.pi / 3.0
    turn = major_axis(beam)
    samples = []
    for phi in azimuths:
        c, s = math.cos(phi + turn), math.sin(phi + turn)
        q = field(np.stack([rho * c, rho * s, z], axis=1))
        samples.append(np.stack([q[:, 0] * c + q[:, 1] * s, q[:, 1] * c - q[:, 0] * s, q[:, 2]], axis=1))
    if count == 1:
        return samples[0][:, None, :]
    # discrete Fourier sums over φ = 0, 60°, 120° separate the three parts exactly
    stacked = np.stack(samples)
    constant = stacked.mean(axis=0)
    even = np.tensordot(2.0 / 3.0 * np.cos(2.0 * azimuths), stacked, axes=1)
    odd = np.tensordot(2.0 / 3.0 * np.sin(2.0 * azimuths), stacked, axes=1)
    first = np.stack([even[:, 0], odd[:, 1], even[:, 2]], axis=1)
    second = np.stack([odd[:, 0], even[:, 1], odd[:, 2]], axis=1)
    return np.stack([constant, first, second][:count], axis=1)


def _sampled(field: Field, beam: Beam, radius: float, intervals: int) -> _Spline:
    """Exact samples `radius`/`intervals` apart, mirrored at the axis, and the splines through them."""
    spacing = radius / intervals
    i = np.arange(intervals + MARGIN + 1)
    j = np.arange(-intervals - MARGIN, intervals + MARGIN + 1)
    rho, z = np.meshgrid(i * spacing, j * spacing, indexing="ij")
    layers = sample_layers(field, beam, rho.ravel(), z.ravel()).reshape(*rho.shape, layer_count(beam), 3)
    mirrored = np.concatenate([_PARITY * layers[MIRROR:0:-1], layers])
    x = np.concatenate([-i[MIRROR:0:-1], i]) * spacing
    parts = [
        [RectBivariateSpline(x, j * spacing, mirrored[:, :, n, c], kx=5, ky=5, s=0) for c in range(3)]
        for n in range(layer_count(beam))
    ]
    return _Spline(parts, spacing)


def _refine(
    field: Field, beam: Beam, inner: float, radius: float, core: float, allowed: float, rng: np.random.Generator
) -> _Spline:
    """Spline of one level that is within `allowed` of exact forces on random points of the annulus that it serves.

    Half as many more lie within `core` of the focus, which aberration may have moved far from the middle.
    """
    rho, z = _in_annulus(BLEND * inner, radius, PROBES, rng)
    if inner == 0.0:
        rho, z = (
            np.concatenate(pair) for pair in zip((rho, z), _about_focus(beam, core, PROBES // 2, rng), strict=True)
        )
    phi = rng.uniform(0.0, 2.0 * math.pi, len(rho))
    turn = major_axis(beam)
    c, s = np.cos(phi + turn), np.sin(phi + turn)
    q = field(np.stack([rho * c, rho * s, z], axis=1))
    exact = np.stack([q[:, 0] * c + q[:, 1] * s, q[:, 1] * c - q[:, 0] * s, q[:, 2]], axis=1)
    intervals = max(16, math.ceil(radius / (0.3 * beam.wavelength))) if inner == 0.0 else 20
    before = math.inf
    for _ in range(12):
        spline = _sampled(field, beam, radius, intervals)
        found = combine(spline.at(rho, z), np.cos(phi), np.sin(phi))
        error = float(np.linalg.norm(found - exact, axis=1).max())
        # behind a hard edge fringes as fine as the wavelength follow the axis for ever, too weak to be worth resolving
        if error <= allowed or (error > 0.75 * before and error <= STUCK * allowed):
            return spline
        before = error
        # sixth order once the field is resolved, slower before
        intervals = math.ceil(intervals * min(1.6, max(1.12, 1.05 * (error / allowed) ** (1.0 / 6.0))))
    raise InputError(
        f"samples within {radius:g} µm did not converge ({error:.2g} of {allowed:.2g}); allowed: a larger tolerance"
    )


def _nodes(spline: _Spline, inner: float, radius: float, allowed: float, interpolation: Interpolation) -> TableLevel:
    """Nodes taken from the spline so densely that interpolation stays within `allowed` of it."""
    order = 2 if interpolation == "bilinear" else 4
    intervals = math.ceil(radius / spline.spacing)
    for _ in range(12):
        if 2.0 * intervals**2 * len(spline.parts) > MOST_NODES:
            raise InputError(
                f"a {interpolation} force table of this accuracy needs more than {MOST_NODES:g} nodes within "
                f"{radius:.3g} µm; allowed: {'interpolation bicubic, ' if order == 2 else ''}a larger tolerance, a "
                "smaller sphere, or a focus less deep"
            )
        level = _level(spline, radius, intervals, interpolation)
        error = _node_error(spline, level, inner, interpolation)
        if error <= allowed:
            return level
        intervals = math.ceil(intervals * min(8.0, max(1.03, 1.01 * (error / allowed) ** (1.0 / order))))
    raise InputError(
        f"nodes within {radius:g} µm did not converge ({error:.2g} of {allowed:.2g}); allowed: a larger tolerance"
    )


def _level(spline: _Spline, radius: float, intervals: int, interpolation: Interpolation) -> TableLevel:
    h = radius / intervals
    if interpolation == "bilinear":
        rho, z = np.arange(-1, intervals + 2) * h, np.arange(-1, 2 * intervals + 2) * h - radius
        # linear interpolation of a curved function errs to one side; shifting the nodes by half of that halves it
        node = spline.grid(rho, z) - h * h / 16.0 * (spline.grid(rho, z, dr=2) + spline.grid(rho, z, dz=2))
        # F_ρ and F_φ vanish on the axis
        node[:, 1, :, :2] = 0.0
        node[:, 0] = _PARITY * node[:, 2]
    else:
        rho, z = np.arange(-3, intervals + 4) * h, np.arange(-3, 2 * intervals + 4) * h - radius
        node = _b_spline(_b_spline(spline.grid(rho, z), 0), 1)
    return TableLevel(radius, h, np.ascontiguousarray(node, dtype=np.float32))


def _b_spline(value: np.ndarray, axis: int) -> np.ndarray:
    """Coefficients of the cubic B-spline along an axis, two fewer at either end.

    The spline's values are (1 + δ²/6) times its coefficients; the inverse (1 − δ²/6 + δ⁴/36) is right to sixth order,
    local, and needs no conditions at the ends.
    """
    f = np.moveaxis(value, axis, 0)
    second = f[:-2] - 2.0 * f[1:-1] + f[2:]
    fourth = second[:-2] - 2.0 * second[1:-1] + second[2:]
    return np.moveaxis(f[2:-2] - second[1:-1] / 6.0 + fourth / 36.0, 0, axis)


def _node_error(spline: _Spline, level: TableLevel, inner: float, interpolation: Interpolation) -> float:
    """Largest difference from the spline at nodes, edge midpoints and centres of the cells that the level serves.

    The norms of the layers add up, which bounds the error at any azimuth.
    """
    h, radius = level.spacing, level.radius
    rows, columns = level.node.shape[0] - 3, level.node.shape[1] - 3
    first, weights_at = STENCILS[interpolation]
    weights = [(t, np.array(weights_at(t))) for t in (0.0, 0.5)]
    stencil = range(first + 1, first + 1 + len(weights[0][1]))
    worst = 0.0
    for row_shift, row_weight in weights:
        z = (np.arange(rows) + row_shift) * h - radius
        along = _weighted(row_weight, [level.node[k : k + rows] for k in stencil])
        for column_shift, column_weight in weights:
            rho = (np.arange(columns) + column_shift) * h
            value = _weighted(column_weight, [along[:, k : k + columns] for k in stencil])
            distance = np.hypot(rho[None, :], z[:, None])
            served = (distance >= BLEND * inner) & (distance <= radius)
            gap = np.linalg.norm(value - spline.grid(rho, z), axis=-1)[served]
            worst = max(worst, float(gap.sum(axis=-1).max()))
    return worst


def _weighted(weights: np.ndarray, parts: list[np.ndarray]) -> np.ndarray:
    """Σ weight·part, without the parts of weight 0."""
    total = np.zeros(parts[0].shape)
    for weight, part in zip(weights, parts, strict=True):
        if weight:
            total += weight * part
    return total
