"""What SceneBuilder writes: it loads back equal, and other USD programs find what they expect."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import (
    Body,
    Camera,
    Flow,
    Goal,
    Material,
    Medium,
    Obstacle,
    Scene,
    SceneBuilder,
    Settings,
    Sphere,
    Track,
    Trap,
)

ROUNDING = 1e-12
"""Relative error of the way through a matrix and back."""

LAW = TrapLaw(stiffness=12.3, threshold=0.7, inverse_square=3.3, offset=-0.4, cutoff=2.5, power=17.0, radius=1.525)
TURN = (0.1, -0.2, 0.3, float(np.sqrt(1 - 0.14)))
UPRIGHT = Track.constant((0.0, 0.0, 0.0, 1.0))
MOVING = Track(times=np.array([0.0, 0.5, 2.0]), values=np.array([[0.0, 0, 5], [1.1, 0.7, 5], [3.3, -0.3, 5.5]]))

MOVING_TRAP = Trap(
    prim="/World/Traps/Left",
    position=MOVING,
    power=Track(times=np.array([0.0, 2.0]), values=np.array([[20.0], [31.7]])),
    radial=LAW,
    axial=dataclasses.replace(LAW, stiffness=4.4),
    equilibrium=0.31,
    polarization="x",
    hand="left",
    speed_limit=30.0,
    holds="/World/Robot/Handles/A",
)
STILL_TRAP = Trap(
    prim="/World/Traps/Right",
    position=Track.constant((8.7, 0.1, 5.0)),
    power=Track.constant(18.3),
    radial=TrapLaw(stiffness=3.7, cutoff=9.1, power=20.0),
    model="harmonic",
    wavelength=0.83,
    numerical_aperture=1.2,
)
ROBOT = Body(
    prim="/World/Robot",
    position=(0.1, 0.2, 5.0),
    orientation=TURN,
    spheres=(
        Sphere(prim="/World/Robot/Handles/A", radius=1.525, offset=(0.1, 0.0, 0.3)),
        Sphere(prim="/World/Robot/Hub", radius=1.1, offset=(3.3, 0.0, 0.7), trapped=False, collides=False, drag=False),
    ),
    density=1300e-12,
    material=Material(youngs_modulus=2e6, poisson_ratio=0.33),
    mobility=tuple(0.25 * i for i in range(36)),
    warning_force=12.5,
)
CELL = Body(
    prim="/World/Cell",
    kind="cell",
    position=(10.0, 0.0, 5.0),
    spheres=(Sphere(prim="/World/Cell", radius=3.3, refractive_index=1.41, trapped=True),),
    density=1060e-12,
    material=Material(youngs_modulus=1.5e3, poisson_ratio=0.45, adhesion=1e-3, adhesion_range=0.02),
    warning_force=7.0,
)
MESH = {
    "vertices": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "triangles": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32),
}
OBSTACLES = (
    Obstacle(prim="/World/Walls/Floor", shape="plane", position=Track.constant((0.0, 0, 0)), orientation=UPRIGHT),
    Obstacle(
        prim="/World/Walls/Box",
        shape="box",
        position=Track.constant((-20.0, 0, 0)),
        orientation=UPRIGHT,
        size=(1.0, 2.2, 3.3),
    ),
    Obstacle(
        prim="/World/Walls/Ball",
        shape="sphere",
        position=Track.constant((-30.0, 0, 0)),
        orientation=UPRIGHT,
        size=(2.2, 0.0, 0.0),
    ),
    Obstacle(
        prim="/World/Walls/Pillar",
        shape="cylinder",
        position=Track.constant((-40.0, 0, 0)),
        orientation=UPRIGHT,
        size=(2.0, 7.1, 0.0),
    ),
    Obstacle(
        prim="/World/Walls/Pin",
        shape="capsule",
        position=Track.constant((-50.0, 0, 0)),
        orientation=UPRIGHT,
        size=(1.0, 3.3, 0.0),
    ),
    Obstacle(
        prim="/World/Walls/Wedge",
        shape="mesh",
        position=Track.constant((-60.0, 0, 0)),
        orientation=UPRIGHT,
        double_sided=True,
        **MESH,
    ),
    Obstacle(
        prim="/World/Movers/Cube",
        shape="box",
        position=Track(times=MOVING.times, values=MOVING.values + np.array([-80.0, 0.0, 0.0])),
        orientation=Track(times=MOVING.times, values=np.tile([0.0, 0, 0, 1], (3, 1))),
        size=(1.0, 1.0, 1.0),
    ),
)
FLOW = Flow(prim="/World/Flow", kind="poiseuille", origin=(0.0, 0.0, 20.0), speed=33.0, half_height=20.5)
CAMERA = Camera(prim="/World/Microscope", numerical_aperture=1.3, focus=4.4, noise=0.02)
GOAL = Goal(
    prim="/World/Goal",
    position=(40.0, 1.0, 5.0),
    cell="/World/Cell",
    robots=("/World/Robot",),
    tolerance=1.1,
    lost_distance=5.2,
    cell_lost_distance=10.3,
    distance_warning=2.4,
)
MEDIUM = Medium(refractive_index=1.34, viscosity=0.001, temperature=310.15, density=1010e-12)
SETTINGS = Settings(
    accuracy=0.02, time_step=1e-5, brownian=False, gravity=True, coupling=True, duration=2.0, frames_per_second=60.0
)


def full_builder() -> SceneBuilder:
    """One of everything."""
    builder = SceneBuilder(medium=MEDIUM, settings=SETTINGS)
    for item in (MOVING_TRAP, STILL_TRAP, ROBOT, CELL, *OBSTACLES, FLOW, CAMERA, GOAL):
        builder.add(item)
    builder.add_rod("/World/Robot", "Rod", (0, 0, 0), (3, 0, 1), 0.5)
    builder.add_cells(
        "/World/Cells", CELL, np.array([[40.0, 40.1, 10.0], [50.0, 50.0, 12.0]]), scales=np.array([1, 0.5])
    )
    builder.add_view("/World/View", (30, -60, 50), (0, 0, 5))
    builder.add_light("/World/Lights/Key")
    builder.add_light("/World/Lights/Sky", kind="dome", intensity=300.0)
    return builder


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_what_is_saved_loads_back_equal(suffix: str, tmp_path: Path) -> None:
    builder = full_builder()
    path = builder.save(tmp_path / f"scene{suffix}")
    scene = Scene.load(path)
    assert scene == builder.scene()
    assert scene.file == path
    assert [file.name for file in tmp_path.iterdir()] == [path.name]  # no temporary file stays behind


def test_the_scene_is_what_was_added() -> None:
    scene = full_builder().scene()
    assert (scene.medium, scene.settings) == (MEDIUM, SETTINGS)
    assert (scene.flow, scene.camera, scene.goal) == (FLOW, CAMERA, GOAL)
    assert scene.traps == (MOVING_TRAP, STILL_TRAP)
    assert scene.obstacles == OBSTACLES
    robot, cell = scene.bodies[:2]
    assert cell == CELL
    assert robot.orientation == pytest.approx(TURN, abs=ROUNDING)
    assert dataclasses.replace(robot, orientation=TURN) == ROBOT


def test_instances_load_as_bodies() -> None:
    first, second = full_builder().scene().bodies[2:]
    assert (first.name, second.name) == ("/World/Cells[0]", "/World/Cells[1]")
    assert first.position == (40.0, float(np.float32(40.1)), 10.0)  # USD stores them in single precision
    assert (first.material, first.density, first.warning_force) == (CELL.material, CELL.density, CELL.warning_force)
    assert (first.spheres[0].radius, second.spheres[0].radius) == (3.3, 1.65)
    assert first.spheres[0].trapped


def test_every_attribute_is_authored() -> None:
    from otwarp.scene.vocabulary import SCHEMAS
    from otwarp.scene.vocabulary.attribute import INSTANCE

    stage = full_builder().stage
    for schema in SCHEMAS:
        for prim in stage.Traverse():
            instances = [name.split(":")[1] for name in prim.GetAppliedSchemas() if name.startswith(schema.name + ":")]
            instances += [""] * (schema.name in prim.GetAppliedSchemas())
            for instance in instances:
                for attribute in schema.attributes:
                    prop = prim.GetProperty(attribute.name.replace(INSTANCE, instance))
                    assert prop.IsAuthored() or attribute.optional or prop.GetName() == "ot:trap:holds"
                    assert not prop.IsCustom()


def test_what_other_programs_look_for() -> None:
    from pxr import UsdGeom, UsdPhysics, UsdShade

    stage = full_builder().stage
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1e-6
    assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1e-15
    assert (stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (120.0, 60.0)
    for path in ("/World/Robot", "/World/Cell", "/World/Movers/Cube"):
        assert stage.GetPrimAtPath(path).HasAPI(UsdPhysics.RigidBodyAPI), path
    assert UsdPhysics.RigidBodyAPI(stage.GetPrimAtPath("/World/Movers/Cube")).GetKinematicEnabledAttr().Get()
    assert not stage.GetPrimAtPath("/World/Walls/Box").HasAPI(UsdPhysics.RigidBodyAPI)
    drawn = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Gprim)]
    assert len(drawn) == 6 + 3 + 2 + 7 + 1  # beams, robot, cell and prototype, obstacles, goal
    for prim in drawn:
        gprim = UsdGeom.Gprim(prim)
        assert gprim.GetExtentAttr().HasAuthoredValue(), prim
        assert gprim.GetDisplayColorAttr().HasAuthoredValue(), prim
        assert UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0], prim


def test_beams_are_two_cones_that_meet_at_the_focus() -> None:
    from pxr import Gf, UsdGeom

    stage = full_builder().stage
    cache = UsdGeom.XformCache(0.0)
    for name in ("BeamBelow", "BeamAbove"):
        prim = stage.GetPrimAtPath(f"/World/Traps/Right/{name}")
        cone = UsdGeom.Cone(prim)
        tip = cache.GetLocalToWorldTransform(prim).Transform(Gf.Vec3d(0, 0, cone.GetHeightAttr().Get() / 2))
        assert tuple(tip) == pytest.approx((8.7, 0.1, 5.0), rel=ROUNDING)
        assert UsdGeom.Imageable(prim).ComputePurpose() == "default"


def test_view_looks_at_its_target() -> None:
    from pxr import Gf, UsdGeom

    builder = SceneBuilder()
    eye, target = np.array([30.0, -60.0, 50.0]), np.array([1.0, 2.0, 5.0])
    prim = builder.add_view("/World/View", eye, target, field_of_view=35.0)
    camera = UsdGeom.Camera(prim).GetCamera(0.0)
    distance = float(np.linalg.norm(eye - target))
    seen = camera.transform.GetInverse().Transform(Gf.Vec3d(*target))
    assert tuple(seen) == pytest.approx((0.0, 0.0, -distance), abs=2e-9 * distance)  # nine digits of a quaternion
    assert camera.GetFieldOfView(Gf.Camera.FOVHorizontal) == pytest.approx(35.0, rel=1e-6)
    assert camera.focusDistance == pytest.approx(distance, rel=1e-6)
    assert camera.clippingRange.min < distance < camera.clippingRange.max
    up = camera.transform.TransformDir(Gf.Vec3d(0, 1, 0))
    assert up[2] > 0.0


def test_the_microscope_can_be_an_existing_view() -> None:
    builder = SceneBuilder()
    view = builder.add_view(
        "/World/Microscope", (0, 0, 90), (0, 0, 5), up=(0, 1, 0), orthographic=True, field_of_view=40
    )
    builder.add(CAMERA)
    assert view.GetAttribute("horizontalAperture").Get() == 400.0
    camera = builder.scene().camera
    assert camera is not None
    assert camera.frame[0] == 40.0
    assert dataclasses.replace(camera, frame=CAMERA.frame) == CAMERA


def test_saving_is_repeatable(tmp_path: Path) -> None:
    first, second = full_builder().save(tmp_path / "a.usda"), full_builder().save(tmp_path / "b.usda")
    assert first.read_text() == second.read_text()


def robot_with(**fields: object) -> Body:
    return dataclasses.replace(ROBOT, **fields)


@pytest.mark.parametrize(
    ("add", "expected"),
    [
        (lambda b: b.add(robot_with(prim="/Elsewhere/Robot")), "must be a prim path at or below /World"),
        (lambda b: b.add(robot_with(prim="/World/1 x")), "must be a prim path at or below /World"),
        (lambda b: (b.add(CELL), b.add(CELL)), "/World/Cell: path = /World/Cell: must not be taken already"),
        (lambda b: b.add(robot_with(spheres=CELL.spheres)), "must be below its body /World/Robot"),
        (lambda b: b.add(robot_with(kind="cell", prim="/World/C")), "must be cell, with one centred colliding sphere"),
        (lambda b: b.add(robot_with(material=Material(adhesion=1.0))), "adhesion = 1: must be 0 for a robot"),
        (lambda b: b.add_cells("/World/C", ROBOT, [[0, 0, 0]]), "kind = robot: must be cell"),
        (
            lambda b: b.add(dataclasses.replace(OBSTACLES[0], shape="torus")),
            "shape = 'torus': must be one of plane, box",
        ),
        (lambda b: b.add(dataclasses.replace(FLOW, prim="/World")), "must be 0 on the default prim"),
        (lambda b: b.add_view("/World/V", (0, 0, 1), (0, 0, 1)), "must differ from target"),
        (lambda b: b.add_light("/World/L", kind="laser"), "kind = laser: must be one of distant, dome"),
        (lambda b: b.add_rod("/World", "Rod", (0, 0, 0), (0, 0, 0), 1.0), "must be in (0, inf)"),
    ],
)
def test_what_cannot_be_authored(add, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        add(SceneBuilder())
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_nothing_is_saved_of_a_bad_scene(tmp_path: Path) -> None:
    builder = SceneBuilder()
    builder.add(dataclasses.replace(STILL_TRAP, holds="/World/Nothing"))
    with pytest.raises(InputError, match=r"SceneBuilder: /World/Traps/Right: ot:trap:holds = /World/Nothing: must be"):
        builder.save(tmp_path / "scene.usda")
    assert list(tmp_path.iterdir()) == []


def test_a_trap_that_holds_a_misspelt_sphere_names_the_nearest() -> None:
    builder = SceneBuilder()
    (trap,) = builder.add_robot("/World/Robot", [(0.0, 0.0, 5.0)], 1.0, power=5.0)
    builder.stage.GetPrimAtPath(trap.prim).GetRelationship("ot:trap:holds").SetTargets(["/World/Robot/spere_0"])
    with pytest.raises(InputError, match=r"did you mean /World/Robot/sphere_0"):
        builder.scene().check()


def test_files_that_cannot_be_written(tmp_path: Path) -> None:
    builder = SceneBuilder()
    for path in (tmp_path / "scene.txt", tmp_path / "none" / "scene.usda"):
        with pytest.raises(InputError, match=f"^{path}: .*must be"):
            builder.save(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("add", "expected"),
    [
        (lambda b: b.add(Trap(prim="/World/T", position=(0, 0, 5), power=5.0)), "position = (0, 0, 5) (a tuple)"),  # type: ignore[arg-type]
        (lambda b: b.add(Trap(prim="/World/T", position=UPRIGHT, power=STILL_TRAP.power)), "4 numbers"),
        (lambda b: b.add(dataclasses.replace(ROBOT, position=(0, 5))), "/World/Robot: position = (0, 5)"),
        (lambda b: b.add(dataclasses.replace(CELL, spheres=(Sphere(prim="/World/Cell", radius="1"),))), "radius = '1'"),  # type: ignore[arg-type]
        (lambda b: b.add(dataclasses.replace(CELL, spheres=CELL.spheres[0])), "spheres = a Sphere"),
        (lambda b: b.add_cell("/World/C", (0.0, 5.0), 1.0), "/World/C: position = (0.0, 5.0)"),
        (lambda b: b.add(3), "item = 3 (of class int): must be one of Trap, Body"),
        (lambda b: SceneBuilder(settings=Settings(duration=-1)), "duration = -1: must be in (0, inf)"),
        (lambda b: Sphere(prim="/World/S", radius=1.0, index=1.5), "Sphere: index is unknown; did you mean refrac"),  # type: ignore[call-arg]
    ],
)  # fmt: skip
def test_a_slip_is_one_line_where_it_is_made(add, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        add(SceneBuilder())
    assert expected in str(caught.value) and "\n" not in str(caught.value)
