"""Meshes of obstacles with faces that have no area, holes, or their inside out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from otwarp.scene.description import Obstacle
from otwarp.scene.finding import Finding
from otwarp.scene.meshes import inside_mesh, is_closed
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import conjugate, rotate

_FLAT = 1e-12
"""Area of a face, relative to the square of the mesh's size, that counts as none."""


def odd_meshes(scene: Scene) -> Iterator[Finding]:
    """Warnings about obstacles of shape `mesh`."""
    for obstacle in scene.obstacles:
        if obstacle.shape == "mesh" and len(obstacle.triangles):
            yield from _degenerate(obstacle)
            if is_closed(obstacle.vertices, obstacle.triangles):
                yield from _inside_out(obstacle, scene)
            elif not obstacle.double_sided:
                message = "the mesh is not closed, hence a thin sheet, solid from both sides; doubleSided = 1 says so"
                yield Finding(prim=obstacle.prim, message=message)


def _degenerate(obstacle: Obstacle) -> Iterator[Finding]:
    corners = obstacle.vertices[obstacle.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.flatnonzero(area <= _FLAT * float(np.ptp(obstacle.vertices, axis=0).max()) ** 2)
    if len(flat):
        message = f"{len(flat)} of {len(area)} triangles of the mesh have no area, the first is number {flat[0]}"
        yield Finding(prim=obstacle.prim, message=message)


def _inside_out(obstacle: Obstacle, scene: Scene) -> Iterator[Finding]:
    """A closed mesh whose faces look inwards is a chamber: bodies belong into it."""
    corners = obstacle.vertices[obstacle.triangles]
    volume = float(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
    places = np.array([body.position for body in scene.bodies if body.colliding], dtype=float).reshape(-1, 3)
    if volume >= 0.0 or not len(places):
        return
    turn = obstacle.orientation.at(0.0)
    local = rotate(conjugate(turn / np.linalg.norm(turn)), places - obstacle.position.at(0.0))
    outside = ~inside_mesh(local, obstacle.vertices, obstacle.triangles[:, ::-1])
    if outside.any():
        message = (
            f"the faces of the mesh look inwards, which makes it a chamber, and {outside.sum()} of {len(outside)} "
            "bodies start outside; the other orientation (rightHanded, leftHanded) makes it a solid"
        )
        yield Finding(prim=obstacle.prim, message=message)
