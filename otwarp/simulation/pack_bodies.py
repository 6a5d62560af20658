"""Bodies, contact surfaces and obstacles of a scene as the arrays that kernels read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from otwarp.hydrodynamics.mobility import BodyMobility, body_mobilities, from_override
from otwarp.kernels.obstacles import FAR, SHAPES
from otwarp.kernels.types import BodyData, ContactData, ObstacleData, mat66
from otwarp.scene.description import Body, Scene
from otwarp.simulation.arrays import device_array
from otwarp.units import STANDARD_GRAVITY


def mobilities(scene: Scene) -> list[BodyMobility]:
    """Mobility of every body; equal bodies share one evaluation."""
    dragging = [
        ([s for s in body.spheres if s.drag] or list(body.spheres)) if body.mobility is None else list(body.spheres)
        for body in scene.bodies
    ]
    geometry = [(np.array([s.offset for s in spheres]), np.array([s.radius for s in spheres])) for spheres in dragging]
    computed = body_mobilities(geometry)
    return [
        computed[i]
        if body.mobility is None
        else from_override(body.mobility, *geometry[i], where=f"prim {body.prim}, attribute ot:body:mobility")
        for i, body in enumerate(scene.bodies)
    ]


def is_rigid(body: Body) -> bool:
    """Whether the body needs rotation: several spheres, one off-centre, or an authored mobility."""
    return len(body.spheres) > 1 or body.mobility is not None


def union_volume(body: Body, cells: int = 96) -> float:
    """Volume of the union of the body's spheres [µm³], by midpoint counting on a cubic grid (exact for one sphere)."""
    radii = np.array([s.radius for s in body.spheres])
    if len(radii) == 1:
        return float(4.0 / 3.0 * np.pi * radii[0] ** 3)
    centres = np.array([s.offset for s in body.spheres])
    low, high = (centres - radii[:, None]).min(0), (centres + radii[:, None]).max(0)
    h = (high - low).max() / cells
    axes = [np.arange(a + 0.5 * h, b, h) for a, b in zip(low, high, strict=True)]
    x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
    inside = np.zeros(np.broadcast_shapes(x.shape, y.shape, z.shape), dtype=bool)
    for c, r in zip(centres, radii, strict=True):
        inside |= (x - c[0]) ** 2 + (y - c[1]) ** 2 + (z - c[2]) ** 2 < r * r
    return float(inside.sum() * h**3)


def weight(scene: Scene, body: Body) -> float:
    """Weight minus buoyancy [pN]."""
    return (body.density - scene.medium.density) * union_volume(body) * STANDARD_GRAVITY


def _ragged(rows: Sequence[np.ndarray], width: int) -> tuple[np.ndarray, np.ndarray]:
    """Start offsets and concatenation of per-body tables."""
    start = np.concatenate([[0], np.cumsum([len(r) for r in rows], dtype=int)])
    table = np.concatenate([np.zeros((0, width)), *[np.reshape(r, (-1, width)) for r in rows]])
    return start.astype(np.int32), table


def _spheres(body: Body, reference: np.ndarray, chosen: str) -> np.ndarray:
    """(n, 4) offset from the reference point and radius of the spheres for which the flag `chosen` is set."""
    rows = [[*(np.array(s.offset) - reference), s.radius] for s in body.spheres if getattr(s, chosen)]
    return np.array(rows).reshape(-1, 4)


def pack_bodies(scene: Scene, moves: list[BodyMobility], device: wp.Device) -> BodyData:
    """Mobility, sphere tables and bounds of the bodies."""
    shapes: dict[int, int] = {}
    shape_of = [shapes.setdefault(id(m), len(shapes)) for m in moves]
    distinct = list({id(m): m for m in moves}.values())
    data = BodyData()
    data.shape = device_array(shape_of, wp.int32, device)
    rigid = [is_rigid(b) for b in scene.bodies]
    data.rigid = device_array(rigid, wp.int32, device)
    data.translation = device_array([m.mobility[0, 0] for m in distinct], wp.float32, device)
    full = distinct if any(rigid) else []
    data.mobility = device_array([m.mobility for m in full], mat66, device)
    data.cholesky = device_array([m.cholesky for m in full], mat66, device)
    heavy = [weight(scene, b) for b in scene.bodies] if scene.settings.gravity else []
    data.weight = device_array(heavy, wp.float32, device)
    bounds = [
        max(np.linalg.norm(np.array(s.offset) - m.reference) + s.radius for s in b.spheres)
        for b, m in zip(scene.bodies, moves, strict=True)
    ]
    data.bound = device_array(bounds, wp.float32, device)
    trapped = [_spheres(b, m.reference, "trapped") for b, m in zip(scene.bodies, moves, strict=True)]
    start, table = _ragged(trapped, 4)
    data.trapped_start = device_array(start, wp.int32, device)
    data.trapped = device_array(table, wp.vec4, device)
    data.largest = device_array([t[:, 3].max(initial=0.0) for t in trapped], wp.float32, device)
    _pack_flow_coupling(data, scene, moves, device)
    return data


def _pack_flow_coupling(data: BodyData, scene: Scene, moves: list[BodyMobility], device: wp.Device) -> None:
    """How the spheres of rigid bodies couple to the flow; empty without a flow or without rigid bodies."""
    offsets, couplings = [], []
    for body, move in zip(scene.bodies, moves, strict=True):
        spheres = [s for s in body.spheres if s.drag] or list(body.spheres)
        wanted = scene.flow is not None and is_rigid(body)
        offsets.append(np.array([np.array(s.offset) - move.reference for s in spheres]) if wanted else np.zeros((0, 3)))
        couplings.append(move.flow_coupling if wanted else np.zeros((0, 6, 6)))
    start, table = _ragged(offsets, 3)
    data.drag_start = device_array(start, wp.int32, device)
    data.drag_offset = device_array(table, wp.vec3, device)
    data.flow_coupling = device_array(np.concatenate([np.zeros((0, 6, 6)), *couplings]), mat66, device)


def pack_contact(scene: Scene, moves: list[BodyMobility], wanted: bool, device: wp.Device) -> ContactData:
    """Colliding spheres and surfaces; empty tables when nothing can touch anything."""
    bodies = list(zip(scene.bodies, moves, strict=True)) if wanted else []
    rows = [_spheres(b, m.reference, "collides") for b, m in bodies]
    start, table = _ragged(rows, 4)
    data = ContactData()
    data.start = device_array(start, wp.int32, device)
    data.sphere = device_array(table, wp.vec4, device)
    owner = [i for i, r in enumerate(rows) for _ in r]
    data.body = device_array(owner, wp.int32, device)
    surfaces = [b.material for b, _ in bodies]
    compliance = [(1.0 - s.poisson_ratio**2) / s.youngs_modulus for s in surfaces]
    data.compliance = device_array(compliance, wp.float32, device)
    data.adhesion = device_array([s.adhesion for s in surfaces], wp.float32, device)
    data.adhesion_range = device_array([s.adhesion_range for s in surfaces], wp.float32, device)
    return data


def pack_obstacles(scene: Scene, wanted: bool, device: wp.Device) -> tuple[ObstacleData, list[wp.Mesh]]:
    """Obstacles and the meshes that must outlive the model; empty tables when nothing can hit them."""
    obstacles = scene.obstacles if wanted else ()
    meshes, ids, bounds = [], [], []
    for o in obstacles:
        ids.append(0)
        if o.shape == "mesh":
            mesh = wp.Mesh(
                points=device_array(o.vertices, wp.vec3, device),
                indices=device_array(o.triangles.ravel(), wp.int32, device),
            )
            meshes.append(mesh)
            ids[-1] = mesh.id
        bounds.append(obstacle_bound(o.shape, o.size, o.vertices))
    keys = [0, *np.cumsum([len(o.position.times) for o in obstacles], dtype=int)]
    data = ObstacleData()
    data.shape = device_array([SHAPES[o.shape][0] for o in obstacles], wp.int32, device)
    data.size = device_array([o.size for o in obstacles], wp.vec3, device)
    data.mesh = device_array(ids, wp.uint64, device)
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
