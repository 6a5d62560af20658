from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.record.recorder import Recorder
from otwarp.scene import Scene
from otwarp.scene.drawing.unlike import unlike_file
from otwarp.scene.read.variations import Variations
from otwarp.scene.recording import usd as record_module
from otwarp.scene.recording.force_arrows import ARROW_SCALE, SHORTEST
from otwarp.scene.recording.usd import CLIP_FRAMES, UsdRecording
from otwarp.scene.transforms import multiply, rotation_matrix
from otwarp.simulation.frame import Frame
from tests.record.small_run import HELD, RATE, frame, write_stage

UNIT = 0.5
"""µm per stage unit of the small stage."""

FLOAT = 2e-5
"""Positions of instances are single precision; 20 µm has a spacing of 2e-6, and transforms add a few of them."""

HALF = 2e-3
"""Orientations of instances are half precision, with a spacing of 5e-4 near 1; two components round."""

EXACT = 1e-9
"""Double precision, a dozen operations on numbers of order 100."""


def record(scene: Scene, folder: Path, frames: list[Frame], **options: object) -> UsdRecording:
    folder.mkdir()
    recording = UsdRecording(scene, frames_per_second=RATE, held=HELD, **options)
    recording.begin(folder)
    for item in frames:
        recording.write(item)
    return recording


def world_pose(stage: Usd.Stage, prim: str, code: float) -> tuple[np.ndarray, np.ndarray]:
    matrix = UsdGeom.XformCache(code).GetLocalToWorldTransform(stage.GetPrimAtPath(prim))
    turn = np.array(matrix.RemoveScaleShear().ExtractRotationMatrix()).T
    return np.array(matrix.ExtractTranslation()) * UNIT, turn


def about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def check(stage: Usd.Stage, scene: Scene, code: float) -> None:
    """Everything in the stage at a time code must be what the (linear) motion of the frames says."""
    time = code / RATE
    wanted = frame(scene, 0, rate=1.0 / time if time else 1.0)
    wanted = frame(scene, 1, rate=1.0 / time) if time else wanted
    for index, body in enumerate(scene.bodies):
        if body.instance is None:
            place, turn = world_pose(stage, body.prim, code)
            np.testing.assert_allclose(place, wanted.position[0, index], atol=EXACT)
            np.testing.assert_allclose(turn, about_z(time), atol=EXACT)
    crowd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Crowd"))
    matrices = crowd.ComputeInstanceTransformsAtTime(code, code)
    base = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(crowd.GetPrim()))
    places = np.array([(np.array(m) @ base)[3, :3] for m in matrices]) * UNIT
    np.testing.assert_allclose(places, wanted.position[0, 3:], atol=FLOAT)
    np.testing.assert_allclose(np.array(matrices)[0, :3, :3].T, about_z(time), atol=HALF)
    for index, trap in enumerate(scene.traps):
        place, turn = world_pose(stage, trap.prim, code)
        np.testing.assert_allclose(place, wanted.trap_position[0, index], atol=EXACT)
        np.testing.assert_allclose(turn, np.eye(3), atol=EXACT)
        power = stage.GetPrimAtPath(trap.prim).GetAttribute("ot:trap:power").Get(code)
        assert power == pytest.approx(1e-3 * (20.0 + time), rel=1e-6)


CODES = [0.0, 0.5, 17.25, CLIP_FRAMES - 1, CLIP_FRAMES - 0.5, CLIP_FRAMES, CLIP_FRAMES + 0.5, 59.0]


def test_every_moment_is_in_the_clips_while_running_and_in_the_trajectory_afterwards(
    scene: Scene, tmp_path: Path
) -> None:
    recording = record(scene, tmp_path / "run", [frame(scene, i) for i in range(60)])
    recording.flush()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 59.0)
    assert len(stage.GetRootLayer().subLayerPaths) == 2
    for code in CODES:
        check(stage, scene, code)
    recording.close()
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["run.usda", "trajectory.usdc"]
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert stage.GetDefaultPrim().GetPath() == scene.root
    assert (stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (59.0, RATE)
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(5e-7)
    for code in CODES:
        check(stage, scene, code)


def test_what_the_scene_animates_plays_in_step_with_the_run(scene: Scene, tmp_path: Path) -> None:
    record(scene, tmp_path / "run", [frame(scene, i) for i in range(31)]).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    block = next(o for o in scene.obstacles if o.prim == "/World/block")
    for code in (0.0, 15.0, 30.0):
        np.testing.assert_allclose(world_pose(stage, block.prim, code)[0], block.position.at(code / RATE), atol=EXACT)
    assert block.position.animated


def test_a_run_too_large_to_merge_stays_as_clips(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_module, "LARGEST_MERGE", 0)
    record(scene, tmp_path / "run", [frame(scene, i) for i in range(70)]).close()
    names = sorted(p.name for p in (tmp_path / "run" / "trajectory").iterdir())
    assert names == [f"frames.{k:06d}.usdc" for k in range(3)] + ["manifest.usdc"]
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert stage.GetEndTimeCode() == 69.0
    for code in (*CODES, 69.0):
        check(stage, scene, code)


def test_the_root_layer_names_the_scene_relatively_and_the_run_can_be_moved(scene: Scene, tmp_path: Path) -> None:
    record(scene, tmp_path / "run", [frame(scene, 0), frame(scene, 1)]).close()
    moved = tmp_path.with_name(tmp_path.name + "_moved")
    tmp_path.rename(moved)
    stage = Usd.Stage.Open(str(moved / "run" / "run.usda"))
    assert stage.GetRootLayer().subLayerPaths[1] == "../scene/small.usda"
    assert not stage.GetCompositionErrors()
    check(stage, scene, 1.0)


def test_a_frame_within_half_a_step_of_its_time_code_is_put_on_it(scene: Scene, tmp_path: Path) -> None:
    frames = [dataclasses.replace(frame(scene, i), time=i / RATE + 4e-4) for i in (0, 1)]
    record(scene, tmp_path / "run", frames, time_step=1e-3).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert stage.GetPrimAtPath("/World/Group/cell").GetAttribute("xformOp:translate:run").GetTimeSamples() == [0, 1]


def test_a_resumed_run_starts_at_its_own_time(scene: Scene, tmp_path: Path) -> None:
    record(scene, tmp_path / "run", [frame(scene, i) for i in range(40, 43)]).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (40.0, 42.0)
    check(stage, scene, 41.5)


def test_contact_arrows_start_at_the_dish_of_a_robot_and_turn_with_it(scene: Scene, tmp_path: Path) -> None:
    handle = dataclasses.replace(scene.bodies[0].spheres[0], offset=(0.0, 0.0, 0.0), radius=1.0)
    dish = [
        dataclasses.replace(handle, offset=(6.0, y, 0.0), radius=0.5, trapped=False, collides=True) for y in (-1.0, 3.0)
    ]
    ghost = dataclasses.replace(handle, offset=(0.0, 0.0, 9.0), trapped=False, collides=False)
    robot = dataclasses.replace(scene.bodies[0], spheres=(handle, *dish, ghost))
    scene = dataclasses.replace(scene, bodies=(robot, *scene.bodies[1:]))
    turned = np.array(frame(scene, 0).orientation)
    turned[0, 0] = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    force = np.zeros_like(frame(scene, 0).contact_force)
    force[0, 0] = (0.0, 0.0, 2.0)
    item = frame(scene, 0, orientation=turned, contact_force=force)
    record(scene, tmp_path / "run", [item], forces=True).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    arrow = stage.GetPrimAtPath("/World/Forces/contact_World_Group_left")
    tail = np.array(UsdGeom.XformCache(0.0).GetLocalToWorldTransform(arrow))[3, :3] * UNIT
    # centre of the dish (6, 1, 0) a quarter turn on, and up by the radius of its spheres
    np.testing.assert_allclose(tail, item.position[0, 0] + [-1.0, 6.0, 0.5], atol=EXACT)


def test_arrows_have_the_documented_length_and_direction_and_hide_when_there_is_no_force(
    scene: Scene, tmp_path: Path
) -> None:
    frames = [frame(scene, i) for i in range(3)]
    frames[2] = dataclasses.replace(frames[2], contact_force=np.zeros_like(frames[2].contact_force))
    record(scene, tmp_path / "run", frames, forces=True).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    forces = stage.GetPrimAtPath("/World/Forces")
    assert forces.GetCustomDataByKey("micrometresPerPiconewton") == ARROW_SCALE
    assert len(forces.GetChildren()) == 5
    arrow = stage.GetPrimAtPath("/World/Forces/contact_World_Group_left")
    assert UsdGeom.Imageable(arrow).ComputePurpose() == "guide"
    matrix = np.array(UsdGeom.XformCache(1.0).GetLocalToWorldTransform(arrow)) * UNIT
    # unit vector along the arrow's +Z, and its tail at the surface of the sphere of radius 1 µm
    np.testing.assert_allclose(matrix[2, :3], [-(1.0 + 1.0 / RATE) * ARROW_SCALE, 0.0, 0.0], atol=EXACT)
    np.testing.assert_allclose(matrix[3, :3], frames[1].position[0, 0] + [-1.0, 0.0, 0.0], atol=EXACT)
    visibility = [UsdGeom.Imageable(arrow).ComputeVisibility(code) for code in (0.0, 1.0, 2.0)]
    assert visibility == ["inherited", "inherited", "invisible"]
    trap = stage.GetPrimAtPath("/World/Forces/trap_World_Traps_left")
    matrix = np.array(UsdGeom.XformCache(1.0).GetLocalToWorldTransform(trap)) * UNIT
    np.testing.assert_allclose(matrix[2, :3], [0.0, -0.25 * ARROW_SCALE, 0.0], atol=EXACT)
    # the sphere that the trap holds has a radius of 1 µm; its arrow starts where the sphere ends
    np.testing.assert_allclose(matrix[3, :3], frames[1].position[0, 0] + [0.0, -1.0, 0.0], atol=EXACT)
    assert 0.25 * ARROW_SCALE > SHORTEST
    box = UsdGeom.BBoxCache(1.0, ["guide"]).ComputeWorldBound(arrow).ComputeAlignedRange()
    assert box.GetSize()[0] * UNIT == pytest.approx((1.0 + 1.0 / RATE) * ARROW_SCALE)


def test_parents_that_move_or_are_uneven_do_not_distort_the_recording(tmp_path: Path) -> None:
    path = write_stage(tmp_path / "scene")
    text = path.read_text()
    moving = text.replace(
        'def Xform "Traps"\n    {',
        'def Xform "Traps"\n    {\n        double3 xformOp:translate.timeSamples = { 24: (0, 0, 0), 48: (5, 0, 0) }\n'
        "        double3 xformOp:scale = (1, 2, 1)\n"
        '        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]',
    )
    assert moving != text
    path.write_text(moving)
    scene = Scene.load(path)
    record(scene, tmp_path / "run", [frame(scene, i) for i in range(12)]).close()
    check(Usd.Stage.Open(str(tmp_path / "run" / "run.usda")), scene, 11.0)


def test_the_chosen_world_is_written(scene: Scene, tmp_path: Path) -> None:
    record(scene, tmp_path / "run", [frame(scene, i, worlds=3) for i in range(2)], world=2).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    np.testing.assert_allclose(
        world_pose(stage, "/World/Group/cell", 0.0)[0], np.array(scene.bodies[2].position) + 0.2, atol=EXACT
    )


def test_a_scene_without_a_file_cannot_be_recorded_as_usd(scene: Scene) -> None:
    with pytest.raises(InputError, match=r"scene\.file = None"):
        UsdRecording(dataclasses.replace(scene, file=None), frames_per_second=RATE, held=HELD)


@pytest.mark.parametrize("step", ["_write_root", "rmtree"])
def test_a_run_that_dies_while_it_is_merged_still_opens(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    recording = record(scene, tmp_path / "run", [frame(scene, i) for i in range(60)])
    recording.flush()

    def die(*_: object, **__: object) -> None:
        raise RuntimeError("killed")

    monkeypatch.setattr(*((recording, step) if step == "_write_root" else (record_module.shutil, step)), die)
    with pytest.raises(RuntimeError, match="killed"):
        recording.close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert stage.GetEndTimeCode() == 59.0
    for code in CODES:
        check(stage, scene, code)


CROWD = """    def PointInstancer "Crowd"
    {
        double3 xformOp:translate = (0, 40, 0)
        double xformOp:rotateX = 30
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
        int[] protoIndices = [0, 1, 0, 0]
        int64[] invisibleIds = [3]
        point3f[] positions = [(0, 0, 10), (50, 0, 10), (30, 0, 10), (70, 0, 10)]
        quath[] orientations = [(0, 0, 0, 1), (0.6, 0, 0, 0.8), (0.6, 0.8, 0, 0), (0.8, 0, 0.6, 0)]
        rel prototypes = [</World/Crowd/Kind>, </World/Crowd/Leaf>]
        def Xform "Kind"
        {
            double3 xformOp:translate = (3, 0, 1)
            double xformOp:rotateY = 70
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
            def Sphere "Cell" (prepend apiSchemas = ["OtCellAPI"])
            {
                double radius = 2
                float3[] extent = [(-2, -2, -2), (2, 2, 2)]
                double3 xformOp:translate = (0, 2, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }
        }
        def Cube "Leaf"
        {
        }
    }
"""


def test_cells_off_the_origin_of_a_turned_prototype_play_back_where_they_were(tmp_path: Path) -> None:
    path = write_stage(tmp_path / "scene")
    text = path.read_text()
    old = text[text.index('    def PointInstancer "Crowd"') : text.index('    def Xform "Traps"')]
    path.write_text(text.replace(old, CROWD))
    scene = Scene.load(path)
    crowd_bodies = [i for i, body in enumerate(scene.bodies) if body.instance is not None]
    assert [scene.bodies[i].instance for i in crowd_bodies] == [0, 2]
    start = frame(scene, 0)
    still = np.broadcast_to([b.orientation for b in scene.bodies], start.orientation.shape)
    about = np.array([np.sin(0.4), 0.0, 0.0, np.cos(0.4)])
    frames = [
        dataclasses.replace(start, orientation=still),
        dataclasses.replace(frame(scene, 1), orientation=multiply(about, still)),
    ]
    record(scene, tmp_path / "run", frames).close()
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Crowd"))
    base = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(instancer.GetPrim()))
    cell = np.array(UsdGeom.XformCache().GetLocalTransformation(stage.GetPrimAtPath("/World/Crowd/Kind/Cell"))[0])
    for code, item in enumerate(frames):
        matrices = np.array(
            instancer.ComputeInstanceTransformsAtTime(
                code, code, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
            )
        )
        for body in crowd_bodies:
            whole = cell @ matrices[scene.bodies[body].instance or 0] @ base
            # half-precision turns (5e-4) move a centre 4.2 stage units from the origin of its instance
            np.testing.assert_allclose(whole[3, :3] * UNIT, item.position[0, body], atol=4.2 * HALF * UNIT)
            np.testing.assert_allclose(whole[:3, :3].T, rotation_matrix(item.orientation[0, body]), atol=2.0 * HALF)
        turns = np.array(instancer.GetOrientationsAttr().Get(code), dtype=float)
        # scenery and hidden instances stay as authored, (x, y, z, w)
        np.testing.assert_allclose(turns[[1, 3]], [[0.0, 0.0, 0.8, 0.6], [0.0, 0.6, 0.0, 0.8]], atol=HALF)


def test_values_that_differ_from_the_file_are_in_the_run(tmp_path: Path) -> None:
    file = write_stage(tmp_path / "scene")
    values = {
        "/World/Group/cell.radius": 1.25,
        "/World/Crowd/Cell.radius": 1.5,
        "/World/Group/left.xformOp:translate": (-2.2, 0.1, 0.0),
        "/World/Traps/left.xformOp:translate": (-3.0, 1.0, 9.0),
        "/World/block.size": 1.0,
    }
    scene = Variations(file).scene(values)
    recording = record(scene, tmp_path / "run", [frame(scene, i) for i in range(40)])
    assert unlike_file(scene) == ""
    recording.flush()
    for whole in (False, True):
        if whole:
            recording.close()
        stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
        assert not stage.GetCompositionErrors()
        for code in (0.0, 17.25, 39.0):
            check(stage, scene, code)
        cell, block = (stage.GetPrimAtPath(path) for path in ("/World/Group/cell", "/World/block"))
        assert cell.GetAttribute("radius").Get() * UNIT == pytest.approx(1.25)
        radius = cell.GetAttribute("radius").Get()
        np.testing.assert_allclose(cell.GetAttribute("extent").Get(), [[-radius] * 3, [radius] * 3])
        assert block.GetAttribute("size").Get() * UNIT == pytest.approx(1.0)
        del stage, cell, block  # and with them the layers that they hold open
    again = Scene.load(tmp_path / "run" / "run.usda")
    assert [b.spheres[0].radius for b in again.bodies] == pytest.approx([b.spheres[0].radius for b in scene.bodies])


def test_what_no_file_says_how_to_show_is_named(scene: Scene, tmp_path: Path) -> None:
    cell = scene.bodies[2]
    larger = dataclasses.replace(cell, spheres=(dataclasses.replace(cell.spheres[0], radius=2.0),))
    dense = dataclasses.replace(cell, density=1234.0)
    for changed, said in ((larger, f"{cell.prim} shown as in {scene.file}"), (dense, "")):
        bodies = (*scene.bodies[:2], changed, *scene.bodies[3:])
        other = dataclasses.replace(scene, bodies=bodies)
        assert unlike_file(other).startswith(said) and bool(unlike_file(other)) == bool(said)
    with Recorder(dataclasses.replace(scene, bodies=(*scene.bodies[:2], larger, *scene.bodies[3:])), tmp_path / "run",
                  frames_per_second=RATE, held=HELD, time_step=1e-3) as recorder:  # fmt: skip
        recorder.write(frame(scene, 0))
    assert any(cell.prim in text for text in recorder.summary["warnings"])
