"""`otwarp scenes`: names, copies that nothing is lost for, and commands that take a name."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.shipped import ENDINGS, names, shipped
from otwarp.studies.file import load_study


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "list"]) == 0
    text = capsys.readouterr().out
    assert all(f"  {name} " in text for kind in ENDINGS for name in names(kind))
    assert main(["scenes", "list", "--json"]) == 0
    assert Path(json.loads(capsys.readouterr().out)["studies"]["capture"]["file"]).is_file()


def test_a_copy_replaces_nothing_unless_it_is_told_to(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "copy", "single_bead"]) == 0
    assert Path("single_bead.usda").read_bytes() == shipped("scenes", "single_bead").read_bytes()
    Path("single_bead.usda").write_text("mine")
    assert main(["scenes", "copy", "single_bead"]) == 2
    assert "single_bead.usda is there already; allowed: a new file, or --force" in capsys.readouterr().err
    assert Path("single_bead.usda").read_text() == "mine"
    assert main(["scenes", "copy", "single_bead", "--force"]) == 0 != len(Path("single_bead.usda").read_text()) - 4
    assert main(["scenes", "copy", "nix"]) == 2
    assert "NAME is nix, which is not shipped; allowed: cell_delivery (scene), " in capsys.readouterr().err
    assert main(["scenes", "copy", "captur"]) == 2
    said = capsys.readouterr().err
    assert "NAME is captur, which is not shipped; did you mean capture? allowed: " in said
    assert said.count("robot_hold") == 1 and "robot_hold (scene, study)" in said and "pair (data set)" in said
    assert [p.name for p in elsewhere.iterdir()] == ["single_bead.usda"]


def test_a_copied_study_brings_its_scene(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "copy", "capture", "-o", "mine.toml"]) == 0
    scene = elsewhere / "table_trap.usda"
    assert load_study(Path("mine.toml")).design.scene.file.resolve() == scene
    assert scene.read_bytes() == shipped("scenes", "table_trap").read_bytes()
    assert main(["scenes", "copy", "escape"]) == 0  # of the same scene, which stays
    scene.write_text("mine")
    assert main(["scenes", "copy", "transport"]) == 0
    assert main(["scenes", "copy", "capture"]) == 2
    assert "table_trap.usda is there already; allowed: a new file, or --force" in capsys.readouterr().err
    assert scene.read_text() == "mine" and not Path("capture.toml").exists()


@pytest.mark.parametrize("kind", ["studies", "vision"])
def test_every_copy_finds_its_scene(elsewhere: Path, kind: str) -> None:
    for name in names(kind):
        Path(name).mkdir()
        assert main(["scenes", "copy", name, "-o", f"{name}/{name}.toml"]) == 0
        for scene in re.findall(r'^scene = "(.+?)"', Path(name, f"{name}.toml").read_text(), re.MULTILINE):
            assert Path(name, scene).is_file()


@pytest.mark.thorough
def test_a_copied_study_runs(elsewhere: Path) -> None:
    assert main(["scenes", "copy", "capture"]) == 0
    text = Path("capture.toml").read_text().replace("count = 16", "count = 2").replace('"1 s"', '"2 ms"')
    Path("capture.toml").write_text(text.replace("half_width = 0.05\nat_most = 1024", "trials = 4"))
    assert main(["study", "run", "capture.toml"]) == 0
    assert main(["study", "show", "out/capture", "--json"]) == 0


def test_commands_take_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "single_bead"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["validate", "scenes/single_bead.usda"]) == 0
    assert "scenes/single_bead.usda is not here: the shipped one is taken" in capsys.readouterr().err
    assert main(["validate", "single_beat"]) == 2
    assert "or the name of a shipped one" in capsys.readouterr().err
