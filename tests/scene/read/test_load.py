"""What the loader reads: units, defaults, transforms, references, instances, tracks, shapes."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.scene import (
    IDENTITY,
    Body,
    Material,
    Medium,
    Obstacle,
    Scene,
    SceneBuilder,
    Settings,
    Sphere,
    Track,
    vocabulary,
)
from otwarp.scene.transforms import rotation_matrix
from otwarp.scene.vocabulary.values import authored, internal
from otwarp.units import FROM_SI
from tests.scene.conftest import STAGE, StageFile

ROUNDING = 1e-12
"""Relative error of a few float64 operations."""

SINGLE = 1e-6
"""Relative error of single-precision transforms authored in a test."""

HALF = float(np.sqrt(0.5))


def obstacle(stage_file: StageFile, text: str, *changes: tuple[str, str]) -> Obstacle:
    """The obstacle that `text` authors in place of the block."""
    block = STAGE[STAGE.index('    def Cube "Block"') : STAGE.index('    def Xform "Flow"')]
    return stage_file.load((block, text), *changes).obstacles[0]


def test_values_defaults_and_units(stage_file: StageFile) -> None:
    scene = stage_file.load()
    assert scene.root == "/World"
    assert scene.medium == Medium()
    assert scene.settings == Settings(duration=1.0, frames_per_second=30.0)
    (trap,) = scene.traps
    assert (trap.wavelength, trap.numerical_aperture, trap.speed_limit) == (1.064, 1.2, float("inf"))
    assert trap.power == Track.constant(30.0)
    assert trap.position == Track(times=np.array([0.0, 1.0]), values=np.array([[0.0, 0, 5], [6, 0, 5]]))
    assert (trap.radial.stiffness, trap.radial.power, trap.axial) == (2.0, 20.0, None)
    assert trap.holds == "/World/Robot/Ball"
    robot, cell = scene.bodies
    assert robot.spheres == (Sphere(prim="/World/Robot/Ball", radius=1.5, refractive_index=1.5),)
    assert (robot.position, robot.orientation, robot.material) == ((0.0, 0.0, 5.0), IDENTITY, Material())
    assert cell.material == Material(youngs_modulus=1e3, poisson_ratio=0.45)
    assert (cell.kind, cell.density, cell.warning_force) == ("cell", 1060e-12, 10.0)
    assert scene.flow is not None and scene.goal is not None
    assert (scene.flow.speed, scene.flow.half_height) == (30.0, 10.0)
    assert (scene.goal.position, scene.goal.lost_distance) == ((40.0, 0.0, 5.0), 5.0)


@pytest.mark.parametrize("schema", vocabulary.SCHEMAS, ids=lambda schema: schema.name)
def test_defaults_agree_with_the_description(schema: vocabulary.Schema) -> None:
    kinds = {"OtSceneAPI": (Medium, Settings), "OtSphereAPI": (Sphere,)}.get(schema.name, ())
    defaults = {f.name: f.default for kind in kinds for f in dataclasses.fields(kind)}
    for attribute in schema.attributes:
        if attribute.usd_type == "double":
            value = internal(attribute.default, attribute.dimension)
            assert value == pytest.approx(attribute.default * FROM_SI[attribute.dimension], rel=ROUNDING)
            assert (value or None) == (defaults.get(attribute.field.rpartition(".")[2], value) or None)


@given(st.floats(-1e300, 1e300), st.sampled_from(["length", "power", "force", "surface_energy"]))
def test_conversion_of_units_loses_one_rounding_at_most(value: float, dimension: str) -> None:
    back = internal(authored(value, dimension), dimension)
    tiny = abs(value) < 1e-280  # the SI value would be subnormal
    assert tiny or abs(back - value) <= 2 * np.spacing(abs(value))


@given(st.integers(-(10**12), 10**12), st.integers(-6, 6))
def test_decimal_values_convert_exactly(digits: int, exponent: int) -> None:
    value = float(f"{digits}e{exponent}")
    assert internal(authored(value, "length"), "length") == value


@pytest.mark.parametrize("metres", [1.0, 0.01, 1e-3, 1e-9, 2.54e-2])
def test_any_unit_gives_the_same_scene(metres: float, stage_file: StageFile) -> None:
    """The stage at another metersPerUnit, with every length rewritten, is the same scene."""
    native = stage_file.load()
    f = 1e-6 / metres
    scene = stage_file.load(
        ("metersPerUnit = 1e-6", f"metersPerUnit = {metres!r}"),
        ("0: (0, 0, 5), 60: (6, 0, 5)", f"0: (0, 0, {5 * f!r}), 60: ({6 * f!r}, 0, {5 * f!r})"),
        ("translate = (0, 0, 5)", f"translate = (0, 0, {5 * f!r})"),
        ("radius = 1.5", f"radius = {1.5 * f!r}"),
        ("radius = 3", f"radius = {3 * f!r}"),
        ("(10, 0, 5)", f"({10 * f!r}, 0, {5 * f!r})"),
        ("size = 2", f"size = {2 * f!r}"),
        ("(20, 0, 1)", f"({20 * f!r}, 0, {f!r})"),
        ("(40, 0, 5)", f"({40 * f!r}, 0, {5 * f!r})"),
    )
    assert scene.bodies[0].spheres[0].radius == pytest.approx(1.5, rel=ROUNDING)
    assert scene.bodies[1].position == pytest.approx(native.bodies[1].position, rel=ROUNDING)
    assert scene.obstacles[0].size == pytest.approx((1.0, 1.0, 1.0), rel=ROUNDING)
    assert scene.traps[0].position.values == pytest.approx(native.traps[0].position.values, rel=ROUNDING)
    assert scene.goal is not None
    assert scene.goal.position == pytest.approx((40.0, 0.0, 5.0), rel=ROUNDING)
    assert scene.traps[0].wavelength == native.traps[0].wavelength  # SI, whatever the unit of the stage


def test_law_in_published_units(stage_file: StageFile) -> None:
    """The paper's constants in scene units of 20 µm and an arbitrary force unit."""
    law = (
        stage_file.load(
            ("isotropic:stiffness = 2", "isotropic:stiffness = 12000"),
            ("isotropic:lengthUnit = 1e-6", "isotropic:lengthUnit = 2e-5"),
            ("isotropic:forceUnit = 1e-12", "isotropic:forceUnit = 1e-14"),
            (
                "        double3 xformOp:translate.time",
                """        double ot:trapLaw:isotropic:threshold = 0.08
        double ot:trapLaw:isotropic:inverseSquare = 16.18
        double ot:trapLaw:isotropic:offset = -1568
        double ot:trapLaw:isotropic:cutoff = 0.1
        double ot:trapLaw:isotropic:radius = 0.075
        double3 xformOp:translate.time""",
            ),
        )
        .traps[0]
        .radial
    )
    assert law.stiffness == pytest.approx(12000 * 0.01 / 20, rel=ROUNDING)
    assert law.inverse_square == pytest.approx(16.18 * 0.01 * 400, rel=ROUNDING)
    assert (law.threshold, law.cutoff) == pytest.approx((1.6, 2.0), rel=ROUNDING)
    assert (law.offset, law.radius) == pytest.approx((-15.68, 1.5), rel=ROUNDING)


def test_harmonic_law_has_one_branch(stage_file: StageFile) -> None:
    law = (
        stage_file.load(
            ('"piecewise"', '"harmonic"'),
            ("isotropic:stiffness = 2", "isotropic:stiffness = 2\n double ot:trapLaw:isotropic:offset = 3"),
        )
        .traps[0]
        .radial
    )
    assert (law.stiffness, law.threshold, law.inverse_square, law.offset) == (2.0, float("inf"), 0.0, 0.0)


def test_nested_transforms_and_uniform_scale(stage_file: StageFile) -> None:
    robot, _ = stage_file.load(
        (
            "        double3 xformOp:translate = (0, 0, 5)\n"
            + '        uniform token[] xformOpOrder = ["xformOp:translate"]',
            """        double3 xformOp:translate = (0, 0, 50)
        double xformOp:rotateZ = 90
        double3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ", "xformOp:scale"]""",
        ),
        (
            'float3 xformOp:scale = (1, 1, 1)\n            uniform token[] xformOpOrder = ["xformOp:scale"]',
            'double3 xformOp:translate = (3, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]',
        ),
    ).bodies
    assert robot.position == pytest.approx((0, 0, 50), rel=ROUNDING)
    assert robot.orientation == pytest.approx((0, 0, HALF, HALF), rel=ROUNDING)
    assert robot.spheres[0].offset == pytest.approx((6, 0, 0), rel=ROUNDING)
    assert robot.spheres[0].radius == pytest.approx(3.0, rel=ROUNDING)


def test_a_rotation_leaves_the_radius_exact(stage_file: StageFile) -> None:
    turned = 'double3 xformOp:rotateXYZ = (12, 34, 56)\n uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]'
    cell = stage_file.load(
        (
            'double3 xformOp:translate = (10, 0, 5)\n        uniform token[] xformOpOrder = ["xformOp:translate"]',
            turned,
        ),
        ("translate = (0, 0, 5)", "translate = (0, 0, 50)"),
    ).bodies[1]
    assert cell.spheres[0].radius == 3.0
    assert np.linalg.norm(cell.orientation) == pytest.approx(1.0, rel=ROUNDING)


def test_references_and_native_instances(stage_file: StageFile) -> None:
    robot = STAGE[STAGE.index('    def Xform "Robot"') : STAGE.index('    def Sphere "Cell"')]
    parts = f'#usda 1.0\n(\n    defaultPrim = "Robot"\n)\n{robot}'
    stage_file.write(text=parts, name="robot.usda")
    placed = """    def "Robot" (instanceable = true
        prepend references = @robot.usda@)
    {
        double3 xformOp:translate = (-20, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
"""
    robot_body, _ = stage_file.load((robot, placed)).bodies
    assert robot_body.position == (-20.0, 0.0, 5.0)
    assert robot_body.spheres == (Sphere(prim="/World/Robot/Ball", radius=1.5, refractive_index=1.5),)


def test_inactive_prims_and_switched_off_colliders_do_not_count(stage_file: StageFile) -> None:
    scene = stage_file.load(
        (
            '["PhysicsCollisionAPI"])\n    {',
            '["PhysicsCollisionAPI"])\n    {\n        bool physics:collisionEnabled = 0',
        ),
        ('["OtFlowAPI"]', '["OtFlowAPI"]\n active = false'),
    )
    assert scene.obstacles == ()
    assert scene.flow is None


def test_colliders_of_a_body_are_no_obstacles(stage_file: StageFile) -> None:
    arm = '        def Capsule "Arm" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {}\n\n        def Sphere "Ball"'
    scene = stage_file.load(('        def Sphere "Ball"', arm))
    assert [obstacle.prim for obstacle in scene.obstacles] == ["/World/Block"]


def test_animated_parent_moves_the_trap(stage_file: StageFile) -> None:
    trap = stage_file.load(
        ("double ot:medium:refractiveIndex = 1.33", "double ot:medium:density = 997"),
        (
            '    def Xform "Trap"',
            """    def Xform "Hand" {
        double3 xformOp:translate.timeSamples = { 0: (1, 0, 0), 30: (2, 0, 0), 90: (2, 3, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    def Xform "Trap\"""",
        ),
        ('    def Xform "Robot"', '    }\n    def Xform "Robot"'),
    ).traps[0]
    assert trap.position.times.tolist() == [0.0, 0.5, 1.0, 1.5]
    expected = [[1.0, 0, 5], [5.0, 0, 5], [8.0, 1.5, 5], [8.0, 3.0, 5]]
    assert trap.position.values == pytest.approx(np.array(expected), rel=ROUNDING)


def test_time_starts_at_the_start_time_code(stage_file: StageFile) -> None:
    scene = stage_file.load(
        ("startTimeCode = 0", "startTimeCode = 30"),
        ("endTimeCode = 60", "endTimeCode = 90"),
        ("{ 0: (0, 0, 5), 60: (6, 0, 5) }", "{ 0: (0, 0, 5), 120: (6, 0, 5) }"),
        ("power = 0.03", "power.timeSamples = { 30: 0.03, 90: 0.01 }"),
    )
    assert scene.traps[0].position.times.tolist() == [-0.5, 1.5]
    assert scene.traps[0].power == Track(times=np.array([0.0, 1.0]), values=np.array([[30.0], [10.0]]))
    assert scene.settings.duration == 1.0


def test_a_trap_that_only_seems_to_move_needs_no_cover(stage_file: StageFile) -> None:
    trap = stage_file.load(("{ 0: (0, 0, 5), 60: (6, 0, 5) }", "{ 10: (0, 0, 5), 20: (0, 0, 5) }")).traps[0]
    assert not trap.position.animated


def test_moving_obstacle_on_the_union_of_times(stage_file: StageFile) -> None:
    found = obstacle(
        stage_file,
        """    def Cube "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double size = 2
        double3 xformOp:translate.timeSamples = { 0: (20, 0, 1), 60: (26, 0, 1) }
        double xformOp:rotateZ.timeSamples = { 0: 0, 20: 170, 40: 340, 60: 510 }
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
    }
""",
    )
    times = found.position.times
    assert [np.abs(times - t).min() for t in (0, 1 / 3, 2 / 3, 1)] == pytest.approx([0, 0, 0, 0], abs=ROUNDING)
    assert np.array_equal(found.orientation.times, times)
    assert found.position.values[:, 0] == pytest.approx(20 + 6 * times, rel=ROUNDING)
    angles = np.radians(510 * times) / 2
    expected = np.stack([0 * angles, 0 * angles, np.sin(angles), np.cos(angles)], axis=1)
    assert found.orientation.values == pytest.approx(expected, abs=ROUNDING)  # signs continuous, past 360°


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("kind", ["Cylinder", "Capsule", "Plane"])
def test_axis_is_folded_into_the_rotation(kind: str, axis: str, stage_file: StageFile) -> None:
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    expected = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ np.eye(3)["XYZ".index(axis)]
    place = -50.0 * expected  # away from the bodies, on the empty side of a plane
    text = f"""    def {kind} "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {{
        uniform token axis = "{axis}"
        double xformOp:rotateX = 30
        double3 xformOp:translate = ({place[0]}, {place[1]}, {place[2]})
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}
"""
    found = obstacle(stage_file, text)
    assert found.shape == kind.lower()
    assert found.position.values[0] == pytest.approx(place, abs=ROUNDING)
    assert rotation_matrix(found.orientation.values[0])[:, 2] == pytest.approx(expected, abs=ROUNDING)


def test_scales_are_baked_into_shapes(stage_file: StageFile) -> None:
    scale = 'double3 xformOp:scale = (2, 3, 4)\n uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
    head = '(prepend apiSchemas = ["PhysicsCollisionAPI"]) {\n double3 xformOp:translate = (0, 0, -90)\n'
    box = obstacle(stage_file, f'def Cube "Block" {head} double size = 3\n {scale}\n}}\n')
    assert box.size == (3.0, 4.5, 6.0)
    even = scale.replace("(2, 3, 4)", "(4, 2, 2)")
    rod = obstacle(
        stage_file, f'def Cylinder "Block" {head} uniform token axis = "X"\n double radius = 1\n {even}\n}}\n'
    )
    assert rod.size == (2.0, 4.0, 0.0)  # USD's default height of 2, stretched by 4: half height 4
    mesh = obstacle(
        stage_file,
        f"""def Mesh "Block" {head}
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
        int[] faceVertexCounts = [4, 3]
        int[] faceVertexIndices = [0, 3, 2, 1, 0, 1, 4]
        {scale}\n}}\n""",
    )
    assert mesh.vertices.tolist() == [[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [0, 0, 4]]
    assert mesh.triangles.tolist() == [[0, 3, 2], [0, 2, 1], [0, 1, 4]]
    mirrored = scale.replace("(2, 3, 4)", "(-2, 3, 4)")
    other = obstacle(
        stage_file,
        f"""def Mesh "Block" {head}
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        {mirrored}\n}}\n""",
    )
    corners = other.vertices @ rotation_matrix(other.orientation.values[0]).T
    assert corners.tolist() == [[0, 0, 0], [-2, 0, 0], [-2, 3, 0]]
    assert other.triangles.tolist() == [[2, 1, 0]]  # turned over, so that the outside stays outside


def test_instances_with_scales_rotations_and_hidden_ones(stage_file: StageFile) -> None:
    text = """    def PointInstancer "Cells"
    {
        rel prototypes = [</World/Cells/Kind>, </World/Cells/Leaf>]
        int[] protoIndices = [0, 1, 0, 0]
        int64[] invisibleIds = [3]
        point3f[] positions = [(100, 0, 5), (150, 0, 5), (200, 0, 5), (300, 0, 5)]
        float3[] scales = [(1, 1, 1), (1, 1, 1), (0.5, 0.5, 0.5), (1, 1, 1)]
        quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0), (0, 0, 0, 1), (1, 0, 0, 0)]
        double3 xformOp:translate = (0, 10, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Xform "Kind"
        {
            double3 xformOp:translate = (0, 0, 2)
            uniform token[] xformOpOrder = ["xformOp:translate"]

            def Sphere "Ball" (prepend apiSchemas = ["OtCellAPI"])
            {
                double radius = 3
            }
        }

        def Cube "Leaf"
        {
        }
    }

    def Cube "Block\""""
    scene = stage_file.load(('    def Cube "Block"', text))
    cells = [body for body in scene.bodies if body.instance is not None]
    assert [cell.name for cell in cells] == ["/World/Cells[0]", "/World/Cells[2]"]
    assert cells[0].position == (100.0, 10.0, 7.0)
    assert cells[1].position == pytest.approx((200.0, 10.0, 6.0), rel=SINGLE)
    assert [cell.spheres[0].radius for cell in cells] == [3.0, 1.5]
    assert abs(cells[1].orientation[2]) == pytest.approx(1.0, rel=SINGLE)


@pytest.mark.thorough
def test_ten_thousand_cells_load_in_proportion(tmp_path) -> None:
    """Ten times the cells cost about ten times as much, not a hundred times."""
    grid = np.stack(np.meshgrid(np.arange(100), np.arange(100), [0.0]), axis=-1).reshape(-1, 3) * 7.0
    prototype = Body(prim="/Cell", kind="cell", spheres=(Sphere(prim="/Cell", radius=3.0),))

    def load(count: int) -> tuple[Scene, float]:
        builder = SceneBuilder()
        builder.add_cells("/World/Cells", prototype, grid[:count])
        path = builder.save(tmp_path / f"cells_{count}.usdc")
        found, best = None, float("inf")
        for _ in range(3):  # the least of three: a neighbour on the machine fills caches, and costs time of the process
            begin = time.process_time()
            found = Scene.load(path)
            best = min(best, time.process_time() - begin)
        assert found is not None
        return found, best

    load(10)
    scene, whole = load(len(grid))
    assert whole < 40.0 * load(len(grid) // 10)[1]
    assert np.array([body.position for body in scene.bodies]) == pytest.approx(grid)
