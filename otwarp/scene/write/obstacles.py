"""Authors an obstacle as a USD collider."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, Vt

from otwarp.errors import InputError
from otwarp.scene import vocabulary
from otwarp.scene.description import Obstacle
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.write.attributes import author_values
from otwarp.scene.write.poses import author_tracks

PLANE_WIDTH = 200.0
"""Side of the square drawn for a plane [µm]; as an obstacle it is unbounded."""


def define_obstacle(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle, rate: float) -> Usd.Prim:
    """Author one obstacle with its collision schema, and as a kinematic body when it moves.

    Raises:
        InputError: Unknown shape.
    """
    shapes = _shapes(obstacle)
    if obstacle.shape not in shapes:
        raise InputError(f"SceneBuilder: {path}: shape = {obstacle.shape}: must be one of {', '.join(shapes)}")
    kind, attributes = shapes[obstacle.shape]
    shape = kind.Define(stage, path)
    for name, value in attributes.items():
        getattr(shape, f"Create{name}Attr")(value)
    prim = shape.GetPrim()
    # A unit cube scaled to its half extents keeps three different sizes exact.
    scale = obstacle.size if obstacle.shape == "box" else None
    author_tracks(prim, rate, obstacle.position, obstacle.orientation, scale)
    UsdPhysics.CollisionAPI.Apply(prim).CreateCollisionEnabledAttr(True)
    if obstacle.hydrodynamic:
        author_values(prim, vocabulary.OBSTACLE, obstacle)
    if obstacle.position.animated or obstacle.orientation.animated:
        UsdPhysics.RigidBodyAPI.Apply(prim).CreateKinematicEnabledAttr(True)
    return prim


def _shapes(obstacle: Obstacle) -> dict[str, tuple[type, dict[str, Any]]]:
    """Shape → its USD class and what is authored of it."""
    up = {"Axis": UsdGeom.Tokens.z}
    radius, height = {"Radius": float(obstacle.size[0])}, {"Height": 2.0 * float(obstacle.size[1])}
    faces = np.ascontiguousarray(obstacle.triangles, dtype=np.int32)
    mesh = {
        "Points": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(obstacle.vertices, dtype=np.float32)),
        "FaceVertexCounts": Vt.IntArray(len(faces), 3),
        "FaceVertexIndices": Vt.IntArray.FromNumpy(faces.ravel()),
        "SubdivisionScheme": UsdGeom.Tokens.none,
        "DoubleSided": obstacle.double_sided,
    }
    return {
        "plane": (UsdGeom.Plane, up | {"Width": PLANE_WIDTH, "Length": PLANE_WIDTH, "DoubleSided": True}),
        "box": (UsdGeom.Cube, {"Size": 2.0}),
        "sphere": (UsdGeom.Sphere, radius),
        **{name: (getattr(UsdGeom, s.usd), up | radius | height) for name, s in SHAPES.items() if s.round},
        "mesh": (UsdGeom.Mesh, mesh),
    }
