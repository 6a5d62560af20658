"""How fast things move and turn for reasons other than traps and noise: flow, obstacles, weight, adhesion."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.forces.force import Load
from otwarp.scene import Obstacle, Scene, Sphere
from otwarp.scene.flow_profile import PROFILES, in_frame
from otwarp.simulation.packing.bodies import is_rigid, obstacle_bound
from otwarp.simulation.packing.flow import strengths
from otwarp.simulation.time_step.relaxation import point_mobility


def authored_powers(scene: Scene, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """(T,) largest power of each trap in any world and at any time [mW]."""
    peaks = np.array([t.power.values.max() for t in scene.traps])
    return np.maximum(values["trap_power"].max(axis=0), peaks) if len(peaks) else peaks


def places(scene: Scene, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """(n, 3) where bodies start and where traps go [µm]: where things are to be expected."""
    rows = [np.array([b.position for b in scene.bodies]).reshape(-1, 3), values["trap_position"].reshape(-1, 3)]
    return np.concatenate([*rows, *[t.position.values for t in scene.traps]])


def body_bound(scene: Scene) -> float:
    """Radius about its prim's origin that holds any body [µm]."""
    spheres = [float(np.linalg.norm(s.offset)) + s.radius for b in scene.bodies for s in b.spheres]
    rods = [float(np.linalg.norm(p)) + r.radius for b in scene.bodies for r in b.rods for p in (r.start, r.end)]
    return max(spheres + rods, default=0.0)


def flow_speed(scene: Scene, values: Mapping[str, np.ndarray]) -> float:
    """Fastest flow where bodies and traps are [µm/s]."""
    flow = scene.flow
    if flow is None:
        return 0.0
    extent = np.abs(in_frame(flow, places(scene, values))).max(axis=0, initial=0.0) + body_bound(scene)
    return PROFILES[flow.kind].fastest(flow, float(strengths(flow, values).max()), extent)


def trap_speed(scene: Scene, values: Mapping[str, np.ndarray]) -> float:
    """Fastest motion of a focus [µm/s]: its limit, for a command may ask for more at any time; without one that along
    its time samples."""
    limits = values["trap_speed_limit"].max(axis=0)
    speeds = [0.0]
    for trap, limit in zip(scene.traps, limits, strict=True):
        times, points = trap.position.times, trap.position.values
        if np.isfinite(limit):
            speeds.append(float(limit))
        elif len(times) > 1:
            speeds.append(float((np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(times)).max()))
    return max(speeds)


def sampled_speed(scene: Scene, values: Mapping[str, np.ndarray]) -> float:
    """Fastest motion of a focus along its time samples, within its speed limit [µm/s]."""
    limits = values["trap_speed_limit"].max(axis=0)
    speeds = [0.0]
    for trap, limit in zip(scene.traps, limits, strict=True):
        times, points = trap.position.times, trap.position.values
        if len(times) > 1:
            ways = np.linalg.norm(np.diff(points, axis=0), axis=1)
            speeds.append(min(float((ways / np.diff(times)).max()), float(limit)))
    return max(speeds)


def obstacle_speed(obstacle: Obstacle, reached: np.ndarray) -> float:
    """Fastest motion of a point of an obstacle's surface [µm/s]: that of its origin, and its turning times its size.

    Args:
        reached: (n, 3) where bodies are [µm]: a turning plane has no end, and counts as far as these.
    """
    times, points, turns = obstacle.position.times, obstacle.position.values, obstacle.orientation.values
    if len(times) < 2:
        return 0.0
    arm = obstacle_bound(obstacle.shape, obstacle.size, obstacle.vertices)
    if obstacle.shape == "plane":
        arm = max(float(np.linalg.norm(reached - p, axis=1).max()) for p in points)
    steps = np.diff(times)
    # the angle from the chord, which keeps its digits for small turns
    near = np.minimum(
        np.linalg.norm(turns[1:] - turns[:-1], axis=1), np.linalg.norm(turns[1:] + turns[:-1], axis=1)
    )  # fmt: skip
    angle = 4.0 * np.arcsin(np.clip(0.5 * near, 0.0, 1.0))
    return float(((np.linalg.norm(np.diff(points, axis=0), axis=1) + arm * angle) / steps).max())


def prescribed_speed(scene: Scene, values: Mapping[str, np.ndarray]) -> float:
    """Fastest prescribed motion: flow, traps and obstacles [µm/s]."""
    reached = places(scene, values)
    moving = [obstacle_speed(o, reached) for o in scene.obstacles]
    return max(flow_speed(scene, values), trap_speed(scene, values), *moving, 0.0)


def settling_speed(moves: list[BodyMobility], loads: list[Load], viscosity: float) -> float:
    """Fastest drift under weight and other steady forces [µm/s], |F|·μ."""
    if not any(load.force for load in loads):
        return 0.0
    pairs = zip(loads, moves, strict=True)
    return max(load.force * float(np.linalg.eigvalsh(m.mobility[:3, :3])[-1]) for load, m in pairs) / viscosity


def adhesion_speed(scene: Scene, moves: list[BodyMobility], viscosity: float) -> float:
    """Fastest approach under the pull-off force 2πRW [µm/s].

    For two spheres R·(μ₁ + μ₂) = 1/(6πη) whatever their radii, so that of one sphere on a plane serves for all pairs.
    """
    work = max((b.material.adhesion for b in scene.bodies if b.colliding), default=0.0)
    if work <= 0.0:
        return 0.0
    points = {
        (id(m), point, element.radius): m
        for b, m in zip(scene.bodies, moves, strict=True)
        for element in b.colliding
        for point in ([element.offset] if isinstance(element, Sphere) else [element.start, element.end])
    }
    pulls = [radius * point_mobility(m, np.array(point)) for (_, point, radius), m in points.items()]
    return 2.0 * math.pi * work * max(pulls) / viscosity


def turning_rate(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], loads: list[Load], viscosity: float
) -> float:
    """Fastest turning of a rigid body in the flow and under the torque of its weight and other forces [rad/s].

    The velocity gradient of the flow and |T|·μ_r.
    """
    rigid = [(t, m) for b, t, m in zip(scene.bodies, loads, moves, strict=True) if is_rigid(b)]
    if not rigid:
        return 0.0
    flow, gradient, hanging = scene.flow, 0.0, 0.0
    if flow is not None:
        gradient = PROFILES[flow.kind].gradient(flow, float(strengths(flow, values).max()))
    for load, move in rigid:
        if load.torque:
            turn = float(np.linalg.eigvalsh(move.mobility[3:, 3:])[-1])
            hanging = max(hanging, load.torque * turn / viscosity)
    return gradient + hanging
