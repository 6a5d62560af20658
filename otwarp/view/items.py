"""What of a scene can be taken in hand: each thing with its name, place and size; and which of them a ray meets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.scene import Obstacle, Scene
from otwarp.scene.transforms import rotate, rotation_matrix
from otwarp.teleop.page.compose import box
from otwarp.view.measure import ray_spheres, ray_triangles

TRAP_RADIUS = 0.6
"""Radius within which a click is on a trap's focus [µm]."""
MOST_LISTED = 400
"""Things that can be taken: a list of thousands is none. Bodies of instancers come last, and are cut off first."""

Vec3 = tuple[float, float, float]
Name = str | tuple[str, int]


@dataclass(frozen=True, slots=True)
class Item:
    """A thing.

    Attributes:
        kind: `trap`, `robot`, `cell`, `obstacle` or `goal`.
        name: Its path, or path and index of an instance.
        label: For people.
        place: [µm].
        radius: Of a ball about it [µm].
        with_it: What moves when it is moved: itself, and the traps that hold it.
    """

    kind: str
    name: Name
    label: str
    place: Vec3
    radius: float
    with_it: tuple[Name, ...]


def items(scene: Scene) -> list[Item]:
    """Things of a scene that can be moved or deleted, `MOST_LISTED` at most, traps first."""
    found = [
        Item("trap", t.prim, _label("trap", t.prim, scene), _vec(t.position.at(0.0)), TRAP_RADIUS, (t.prim,))
        for t in scene.traps
    ]
    holding: dict[str, list[Name]] = {}
    for trap in scene.traps:
        if trap.holds is not None:
            holding.setdefault(trap.holds, []).append(trap.prim)
    for body in scene.bodies:
        name: Name = body.prim if body.instance is None else (body.prim, body.instance)
        traps = [trap for sphere in body.spheres for trap in holding.get(sphere.prim, ())]
        reach = max(float(np.linalg.norm(s.offset)) + s.radius for s in body.spheres)
        label = _label(body.kind, body.prim, scene) + ("" if body.instance is None else f" {body.instance}")
        found.append(Item(body.kind, name, label, body.position, reach, (name, *traps)))
    for obstacle in scene.obstacles:
        place = _vec(obstacle.position.at(0.0))
        label = _label("obstacle", obstacle.prim, scene)
        found.append(Item("obstacle", obstacle.prim, label, place, _reach(obstacle), (obstacle.prim,)))
    if scene.goal is not None:
        goal = scene.goal
        label = _label("goal", goal.prim, scene)
        found.append(Item("goal", goal.prim, label, goal.position, goal.tolerance, (goal.prim,)))
    return sorted(found, key=lambda item: isinstance(item.name, tuple))[:MOST_LISTED]


def picked(scene: Scene, things: Sequence[Item], origin: np.ndarray, direction: np.ndarray) -> Item | None:
    """The nearest thing that a ray meets, None for none; a trap before the body that it holds.

    Args:
        scene: Whose things they are.
        things: Its things.
        origin, direction: Of the ray [µm].
    """
    way = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    start = np.asarray(origin, dtype=float)
    spheres = {body.prim if body.instance is None else (body.prim, body.instance): body for body in scene.bodies}
    obstacles = {obstacle.prim: obstacle for obstacle in scene.obstacles}
    best, nearest = None, np.inf
    for item in things:
        if item.name in spheres:
            body = spheres[item.name]
            offsets = np.array([s.offset for s in body.spheres])
            centres = rotate(np.array(body.orientation), offsets) + body.position
            t = ray_spheres(centres, np.array([s.radius for s in body.spheres]), start, way)
        elif item.name in obstacles:
            t = _ray_obstacle(obstacles[str(item.name)], start, way)
        else:
            t = ray_spheres(np.array([item.place]), np.array([item.radius]), start, way)
        if item.kind == "trap":
            t -= 4.0  # a focus lies within the sphere that it holds
        if t < nearest:
            best, nearest = item, t
    return best


def _ray_obstacle(obstacle: Obstacle, origin: np.ndarray, way: np.ndarray) -> float:
    """Way to an obstacle; planes cannot be clicked on, nor be missed."""
    place, turn = obstacle.position.at(0.0), rotation_matrix(np.array(obstacle.orientation.at(0.0)))
    start, along = (origin - place) @ turn, way @ turn
    if obstacle.shape == "box":
        points, faces = box()
        return ray_triangles(points * np.array(obstacle.size), faces, start, along)
    if obstacle.shape == "mesh":
        return ray_triangles(obstacle.vertices, np.asarray(obstacle.triangles).reshape(-1, 3), start, along)
    if obstacle.shape == "plane":
        return np.inf
    if obstacle.shape == "sphere":
        return ray_spheres(np.zeros((1, 3)), np.array([obstacle.size[0]]), start, along)
    radius, half, _ = obstacle.size
    rows = np.linspace(-half, half, max(int(2.0 * half / max(radius, 1e-9)) + 2, 2))
    centres = np.stack([np.zeros_like(rows), np.zeros_like(rows), rows], axis=1)
    return ray_spheres(centres, np.full(len(rows), radius), start, along)


def _reach(obstacle: Obstacle) -> float:
    if obstacle.shape == "mesh":
        return float(np.linalg.norm(obstacle.vertices, axis=1).max(initial=1.0))
    return max(float(np.linalg.norm(obstacle.size)), 1.0)


def _label(kind: str, prim: str, scene: Scene) -> str:
    """Its path below the root, and its kind where that does not say it."""
    path = prim.removeprefix(f"{scene.root}/")
    return path if kind in path.lower() else f"{path} ({kind})"


def _vec(values: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return x, y, z
