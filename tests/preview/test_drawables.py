"""USD stages as draw lists."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade

from otwarp.errors import InputError
from otwarp.scene.drawing.draw_list import CAPSULE, MESH, PLANE, SPHERE, TUBE
from otwarp.scene.drawing.drawables import read_drawables
from tests.preview import stages


def positions(drawables):
    return drawables.transform[:, :3, 3]


def test_lengths_are_micrometres_whatever_the_stage_unit():
    for metres_per_unit in (1e-6, 1e-3, 0.01, 1.0):
        unit = 1e-6 / metres_per_unit
        stage = stages.new_stage(metres_per_unit=metres_per_unit)
        stages.sphere(stage, "/World/S", 2.0 * unit, (3 * unit, 4 * unit, 5 * unit))
        (centre,), matrix = positions(read_drawables(stage)), read_drawables(stage).transform[0]
        assert centre == pytest.approx([3.0, 4.0, 5.0])
        assert np.diag(matrix)[:3] == pytest.approx([2.0, 2.0, 2.0])


def test_each_gprim_becomes_its_solid():
    stage = stages.new_stage()
    for kind in ("Sphere", "Cube", "Cylinder", "Cone", "Capsule", "Plane", "Cylinder_1", "Capsule_1"):
        getattr(UsdGeom, kind).Define(stage, f"/World/{kind}")
    UsdGeom.Capsule_1.Get(stage, "/World/Capsule_1").CreateRadiusTopAttr(0.2)
    kinds = read_drawables(stage).kind.tolist()
    # A capsule with two radii is two balls and a frustum; a two-sided plane has two sides.
    expected = {SPHERE: 1 + 2, 1: 1, TUBE: 2 + 1 + 1, CAPSULE: 1, PLANE: 2}
    assert {kind: kinds.count(kind) for kind in set(kinds)} == expected


@pytest.mark.parametrize(("axis", "tip"), [("X", (2, 0, 0)), ("Y", (0, 2, 0)), ("Z", (0, 0, 2))])
def test_the_tip_of_a_cone_points_along_its_axis(axis, tip):
    stage = stages.new_stage()
    cone = UsdGeom.Cone.Define(stage, "/World/Cone")
    cone.CreateAxisAttr(axis)
    cone.CreateHeightAttr(4.0)
    drawables = read_drawables(stage)
    assert drawables.size[0, 0] == 0.0
    assert (drawables.transform[0] @ [0, 0, 1, 1])[:3] == pytest.approx(tip)
    assert np.linalg.det(drawables.transform[0]) > 0.0


def test_visibility_and_purpose_are_respected():
    stage = stages.new_stage()
    hidden = UsdGeom.Xform.Define(stage, "/World/Hidden")
    UsdGeom.Imageable(hidden).MakeInvisible()
    stages.sphere(stage, "/World/Hidden/S", 1.0)
    for purpose in ("default", "render", "guide", "proxy"):
        stages.sphere(stage, f"/World/{purpose}", 1.0).CreatePurposeAttr(purpose)
    assert len(read_drawables(stage)) == 2
    assert len(read_drawables(stage, purposes=("default", "render", "guide"))) == 3


def test_instances_of_a_reference_are_drawn():
    stage = stages.new_stage()
    stages.sphere(stage, "/Bead/S", 1.0, (0, 0, 1))
    for k in range(3):
        prim = UsdGeom.Xform.Define(stage, f"/World/B{k}").GetPrim()
        prim.GetReferences().AddInternalReference("/Bead")
        prim.SetInstanceable(True)
        UsdGeom.Xformable(prim).AddTranslateOp().Set((10.0 * k, 0, 0))
    UsdGeom.Imageable.Get(stage, "/Bead").GetPrim().SetActive(True)
    x = sorted(positions(read_drawables(stage))[:, 0])
    assert x == pytest.approx([0.0, 0.0, 10.0, 20.0])  # the prototype itself, and its three instances


def test_point_instancer_poses_masks_and_colours():
    stage = stages.cells(6)
    instancer = UsdGeom.PointInstancer.Get(stage, "/World/Cells")
    UsdGeom.Xformable(instancer).AddTranslateOp().Set((0, 0, 100))
    instancer.CreateScalesAttr([(1, 1, 1)] * 5 + [(2, 2, 2)])
    instancer.CreateInvisibleIdsAttr([1])
    drawables = read_drawables(stage)
    assert len(drawables) == 5
    assert positions(drawables)[:, 2] == pytest.approx([102.0] * 5)
    assert drawables.transform[-1, 0, 0] == pytest.approx(4.0)
    given = np.array(UsdGeom.PrimvarsAPI(instancer).GetPrimvar("displayColor").Get())
    assert drawables.colour == pytest.approx(np.delete(given, 1, axis=0))


def test_prototype_offsets_and_several_prototypes():
    stage = stages.cells(4, spacing=10.0)
    instancer = UsdGeom.PointInstancer.Get(stage, "/World/Cells")
    pair = UsdGeom.Xform.Define(stage, "/World/Cells/Prototypes/Pair")
    pair.AddTranslateOp().Set((0, 0, 7))
    stages.sphere(stage, "/World/Cells/Prototypes/Pair/A", 1.0, (1, 0, 0))
    stages.sphere(stage, "/World/Cells/Prototypes/Pair/B", 1.0, (-1, 0, 0))
    instancer.GetPrototypesRel().AddTarget("/World/Cells/Prototypes/Pair")
    instancer.GetProtoIndicesAttr().Set([0, 1, 0, 1])
    drawables = read_drawables(stage)
    assert len(drawables) == 2 + 4
    pairs = positions(drawables)[np.isclose(positions(drawables)[:, 2], 9.0)]
    assert sorted(map(tuple, pairs[:, :2].round(6))) == [(9, 0), (9, 10), (11, 0), (11, 10)]


def test_reading_instances_is_vectorised():
    """A hundred times the instances take the same calls of functions: none is made for each of them."""

    def calls(count):
        stage, made = stages.cells(count), 0

        def counted(frame, event, function):
            nonlocal made
            made += event in ("call", "c_call")

        read_drawables(stage)  # what is imported or cached on the way
        sys.setprofile(counted)
        try:
            drawables = read_drawables(stage)
        finally:
            sys.setprofile(None)
        assert len(drawables) == count
        return made

    assert calls(10_000) == pytest.approx(calls(100), rel=0.1)


def test_a_bound_material_beats_the_display_colour():
    stage = stages.new_stage()
    ball = stages.sphere(stage, "/World/S", 1.0, colour=(1, 0, 0))
    material = UsdShade.Material.Define(stage, "/World/Looks/M")
    shader = UsdShade.Shader.Define(stage, "/World/Looks/M/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.1, 0.2, 0.3))
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.4)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.15)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(ball.GetPrim()).Bind(material)
    drawables = read_drawables(stage)
    assert drawables.colour[0] == pytest.approx([0.1, 0.2, 0.3])
    assert (drawables.opacity[0], drawables.roughness[0]) == pytest.approx((0.4, 0.15))


def test_what_hangs_below_a_trap_is_light():
    stage = stages.new_stage()
    stages.trap(stage, "/World/Trap")
    stages.sphere(stage, "/World/Bead", 1.0)
    drawables = read_drawables(stage)
    assert drawables.beam.tolist() == [True, True, False]


def test_faces_become_triangles_with_crease_aware_normals():
    stage = stages.new_stage()
    mesh = UsdGeom.Mesh.Define(stage, "/World/Box")
    corners = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.CreatePointsAttr(corners)
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([k for face in faces for k in face])
    drawables = read_drawables(stage)
    triangles = drawables.meshes[0]
    assert drawables.kind.tolist() == [MESH] and len(triangles.triangles) == 12
    a, b, c = (triangles.points[triangles.triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", np.cross(b, c), a) / 6.0 == pytest.approx(8.0)  # volume: all wound outwards
    assert np.abs(triangles.normals).max(axis=2) == pytest.approx(np.ones((12, 3)))  # the box keeps flat faces


def test_a_collision_plane_without_a_size_is_endless_and_a_sized_one_is_not():
    stage = stages.new_stage()
    for name in ("Endless", "Sized"):
        UsdPhysics.CollisionAPI.Apply(UsdGeom.Plane.Define(stage, f"/World/{name}").GetPrim())
    UsdGeom.Plane.Get(stage, "/World/Sized").CreateWidthAttr(6.0)
    assert read_drawables(stage).size.tolist() == [[np.inf, np.inf], [3.0, 1.0]]


def test_time_samples_move_shapes():
    stage = stages.new_stage()
    ball = stages.sphere(stage, "/World/S", 1.0)
    op = ball.AddTranslateOp()
    op.Set(Gf.Vec3d(0, 0, 0), 0)
    op.Set(Gf.Vec3d(10, 0, 0), 10)
    stage.SetTimeCodesPerSecond(5)
    drawables = read_drawables(stage, 4)
    assert positions(drawables)[0, 0] == pytest.approx(4.0)
    assert drawables.time == pytest.approx(0.8)


def test_the_first_camera_a_named_one_and_an_unknown_one():
    stage = stages.new_stage()
    stages.camera(stage, "/World/Wide", eye=(0, 0, 50))
    stages.camera(stage, "/World/Side", eye=(0, -20, 0), width=40.0, height=20.0, focal=20.0)
    assert read_drawables(stage).view.prim == "/World/Wide"
    side = read_drawables(stage, camera="Side").view
    assert side.prim == read_drawables(stage, camera="/World/Side").view.prim == "/World/Side"
    assert (side.width, side.height) == pytest.approx((2.0, 1.0))
    assert side.forward == pytest.approx([0, 1, 0], abs=1e-12)
    assert side.focus == pytest.approx(20.0)
    with pytest.raises(InputError) as caught:
        read_drawables(stage, camera="Top")
    assert "camera 'Top'" in str(caught.value) and "/World/Wide, /World/Side" in str(caught.value)


def test_the_automatic_camera_sees_everything():
    stage = stages.delivery()
    stage.RemovePrim("/World/Camera")
    drawables = read_drawables(stage)
    view = drawables.view
    lower, upper = drawables.bounds()
    keep = np.isfinite(lower).all(axis=1) & ~drawables.beam
    for corner in np.concatenate([lower[keep], upper[keep]]) - view.position:
        depth = corner @ view.forward
        assert depth > 0.0
        assert abs(corner @ view.right) < 0.5 * view.width * depth
        assert abs(corner @ view.up) < 0.5 * view.height * depth


def test_lights_of_the_stage():
    stage = stages.new_stage()
    stages.distant_light(stage, (0, 0, -1), intensity=3.0)
    dome = UsdLux.DomeLight.Define(stage, "/World/Dome")
    dome.CreateIntensityAttr(0.5)
    dome.CreateColorAttr((1.0, 0.5, 0.25))
    lamp = UsdLux.SphereLight.Define(stage, "/World/Lamp")
    lamp.AddTranslateOp().Set((0, 0, 20))
    lights = read_drawables(stage).lights
    assert lights.vector == pytest.approx(np.array([[0, 0, 1], [0, 0, 20]]), abs=1e-9)
    assert lights.distant.tolist() == [True, False]
    assert lights.irradiance[0] == pytest.approx([3.0, 3.0, 3.0])
    assert lights.ambient / lights.ambient[0] == pytest.approx([1.0, 0.5, 0.25])


def test_an_exposure_that_no_number_holds():
    """2¹⁰²⁴ overflows; found by the long fuzz."""
    stage = stages.new_stage()
    lamp = UsdLux.SphereLight.Define(stage, "/World/Lamp")
    for stops, refused in ((100.0, False), (-1024.0, True), (1024.0, True)):
        lamp.CreateExposureAttr(stops)
        if not refused:
            assert np.all(np.isfinite(read_drawables(stage).lights.irradiance))
            continue
        with pytest.raises(InputError, match=rf"/World/Lamp: inputs:exposure = {stops}: must be in \[-100, 100\]"):
            read_drawables(stage)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"none\.usda: there is no such file"):
        read_drawables(tmp_path / "none.usda")
    (tmp_path / "text.usda").write_text("not a stage")
    with pytest.raises(InputError, match=r"text\.usda: contents = .*must be a USD file") as caught:
        read_drawables(tmp_path / "text.usda")
    assert "\n" not in str(caught.value)


def test_an_empty_stage_has_a_view():
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1e-6)
    assert len(read_drawables(stage)) == 0
    assert read_drawables(stage).view.focus > 0.0
