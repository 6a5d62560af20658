"""`otwarp scenes`: names, copies that nothing is lost for, and commands that take a name."""

from __future__ import annotations

import json
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
    assert "NAME is nix, which is not shipped; allowed: cell_delivery, " in capsys.readouterr().err
    assert [p.name for p in elsewhere.iterdir()] == ["single_bead.usda"]


def test_a_copied_study_finds_its_scene(elsewhere: Path) -> None:
    assert main(["scenes", "copy", "capture", "-o", "mine.toml"]) == 0
    assert load_study(Path("mine.toml")).design.scene.file == shipped("scenes", "table_trap")


def test_commands_take_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "single_bead"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["validate", "scenes/single_bead.usda"]) == 0
    assert "scenes/single_bead.usda is not here: the shipped one is taken" in capsys.readouterr().err
    assert main(["validate", "single_beat"]) == 2
    assert "or the name of a shipped one" in capsys.readouterr().err
