"""Bodies, contact surfaces and obstacles of a scene as the arrays that kernels read."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.hydrodynamics.mobility import body_mobility, from_override
from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.kernels.contact.obstacles import FAR, SHAPES
from otwarp.kernels.core.types import BodyData, ContactData, ObstacleData, mat66
from otwarp.scene import Body, Scene, Sphere, Vec3
from otwarp.scene.meshes import is_closed
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.optics import TrapOptics
from otwarp.units import STANDARD_GRAVITY


def drag_spheres(body: Body) -> list[Sphere]:
    """Spheres that feel the liquid: those that say so, or all of a body in which none does."""
    return [s for s in body.spheres if s.drag] or list(body.spheres)


def mobilities(scene: Scene) -> list[BodyMobility]:
    """Mobility of every body, as accurate as it asks for; equal bodies share one evaluation.

    Raises:
        InputError: A given mobility that is none, or an accuracy out of reach.
    """
    file = f"{scene.file}: " if scene.file else ""
    return [_mobility(body, f"{file}{body.prim}:") for body in scene.bodies]


def _mobility(body: Body, where: str) -> BodyMobility:
    spheres, rods = drag_spheres(body), [r for r in body.rods if r.drag]
    centres, radii = np.array([s.offset for s in spheres]), np.array([s.radius for s in spheres])
    if body.mobility is not None:
        return from_override(body.mobility, centres, radii, where=f"{where} ot:body:mobility")
    ends = (np.array([r.start for r in rods]), np.array([r.end for r in rods]), np.array([r.radius for r in rods]))
    named = f"{where} ot:body:mobilityAccuracy"
    return body_mobility(centres, radii, rods=ends if rods else None, accuracy=body.mobility_accuracy, where=named)


def is_rigid(body: Body) -> bool:
    """Whether the body needs rotation: several spheres, a rod, or an authored mobility.

    A lone sphere has no orientation that anything depends on, wherever its prim's origin is.
    """
    return len(body.spheres) > 1 or bool(body.rods) or body.mobility is not None


def union_volume(body: Body) -> tuple[float, np.ndarray]:
    """Volume [µm³] and centroid (3,) in the prim's frame [µm] of the union of the body's spheres and rods.

    By midpoint counting on a cubic grid about the middle of the union, so that what is symmetric stays so; exact for
    one sphere.
    """
    volume, centroid = _union(tuple(_elements(body)))
    return volume, np.array(centroid)


def _elements(body: Body) -> list[tuple[Vec3, Vec3, float]]:
    """Ends of the axis and radius of every sphere and rod; the ends of a sphere are its centre."""
    spheres = [(s.offset, s.offset, s.radius) for s in body.spheres]
    return spheres + [(r.start, r.end, r.radius) for r in body.rods]


@lru_cache(maxsize=4096)
def _union(elements: tuple[tuple[Vec3, Vec3, float], ...], cells: int = 96) -> tuple[float, Vec3]:
    """Volume and centroid of a union of (end, end, radius); equal bodies are counted once."""
    starts, ends = np.array([a for a, _, _ in elements]), np.array([b for _, b, _ in elements])
    radii = np.array([r for _, _, r in elements])
    if len(radii) == 1 and elements[0][0] == elements[0][1]:
        return float(4.0 / 3.0 * np.pi * radii[0] ** 3), elements[0][0]
    low = (np.minimum(starts, ends) - radii[:, None]).min(0)
    high = (np.maximum(starts, ends) + radii[:, None]).max(0)
    middle, h = 0.5 * (low + high), (high - low).max() / cells
    counts = np.ceil((high - low) / h - 1e-9).astype(int)
    x, y, z = np.meshgrid(*[h * (np.arange(n) - 0.5 * (n - 1)) for n in counts], indexing="ij", sparse=True)
    inside = np.zeros(np.broadcast_shapes(x.shape, y.shape, z.shape), dtype=bool)
    for a, b, r in zip(starts - middle, ends - middle, radii, strict=True):
        axis = b - a
        t = np.zeros(())
        if axis.any():
            t = (((x - a[0]) * axis[0] + (y - a[1]) * axis[1] + (z - a[2]) * axis[2]) / (axis @ axis)).clip(0.0, 1.0)
        across = [p - a[k] - t * axis[k] for k, p in enumerate((x, y, z))]
        inside |= across[0] ** 2 + across[1] ** 2 + across[2] ** 2 < r * r
    centroid = middle + [float((axis * inside).sum()) / inside.sum() for axis in (x, y, z)]
    return float(inside.sum() * h**3), (float(centroid[0]), float(centroid[1]), float(centroid[2]))


def weight(scene: Scene, body: Body) -> float:
    """Weight minus buoyancy [pN] of what a body's parts fill together."""
    return (body.density - scene.medium.density) * union_volume(body)[0] * STANDARD_GRAVITY


def _ragged(rows: Sequence[np.ndarray], width: int) -> tuple[np.ndarray, np.ndarray]:
    """Start offsets and concatenation of per-body tables."""
    start = np.concatenate([[0], np.cumsum([len(r) for r in rows], dtype=int)])
    table = np.concatenate([np.zeros((0, width)), *[np.reshape(r, (-1, width)) for r in rows]])
    return start.astype(np.int32), table


def _spheres(body: Body, reference: np.ndarray, chosen: str) -> np.ndarray:
    """(n, 4) offset from the reference point and radius of the spheres for which the flag `chosen` is set."""
    rows = [[*(np.array(s.offset) - reference), s.radius] for s in body.spheres if getattr(s, chosen)]
    return np.array(rows).reshape(-1, 4)


def pack_bodies(scene: Scene, moves: list[BodyMobility], optics: TrapOptics, device: Place) -> Annotated[Any, BodyData]:
    """Mobility, sphere tables and bounds of the bodies."""
    shapes: dict[int, int] = {}
    shape_of = [shapes.setdefault(id(m), len(shapes)) for m in moves]
    distinct = list({id(m): m for m in moves}.values())
    data = device.typed(BodyData)()
    data.shape = device_array(shape_of, wp.int32, device)
    rigid = [is_rigid(b) for b in scene.bodies]
    data.rigid = device_array(rigid, wp.int32, device)
    data.translation = device_array([m.mobility[0, 0] for m in distinct], wp.float32, device)
    full = distinct if any(rigid) else []
    data.mobility = device_array([m.mobility for m in full], mat66, device)
    data.cholesky = device_array([m.cholesky for m in full], mat66, device)
    data.resistance = device_array([m.resistance for m in full], mat66, device)
    heavy = [weight(scene, b) for b in scene.bodies] if scene.settings.gravity else []
    data.weight = device_array(heavy, wp.float32, device)
    # weight and buoyancy both act at the centroid, for the density of a body is uniform
    turned = zip(scene.bodies, moves, strict=True) if heavy and any(rigid) else ()
    data.weight_arm = device_array([union_volume(b)[1] - m.reference for b, m in turned], wp.vec3, device)
    bounds = [
        max(np.linalg.norm(np.array(end) - m.reference) + e[2] for e in _elements(b) for end in e[:2])
        for b, m in zip(scene.bodies, moves, strict=True)
    ]
    data.bound = device_array(bounds, wp.float32, device)
    trapped = [_spheres(b, m.reference, "trapped") for b, m in zip(scene.bodies, moves, strict=True)]
    start, table = _ragged(trapped, 4)
    data.trapped_start = device_array(start, wp.int32, device)
    data.trapped = device_array(table, wp.vec4, device)
    kinds = [optics.kind(s.radius, s.refractive_index) for b in scene.bodies for s in b.spheres if s.trapped]
    data.trapped_kind = device_array(kinds, wp.int32, device)
    data.largest = device_array([t[:, 3].max(initial=0.0) for t in trapped], wp.float32, device)
    _pack_flow_coupling(data, scene, moves, device)
    return data


def _pack_flow_coupling(data: Annotated[Any, BodyData], scene: Scene, moves: list[BodyMobility], device: Place) -> None:
    """How the spheres of rigid bodies couple to the flow; empty without a flow or without rigid bodies."""
    offsets, couplings = [], []
    for body, move in zip(scene.bodies, moves, strict=True):
        spheres = drag_spheres(body)
        assert len(spheres) == len(move.flow_coupling), f"{body.name}: one flow coupling per sphere that feels drag"
        wanted = scene.flow is not None and is_rigid(body)
        rows = [[*(np.array(s.offset) - move.reference), s.radius] for s in spheres if wanted]
        offsets.append(np.array(rows).reshape(-1, 4))
        couplings.append(move.flow_coupling if wanted else np.zeros((0, 6, 6)))
    start, table = _ragged(offsets, 4)
    data.drag_start = device_array(start, wp.int32, device)
    data.drag_sphere = device_array(table, wp.vec4, device)
    data.flow_coupling = device_array(np.concatenate([np.zeros((0, 6, 6)), *couplings]), mat66, device)


def _colliding(body: Body, reference: np.ndarray) -> np.ndarray:
    """(n, 7) middle from the reference point, radius, and half axis of the spheres and rods that collide."""
    rods = [(r.start, r.end, r.radius) for r in body.rods if r.collides]
    spheres = [(s.offset, s.offset, s.radius) for s in body.spheres if s.collides]
    ends = [(np.array(a), np.array(b), radius) for a, b, radius in spheres + rods]
    return np.array([[*(0.5 * (a + b) - reference), r, *(0.5 * (b - a))] for a, b, r in ends]).reshape(-1, 7)


def pack_contact(
    scene: Scene, moves: list[BodyMobility], wanted: bool, device: Place, *, rods: bool = False
) -> Annotated[Any, ContactData]:
    """Colliding spheres, with `rods` the axes of rods, and surfaces; empty tables when nothing can touch anything."""
    bodies = list(zip(scene.bodies, moves, strict=True)) if wanted else []
    rows = [_colliding(b, m.reference) for b, m in bodies]
    start, table = _ragged(rows, 7)
    data = device.typed(ContactData)()
    data.start = device_array(start, wp.int32, device)
    data.sphere = device_array(table[:, :4], wp.vec4, device)
    data.half = device_array(table[:, 4:] if rods else np.zeros((0, 3)), wp.vec3, device)
    owner = [i for i, r in enumerate(rows) for _ in r]
    data.body = device_array(owner, wp.int32, device)
    surfaces = [b.material for b, _ in bodies]
    compliance = [(1.0 - s.poisson_ratio**2) / s.youngs_modulus for s in surfaces]
    data.compliance = device_array(compliance, wp.float32, device)
    data.adhesion = device_array([s.adhesion for s in surfaces], wp.float32, device)
    data.adhesion_range = device_array([s.adhesion_range for s in surfaces], wp.float32, device)
    return data


def pack_obstacles(scene: Scene, wanted: bool, device: Place) -> tuple[Annotated[Any, ObstacleData], list[wp.Mesh]]:
    """Obstacles and the meshes that must outlive the model; empty tables when nothing can hit them."""
    obstacles = scene.obstacles if wanted else ()
    meshes, ids, bounds = [], [], []
    for o in obstacles:
        ids.append(0)
        if o.shape == "mesh":
            mesh = wp.Mesh(
                points=device_array(o.vertices, wp.vec3, device.device),
                indices=device_array(o.triangles.ravel(), wp.int32, device),
            )
            meshes.append(mesh)
            ids[-1] = mesh.id
        bounds.append(obstacle_bound(o.shape, o.size, o.vertices))
    keys = [0, *np.cumsum([len(o.position.times) for o in obstacles], dtype=int)]
    data = device.typed(ObstacleData)()
    data.shape = device_array([SHAPES[o.shape][0] for o in obstacles], wp.int32, device)
    data.size = device_array([o.size for o in obstacles], wp.vec3, device)
    data.mesh = device_array(ids, wp.uint64, device)
    sheets = [o.shape == "mesh" and not is_closed(o.vertices, o.triangles) for o in obstacles]
    data.sheet = device_array(sheets, wp.int32, device)
    data.bound = device_array(bounds, wp.float32, device)
    data.key_start = device_array(keys, wp.int32, device)
    times = np.concatenate([np.zeros(0), *[o.position.times for o in obstacles]])
    places = np.concatenate([np.zeros((0, 3)), *[o.position.values for o in obstacles]])
    turns = np.concatenate([np.zeros((0, 4)), *[o.orientation.values for o in obstacles]])
    data.key_time = device_array(times, wp.float64, device)
    data.key_position = device_array(places, wp.vec3, device)
    data.key_rotation = device_array(turns, wp.quat, device)
    return data, meshes


def obstacle_bound(shape: str, size: tuple[float, float, float], vertices: np.ndarray) -> float:
    """Radius about its origin that holds the whole obstacle [µm]; a plane has no end."""
    if shape == "plane":
        return float(FAR)
    if shape == "mesh":
        return float(np.linalg.norm(vertices, axis=1).max())
    if shape == "capsule":
        return size[0] + size[1]
    return float(np.linalg.norm(size))
