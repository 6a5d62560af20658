"""Copies in metres and of meshes: the same scene, seen by the same cameras."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene import Scene, export_in_metres, export_stage
from otwarp.scene.drawing.draw_list import MESH
from otwarp.scene.drawing.drawables import read_drawables
from otwarp.scene.read.validate import validate
from otwarp.scene.recording.usd import UsdRecording
from tests.record.small_run import HELD, RATE, frame, load
from tests.scene.conftest import StageFile
from tests.scene.write.test_builder import full_builder

RELATIVE = 1e-9
"""Float64 through a scale of 1e-6 and back, with room."""


def assert_close(a: object, b: object, where: str = "scene") -> None:
    """Compare two scenes number by number."""
    assert type(a) is type(b), where
    if dataclasses.is_dataclass(a):
        for field in dataclasses.fields(a):
            if field.compare:
                assert_close(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, tuple):
        assert isinstance(b, tuple) and len(a) == len(b), where
        for index, pair in enumerate(zip(a, b, strict=True)):
            assert_close(*pair, f"{where}[{index}]")
    elif isinstance(a, float | np.ndarray):
        assert a == pytest.approx(b, rel=RELATIVE, abs=RELATIVE), where
    else:
        assert a == b, where


def test_the_scene_stays_the_same(tmp_path: Path) -> None:
    native = full_builder().save(tmp_path / "scene.usdc")
    metres = export_in_metres(native, tmp_path / "metres.usda")
    assert "metersPerUnit = 1\n" in metres.read_text()
    assert_close(Scene.load(metres), Scene.load(native))
    assert validate(metres).findings == ()


def test_world_lengths_are_metres_and_cameras_see_the_same(tmp_path: Path) -> None:
    from pxr import Gf, Usd, UsdGeom

    native = full_builder().save(tmp_path / "scene.usda")
    stages = [Usd.Stage.Open(str(path)) for path in (native, export_in_metres(native, tmp_path / "metres.usda"))]
    paths = [prim.GetPath() for prim in stages[0].Traverse() if prim.IsA(UsdGeom.Boundable)]
    assert len(paths) > 10
    for path in paths:
        boxes = [UsdGeom.BBoxCache(0.0, ["default"]).ComputeWorldBound(s.GetPrimAtPath(path)) for s in stages]
        small, large = (np.array(b.ComputeAlignedRange().GetSize()) for b in reversed(boxes))
        assert small == pytest.approx(1e-6 * large, rel=1e-6)
    views = [UsdGeom.Camera(s.GetPrimAtPath("/World/View")).GetCamera(0.0) for s in stages]
    fields = [view.GetFieldOfView(Gf.Camera.FOVHorizontal) for view in views]
    assert fields[1] == pytest.approx(fields[0], rel=1e-6)
    assert views[1].focusDistance == pytest.approx(1e-6 * views[0].focusDistance, rel=1e-6)
    assert views[1].clippingRange.max == pytest.approx(1e-6 * views[0].clippingRange.max, rel=1e-6)
    eyes = [np.array(view.transform.ExtractTranslation()) for view in views]
    assert eyes[1] == pytest.approx(1e-6 * eyes[0], rel=1e-9)
    assert np.linalg.det(np.array(views[1].transform)[:3, :3]) == pytest.approx(1.0, rel=1e-9)


def test_reset_stacks_and_scopes(stage_file: StageFile) -> None:
    path = stage_file.write(
        ('def Xform "World"', 'def Scope "World"'),
        (
            '["xformOp:translate"]\n    }\n\n    def Cube',
            '["!resetXformStack!", "xformOp:translate"]\n    }\n\n    def Cube',
        ),
    )
    out = export_in_metres(path, stage_file.folder / "metres.usda")
    assert_close(Scene.load(out), Scene.load(path))


def test_bad_files(stage_file: StageFile) -> None:
    folder = stage_file.folder
    with pytest.raises(InputError, match=r"none.usda: there is no such file"):
        export_in_metres(folder / "none.usda", folder / "out.usda")
    with pytest.raises(InputError, match="metersPerUnit = 0"):
        export_in_metres(stage_file.write(("metersPerUnit = 1e-6", "metersPerUnit = 0")), folder / "out.usda")
    assert not (folder / "out.usda").exists()


def test_meshes_have_the_colours_and_the_sizes_of_what_they_stand_for(tmp_path: Path) -> None:
    scene = Path(__file__).parents[3] / "scenes" / "cell_delivery.usda"
    shapes, meshes = (read_drawables(file) for file in (scene, export_stage(scene, tmp_path / "m.usdc", meshes=True)))
    assert set(meshes.kind.tolist()) == {MESH}
    rows = [np.concatenate([*d.bounds(), d.colour, d.opacity[:, None]], axis=1) for d in (shapes, meshes)]
    # a plane that bounds the liquid has no edge; as a mesh it has
    rows[0] = np.where(np.isinf(rows[0]), np.sign(rows[0]) * 100.0, rows[0])
    distance = np.abs(rows[0][:, None] - rows[1]).max(axis=2)
    assert sorted(distance.argmin(axis=1)) == list(range(len(shapes)))
    # 32 flat sides: a turned circle of 10 µm may miss its extreme by 10·(1 − cos(π/32))
    assert distance.min(axis=1).max() < 0.05


def test_a_run_in_metres_moves_a_millionth_as_far(tmp_path: Path) -> None:
    scene = load(tmp_path / "scene")
    (tmp_path / "run").mkdir()
    recording = UsdRecording(scene, frames_per_second=RATE, held=HELD)
    recording.begin(tmp_path / "run")
    for index in range(5):
        recording.write(frame(scene, index))
    recording.close()
    run = tmp_path / "run" / "run.usda"
    metres = export_stage(run, tmp_path / "metres.usda", metres=True)
    stages = [Usd.Stage.Open(str(file)) for file in (run, metres)]
    assert UsdGeom.GetStageMetersPerUnit(stages[1]) == 1.0
    assert stages[1].GetFramesPerSecond() == stages[1].GetTimeCodesPerSecond() == RATE
    assert (stages[1].GetStartTimeCode(), stages[1].GetEndTimeCode()) == (0.0, 4.0)
    for prim in ("/World/Group/left", "/World/Crowd", "/World/Traps/right", "/World/block"):
        for code in (0.0, 3.0):
            micro, metre = (
                UsdGeom.XformCache(code).GetLocalToWorldTransform(s.GetPrimAtPath(prim)).ExtractTranslation()
                for s in stages
            )
            # the stage of the run has units of 0.5 µm
            np.testing.assert_allclose(np.array(metre), 0.5e-6 * np.array(micro), rtol=RELATIVE, atol=1e-18)
    for code in (0.0, 3.0):
        a, b = (np.concatenate(read_drawables(stage, code).bounds(), axis=1) for stage in stages)
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-5)
