"""Authors an obstacle as a USD collider: plane, cube, sphere, cylinder, capsule or mesh."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, Vt

from otwarp.errors import InputError
from otwarp.scene import vocabulary
from otwarp.scene.description import Obstacle
from otwarp.scene.write.attributes import author_values
from otwarp.scene.write.poses import author_tracks

PLANE_WIDTH = 200.0
"""Side of the square drawn for a plane [µm]; as an obstacle it is unbounded."""


def define_obstacle(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle, rate: float) -> Usd.Prim:
    """Author one obstacle with its collision schema, and as a kinematic body when it moves.

    Raises:
        InputError: Unknown shape.
    """
    makers = {
        "plane": _plane,
        "box": _box,
        "sphere": _sphere,
        "cylinder": _cylinder,
        "capsule": _capsule,
        "mesh": _mesh,
    }
    if obstacle.shape not in makers:
        raise InputError(f"SceneBuilder: {path}: shape = {obstacle.shape}: must be one of {', '.join(makers)}")
    prim = makers[obstacle.shape](stage, path, obstacle).GetPrim()
    # A unit cube scaled to its half extents keeps three different sizes exact.
    scale = obstacle.size if obstacle.shape == "box" else None
    author_tracks(prim, rate, obstacle.position, obstacle.orientation, scale)
    UsdPhysics.CollisionAPI.Apply(prim).CreateCollisionEnabledAttr(True)
    if obstacle.hydrodynamic:
        author_values(prim, vocabulary.OBSTACLE, obstacle)
    if obstacle.position.animated or obstacle.orientation.animated:
        UsdPhysics.RigidBodyAPI.Apply(prim).CreateKinematicEnabledAttr(True)
    return prim


def _plane(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Plane:
    plane = UsdGeom.Plane.Define(stage, path)
    plane.CreateAxisAttr(UsdGeom.Tokens.z)
    plane.CreateWidthAttr(PLANE_WIDTH)
    plane.CreateLengthAttr(PLANE_WIDTH)
    plane.CreateDoubleSidedAttr(True)
    return plane


def _box(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Cube:
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(2.0)
    return cube


def _sphere(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Sphere:
    sphere = UsdGeom.Sphere.Define(stage, path)
    sphere.CreateRadiusAttr(float(obstacle.size[0]))
    return sphere


def _round(kind: type, stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Cylinder | UsdGeom.Capsule:
    shape = kind.Define(stage, path)
    shape.CreateAxisAttr(UsdGeom.Tokens.z)
    shape.CreateRadiusAttr(float(obstacle.size[0]))
    shape.CreateHeightAttr(2.0 * float(obstacle.size[1]))
    return shape


def _cylinder(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Cylinder:
    return _round(UsdGeom.Cylinder, stage, path, obstacle)


def _capsule(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Capsule:
    return _round(UsdGeom.Capsule, stage, path, obstacle)


def _mesh(stage: Usd.Stage, path: Sdf.Path, obstacle: Obstacle) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = np.ascontiguousarray(obstacle.vertices, dtype=np.float32)
    triangles = np.ascontiguousarray(obstacle.triangles, dtype=np.int32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(triangles), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    return mesh
