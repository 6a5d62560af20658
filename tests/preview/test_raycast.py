"""Pictures against analytic predictions."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from pxr import UsdGeom

from otwarp.errors import InputError
from otwarp.preview.render import bloom, render, render_linear, to_display, vignette
from otwarp.preview.studio import STYLES, PictureStyle
from otwarp.scene.drawing.draw_list import PLANE
from otwarp.scene.drawing.drawables import read_drawables
from tests.preview import stages
from tests.preview.first_hits import first_hits

PIXELS = 0.01
"""Relative error of a covered area: a disc of radius 60 px has its border within 1/4 px."""


def linear(stage, *, size=(160, 90), samples=2, **options):
    look = PictureStyle(width=size[0], height=size[1], samples=samples, grid=False, **options)
    return render_linear(read_drawables(stage), look, "cpu")


def background(size, **options):
    stage = stages.new_stage()
    stages.camera(stage, eye=(0, 0, 100))
    return linear(stage, size=size, **options)


def covered(image, **options):
    """Number of pixels that differ from the empty picture, borders counted by halves."""
    empty = background(image.shape[1::-1], **options)
    return np.count_nonzero(np.abs(image - empty).max(axis=2) > 1e-4)


@pytest.mark.quick
def test_perspective_sphere_covers_the_predicted_area():
    stage = stages.new_stage()
    stages.sphere(stage, "/World/Ball", 5.0)
    stages.camera(stage, eye=(0, 0, 40), width=36.0, height=36.0, focal=50.0)
    image = linear(stage, size=(400, 400), samples=1, style="white", occlusion_rays=0)
    # The outline of a sphere at distance D is a circle of tangent r/√(D² − r²).
    radius = 5.0 / np.sqrt(40.0**2 - 5.0**2) / (36.0 / 50.0) * 400
    assert covered(image, style="white", samples=1) == pytest.approx(np.pi * radius**2, rel=PIXELS)


@pytest.mark.parametrize("metres_per_unit", [1e-6, 1e-3, 1.0])
def test_orthographic_sphere_has_its_true_size_in_any_stage_unit(metres_per_unit):
    unit = 1e-6 / metres_per_unit
    stage = stages.new_stage(metres_per_unit=metres_per_unit)
    stages.sphere(stage, "/World/Ball", 5.0 * unit)
    camera = stages.camera(stage, eye=(0, 0, 40 * unit), width=300.0 * unit, height=300.0 * unit, ortho=True)
    camera.GetClippingRangeAttr().Set((0.1 * unit, 100 * unit))
    drawables = read_drawables(stage)
    assert drawables.view.pixel_size(300, 300) == pytest.approx(0.1)
    image = linear(stage, size=(300, 300), samples=1, style="white")
    assert covered(image, style="white", samples=1) == pytest.approx(np.pi * 50.0**2, rel=PIXELS)


AREAS = {
    "cube": lambda s: UsdGeom.Cube.Define(s, "/World/P").CreateSizeAttr(10.0),
    "cylinder": lambda s: (
        UsdGeom.Cylinder.Define(s, "/World/P").CreateRadiusAttr(2.0),
        UsdGeom.Cylinder.Get(s, "/World/P").CreateHeightAttr(12.0),
        UsdGeom.Cylinder.Get(s, "/World/P").CreateAxisAttr("X"),
    ),
    "capsule": lambda s: (
        UsdGeom.Capsule.Define(s, "/World/P").CreateRadiusAttr(2.0),
        UsdGeom.Capsule.Get(s, "/World/P").CreateHeightAttr(8.0),
        UsdGeom.Capsule.Get(s, "/World/P").CreateAxisAttr("Y"),
    ),
    "cone": lambda s: (
        UsdGeom.Cone.Define(s, "/World/P").CreateRadiusAttr(4.0),
        UsdGeom.Cone.Get(s, "/World/P").CreateHeightAttr(10.0),
        UsdGeom.Cone.Get(s, "/World/P").CreateAxisAttr("Y"),
    ),
    "plane": lambda s: (
        UsdGeom.Plane.Define(s, "/World/P").CreateWidthAttr(12.0),
        UsdGeom.Plane.Get(s, "/World/P").CreateLengthAttr(5.0),
    ),
    "mesh": lambda s: (
        UsdGeom.Mesh.Define(s, "/World/P").CreatePointsAttr([(-5, -3, 0), (5, -3, 0), (5, 3, 0), (-5, 3, 0)]),
        UsdGeom.Mesh.Get(s, "/World/P").CreateFaceVertexCountsAttr([4]),
        UsdGeom.Mesh.Get(s, "/World/P").CreateFaceVertexIndicesAttr([0, 1, 2, 3]),
    ),
}
TRUE_AREA = {
    "cube": 100.0,
    "cylinder": 48.0,
    "capsule": 32.0 + 4.0 * np.pi,
    "cone": 40.0,
    "plane": 60.0,
    "mesh": 60.0,
}


@pytest.mark.parametrize("shape", AREAS)
def test_projected_area_of_each_shape_under_non_uniform_scale(shape):
    stage = stages.new_stage()
    AREAS[shape](stage)
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/P")).AddScaleOp().Set((1.5, 0.75, 2.0))
    stages.camera(stage, eye=(0, 0, 60), width=200.0, height=200.0, ortho=True)
    image = linear(stage, size=(400, 400), samples=1, style="white")
    area = covered(image, style="white", samples=1) * 0.05**2
    assert area == pytest.approx(TRUE_AREA[shape] * 1.5 * 0.75, rel=0.02)


def test_the_nearer_opaque_sphere_hides_the_farther_one():
    stage = stages.new_stage()
    stages.sphere(stage, "/World/Near", 2.0, (0, 0, 10), (0.9, 0.0, 0.0))
    stages.sphere(stage, "/World/Far", 4.0, (0, 0, -10), (0.0, 0.0, 0.9))
    stages.camera(stage, eye=(0, 0, 60), width=160.0, height=90.0, ortho=True)
    image = linear(stage)
    middle, beside = image[45, 80], image[45, 110]
    assert middle[0] > 3.0 * middle[2]
    assert beside[2] > 3.0 * beside[0]


def tilted_top(angle):
    stage = stages.new_stage()
    cube = UsdGeom.Cube.Define(stage, "/World/Cube")
    cube.CreateSizeAttr(10.0)
    stages.paint(cube, (0.4, 0.2, 0.1))
    stages.distant_light(stage, (np.sin(np.radians(angle)), 0.0, -np.cos(np.radians(angle))))
    stages.camera(stage, eye=(0, 0, 60), width=40.0, height=22.5, ortho=True)
    drawables = read_drawables(stage)
    matt = dataclasses.replace(drawables, roughness=np.ones(len(drawables)))
    image = render_linear(matt, PictureStyle(width=32, height=18, samples=1, occlusion_rays=0), "cpu")
    return image[9, 16]


def test_diffuse_light_follows_lambert_and_the_display_colour():
    # Ambient light and the faint mirror image do not depend on the light's angle: differences are pure Lambert.
    zero, thirty, sixty = (tilted_top(angle) for angle in (0.0, 30.0, 60.0))
    # The matt highlight adds less than 3 % here.
    assert ((zero - sixty) / (zero - thirty))[0] == pytest.approx(0.5 / (1.0 - np.cos(np.radians(30.0))), rel=0.05)
    assert ((zero - sixty)[0] / (zero - sixty)[1]) == pytest.approx(2.0, rel=0.2)


def test_a_shadow_falls_where_the_light_is_blocked():
    bare = stages.new_stage()
    floor = UsdGeom.Plane.Define(bare, "/World/Floor")
    floor.CreateWidthAttr(60.0)
    floor.CreateLengthAttr(60.0)
    stages.distant_light(bare, (0, 0, -1))
    stages.camera(bare, eye=(0, -60, 30), width=200.0, height=112.5, ortho=True)
    free = linear(bare)
    stages.sphere(bare, "/World/Ball", 2.0, (0, 0, 3.0))
    with_ball = linear(bare)
    # Just beside the ball's outline towards the viewer lies its shadow.
    darker = (with_ball - free).max(axis=2) < -0.05
    assert 40 < np.count_nonzero(darker) < 4000


def test_translucency_lies_between_nothing_and_opaque():
    def middle(opacity):
        stage = stages.new_stage()
        stages.sphere(stage, "/World/Cell", 4.0, (0, 0, 10), (0.1, 0.8, 0.1), opacity)
        stages.sphere(stage, "/World/Behind", 1.5, (0, 0, 0), (0.9, 0.1, 0.1))
        stages.distant_light(stage, (0.5, 0, -1))
        stages.camera(stage, eye=(0, 0, 60), width=160.0, height=90.0, ortho=True)
        return linear(stage)[45, 80]

    red = [middle(opacity)[0] / middle(opacity)[1] for opacity in (0.1, 0.4, 0.7, 1.0)]
    assert all(a > b for a, b in pairwise(red))
    assert red[0] > 1.0 > red[-1]


def test_beams_glow_in_front_of_what_is_behind_and_not_through_what_is_before():
    def picture(z):
        stage = stages.new_stage()
        stages.trap(stage, "/World/Trap")
        if z is not None:
            block = UsdGeom.Cube.Define(stage, "/World/Block")
            block.CreateSizeAttr(20.0)
            stages.place(block, (0, z, 0))
            stages.paint(block, (0.2, 0.2, 0.2))
        stages.camera(stage, eye=(0, -80, 0), width=300.0, height=168.75, ortho=True)
        return linear(stage)

    lit, front, back = picture(None), picture(-20.0), picture(20.0)
    x, y = 80, 30
    assert lit[y, x, 0] > 2.0 * lit[y, x, 2]
    assert back[y, x, 0] > 1.5 * back[y, x, 2]
    assert front[y, x, 0] == pytest.approx(front[y, 90, 0], rel=0.02)


def test_hierarchy_gives_the_same_picture_as_brute_force():
    """Each solid alone is found by a hierarchy of one box; the nearest of all must be what the whole scene shows."""
    drawables = read_drawables(stages.delivery())
    solid = np.flatnonzero(~drawables.beam & (drawables.kind != PLANE))
    flat = dataclasses.replace(
        drawables,
        colour=np.linspace(0.05, 0.95, 3 * len(drawables)).reshape(-1, 3),
        opacity=np.ones(len(drawables)),
        beam=np.zeros(len(drawables), dtype=bool),
    )
    names = ("kind", "transform", "size", "colour", "opacity", "roughness", "beam", "mesh")

    def only(chosen):
        return dataclasses.replace(flat, **{name: getattr(flat, name)[chosen] for name in names})

    look = PictureStyle(width=96, height=54, grid=False)
    t_all, index_all = first_hits(only(solid), look)
    t_each = np.stack([first_hits(only(solid[k : k + 1]), look)[0] for k in range(len(solid))])
    hit = t_all < 1e29
    assert np.array_equal(hit, (t_each < 1e29).any(axis=0))
    assert np.allclose(t_all[hit], t_each.min(axis=0)[hit], rtol=1e-6)
    chosen = np.take_along_axis(t_each, np.maximum(index_all, 0)[None], axis=0)[0]
    assert np.allclose(chosen[hit], t_all[hit], rtol=1e-6)


@pytest.mark.quick
def test_same_input_same_picture_and_bytes():
    drawables = read_drawables(stages.delivery())
    first, second = (render(drawables, PictureStyle(width=96, height=54), "cpu") for _ in range(2))
    assert first.dtype == np.uint8 and first.shape == (54, 96, 3)
    assert np.array_equal(first, second)


def test_display_curve_is_monotonic_and_bounded():
    x = np.linspace(0.0, 20.0, 500)
    y = to_display(x)
    assert np.all(np.diff(y) > 0.0) and y[0] == 0.0 and y[-1] < 1.0
    # IEC 61966-2-1: linear 0.2140 is 50 % grey.
    assert to_display(np.array([0.21404]))[0] == pytest.approx(0.5, abs=1e-4)


def test_bloom_spreads_only_what_is_brighter_than_white_and_the_vignette_only_darkens_corners():
    dim = np.full((90, 160, 3), 0.5, dtype=np.float32)
    assert np.array_equal(bloom(dim), dim)
    spot = dim.copy()
    spot[40:48, 80:88] = 2.0
    gained = bloom(spot, strength=0.3) - spot
    # The spill is a mean: it adds up to the excess (2 − 0.6) of 64 pixels times the strength.
    assert gained.sum() / 3.0 == pytest.approx(0.3 * 1.4 * 64, rel=1e-3)
    dark = vignette(dim, strength=0.4)
    assert dark[45, 80, 0] == 0.5 and dark[0, 0, 0] == pytest.approx(0.3, abs=0.01)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"width": 0}, "width = 0, allowed [1, 16384]"),
        ({"samples": 99}, "samples = 99, allowed [1, 16]"),
        ({"style": "pink"}, f"style = 'pink', allowed: {', '.join(STYLES)}"),
        ({"device": "tpu:0"}, "device is 'tpu:0'; allowed: cpu"),
    ],
)
def test_bad_arguments_are_named(options, words):
    with pytest.raises(InputError) as caught:
        device = options.pop("device", "cpu")
        render(read_drawables(stages.new_stage()), PictureStyle(**{"width": 8, "height": 8, **options}), device)
    assert words in str(caught.value) and "\n" not in str(caught.value)
