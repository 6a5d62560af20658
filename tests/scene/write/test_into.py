"""An obstacle is added to a scene's file, which stays as it was when anything is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.scene import Scene
from otwarp.scene.export.stage import export_in_metres
from otwarp.shipped import shipped

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("networkx")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    trimesh.creation.icosphere(subdivisions=2, radius=2.0).export("part 1.stl")
    Path("scene.usda").write_bytes(shipped("scenes", "single_bead").read_bytes())
    return tmp_path


def test_a_mesh_becomes_an_obstacle(capsys: pytest.CaptureFixture[str]) -> None:
    before = Scene.load("scene.usda")
    assert main(["import", "part 1.stl", "--into", "scene.usda", "--position", "9,0,4", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["prim"] == "part_1"
    after = Scene.load("scene.usda")
    (obstacle,) = after.obstacles
    assert (obstacle.prim, obstacle.shape, obstacle.double_sided) == ("/World/part_1", "mesh", False)
    np.testing.assert_allclose(obstacle.position.values, [[9.0, 0.0, 4.0]])
    np.testing.assert_allclose(np.linalg.norm(obstacle.vertices, axis=1), 2.0, rtol=1e-5)
    assert (after.bodies, after.traps, after.settings) == (before.bodies, before.traps, before.settings)


def test_a_scene_in_metres_gets_the_same(here: Path) -> None:
    export_in_metres("scene.usda", "metres.usda")
    assert main(["import", "part 1.stl", "--into", "metres.usda", "--position", "9,0,4", "-o", "more.usda"]) == 0
    (obstacle,) = Scene.load("more.usda").obstacles
    np.testing.assert_allclose(obstacle.position.values, [[9.0, 0.0, 4.0]], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(obstacle.vertices, axis=1), 2.0, rtol=1e-5)
    assert Scene.load("metres.usda").obstacles == ()


def test_nothing_is_lost(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("scene.usda").read_text()
    Path("other.usda").write_text("mine")
    into = ["import", "part 1.stl", "--into"]
    for arguments, said in (
        ([*into, "scene.usda", "--position", "0,0,9"], "overlap with /World/part_1"),
        ([*into, "scene.usda", "--name", "bead"], "/World/bead is there already; allowed: another --name, or --force"),
        ([*into, "scene.usda", "--name", "a.b"], "--name is a.b; allowed: letters, digits and _"),
        ([*into, "scene.usda", "--position", "1,2"], "--position is 1,2; allowed: X,Y,Z in µm"),
        ([*into, "scene.usda", "-o", "other.usda"], "other.usda is there already; allowed: a new file, or --force"),
        ([*into, "none.usda"], "--into is none.usda, which is no file"),
        ([*into, "part 1.stl"], "suffix = .stl; allowed: .usda, .usdc, .usd"),
        (["import", "part 1.stl", "-o", "new.usda"], "--out is new.usda; allowed with --into SCENE"),
    ):
        assert main(arguments) == 2
        assert said in capsys.readouterr().err, arguments
    assert Path("scene.usda").read_text() == text and Path("other.usda").read_text() == "mine"
    assert {p.name for p in here.iterdir()} == {"scene.usda", "other.usda", "part 1.stl"}
