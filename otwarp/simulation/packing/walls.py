"""Hydrodynamic walls of a scene as the arrays that kernels read, and what such walls do not go with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.hydrodynamics.covering import outermost_spheres
from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.kernels.core.types import WallData
from otwarp.kernels.forces.force import Load
from otwarp.scene import Body, Flow, Obstacle, Scene
from otwarp.scene.flow_profile import PROFILES, field_of, flow_velocity
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.bodies import drag_spheres
from otwarp.simulation.packing.flow import flows
from otwarp.simulation.packing.traps import rotate
from otwarp.units import BOLTZMANN

STILL = 1e-3
"""Flow at a wall that counts as none, relative to the fastest within a radius of the flow's own scale; and the angle
[rad] between a wall's normal and the direction along which the flow varies that counts as none."""


def hydrodynamic_walls(scene: Scene) -> tuple[Obstacle, ...]:
    """The planes that hinder motion; that they are planes at rest `Scene.check` has seen.

    Raises:
        InputError: One that a body starts behind.
    """
    walls = tuple(o for o in scene.obstacles if o.hydrodynamic)
    for wall in walls:
        normal, offset = plane_of(wall)
        for body in scene.bodies:
            turned = rotate(np.array(body.orientation), np.array([s.offset for s in drag_spheres(body)]).reshape(-1, 3))
            height = (turned + np.array(body.position)) @ normal - offset
            if height.min() <= 0.0:
                allowed = f"false, or {body.name} in front of it: it starts at a height of {height.min():.4g} µm"
                raise _bad(scene, wall, "true", allowed)
    return walls


def plane_of(wall: Obstacle) -> tuple[np.ndarray, float]:
    """Unit normal out of a plane at rest, and normal·x on it [µm]."""
    normal = rotate(wall.orientation.values[0], np.array([0.0, 0.0, 1.0]))
    normal = normal / np.linalg.norm(normal)
    return normal, float(normal @ wall.position.values[0])


def _bad(scene: Scene, wall: Obstacle, value: str, allowed: str) -> InputError:
    return InputError(f"{scene.file or scene.root}: {wall.prim}: ot:obstacle:hydrodynamic = {value}: must be {allowed}")


def check_flow(scene: Scene, values: Mapping[str, np.ndarray]) -> None:
    """Refuse a flow that does not stand still at every hydrodynamic wall.

    Raises:
        InputError: The message names the wall, and where the flow stands still.
    """
    flow = scene.flow
    if flow is None or not flows(scene, values):
        return
    still = PROFILES[flow.kind].still
    if still is None:
        _check_field(scene, flow)
        return
    planes = still(flow)
    for wall in hydrodynamic_walls(scene):
        if not any(_is_on(scene, flow, *plane_of(wall), *plane) for plane in planes):
            at = [f"{f'±{half:g} µm' if half else '0'} of the prim's own {'xyz'[axis]}" for axis, half in planes]
            where = f"at {' and '.join(at)}" if at else "nowhere"
            raise _bad(scene, wall, "true", f"false where {flow.prim} flows; its {flow.kind} flow stands still {where}")


def _is_on(scene: Scene, flow: Flow, normal: np.ndarray, offset: float, axis: int, half: float) -> bool:
    """Whether a plane is one of those at ±`half` [µm] along an axis of the flow."""
    along = rotate(np.array(flow.orientation), np.eye(3)[axis])
    place = offset * float(normal @ along) - float(along @ np.array(flow.origin))
    size = half or max(s.radius for b in scene.bodies for s in b.spheres)
    parallel = bool(np.linalg.norm(np.cross(normal, along)) < STILL)
    return parallel and abs(abs(place) - half) < STILL * size


def _check_field(scene: Scene, flow: Flow) -> None:
    """Refuse a velocity field that moves along a hydrodynamic wall, looked at below all nodes."""
    field = field_of(flow)
    axes = [low + h * np.arange(n) for low, h, n in zip(field.low, field.spacing, field.nodes, strict=True)]
    local = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    nodes = rotate(np.array(flow.orientation), local) + np.array(flow.origin)
    for wall in hydrodynamic_walls(scene):
        normal, offset = plane_of(wall)
        below = nodes - (nodes @ normal - offset)[:, None] * normal
        speed = float(np.linalg.norm(flow_velocity(flow, below), axis=1).max())
        if speed > STILL * field.fastest:
            raise _bad(scene, wall, "true", f"false where {flow.prim} flows; its field has {speed:g} µm/s there")


def walled_spheres(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Spheres of a body that walls act on, and whether contact is what stops each.

    Those that feel the liquid and are not inside another; a rod stands as a row of spheres of its radius that touch.

    Returns:
        (n, 4) offsets from the prim's origin and radii [µm], (n,) whether it collides.
    """
    rows = [(*s.offset, s.radius, s.collides) for s in drag_spheres(body)]
    for rod in body.rods:
        if rod.drag:
            a, b = np.array(rod.start), np.array(rod.end)
            beads = max(1, round(float(np.linalg.norm(b - a)) / (2.0 * rod.radius))) + 1
            rows += [(*(a + t * (b - a)), rod.radius, rod.collides) for t in np.linspace(0.0, 1.0, beads)]
    table = np.array(rows, dtype=float).reshape(-1, 5)
    kept = outermost_spheres(table[:, :3], table[:, 3])
    return table[kept, :4], table[kept, 4] != 0.0


def wall_time(scene: Scene, values: Mapping[str, np.ndarray], loads: list[Load]) -> float | None:
    """Shortest time in which a sphere away from walls diffuses, or falls, by its own radius [s].

    6πηa³/k_B T and 6πηa²/|F|, F the weight and other steady forces: over that distance, and that time, mobilities near
    a wall change. None without walls, and where nothing moves.
    """
    if not hydrodynamic_walls(scene):
        return None
    hot = float(values["medium_temperature"].max()) if scene.settings.brownian else 0.0
    viscosity = float(values["medium_viscosity"].min())
    rates = []
    for body, load in zip(scene.bodies, loads, strict=True):
        radius = float(walled_spheres(body)[0][:, 3].min())
        rates.append(max(BOLTZMANN * hot / radius, load.force) / (6.0 * np.pi * viscosity * radius**2))
    return 1.0 / max(rates) if max(rates) > 0.0 else None


def pack_walls(
    scene: Scene, moves: list[BodyMobility], walls: tuple[Obstacle, ...], device: Place
) -> Annotated[Any, WallData]:
    """Planes and spheres; all empty without hydrodynamic walls."""
    planes = [plane_of(wall) for wall in walls]
    bodies = list(zip(scene.bodies, moves, strict=True)) if walls else []
    start, spheres, turned_back = [0], [np.zeros((0, 4))], []
    for body, move in bodies:
        rows, collides = walled_spheres(body)
        spheres.append(rows - np.append(move.reference, 0.0))
        turned_back += list(~collides)
        start.append(start[-1] + len(rows))
    data = device.typed(WallData)()
    data.normal = device_array([n for n, _ in planes], wp.vec3, device)
    data.offset = device_array([o for _, o in planes], wp.float32, device)
    data.start = device_array(start, wp.int32, device)
    data.sphere = device_array(np.concatenate(spheres), wp.vec4, device)
    data.turned_back = device_array(turned_back, wp.int32, device)
    return data
