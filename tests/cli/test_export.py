"""`otwarp export`: the right kind of file for each ending, and one line for what cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

from otwarp.cli.main import main

SCENE = str(Path(__file__).parents[2] / "scenes" / "single_bead.usda")


def test_the_ending_says_what_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for name, options in ("a.usda", ["--meters"]), ("b.usdc", ["--meshes"]), ("c.glb", ["--fps", "10"]):
        assert main(["export", SCENE, "-o", str(tmp_path / name), *options]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"wrote {tmp_path / name}" for name in ("a.usda", "b.usdc", "c.glb")
    ]
    assert UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(str(tmp_path / "a.usda"))) == 1.0
    assert Usd.Stage.Open(str(tmp_path / "b.usdc")).GetPrimAtPath("/World/bead/sphere").GetTypeName() == "Mesh"
    assert (tmp_path / "c.glb").read_bytes()[:4] == b"glTF"


@pytest.mark.parametrize(
    "options, words",
    [
        (["-o", "{folder}/run.obj"], "allowed: a file that ends in .usda, .usdc, .usd or .glb"),
        (["-o", "{folder}/run.glb", "--meshes"], "--meshes with a glTF (.glb) file means nothing"),
        (["-o", "{folder}/run.usdc", "--fps", "5"], "--fps with a USD file means nothing"),
        (["-o", "{folder}/run.glb", "--fps", "0"], "--fps is 0; allowed: above 0"),
        (["-o", SCENE], "which is what is exported; allowed: another file"),
    ],
)
def test_bad_input_is_one_line(options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    before = Path(SCENE).read_bytes()
    assert main(["export", SCENE, *(option.format(folder=tmp_path) for option in options)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())
    assert Path(SCENE).read_bytes() == before


def test_a_folder_without_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["export", str(tmp_path), "-o", str(tmp_path / "run.glb")]) == 2
    assert "no run.usda in this folder" in capsys.readouterr().err
