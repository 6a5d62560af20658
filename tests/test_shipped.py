"""Shipped files are found by name, and every one says what it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.shipped import ENDINGS, SCENES, about, find, named, names, shipped

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize(("kind", "ending"), ENDINGS.items())
def test_every_shipped_file_has_a_name_and_a_sentence(kind: str, ending: str) -> None:
    files = {file.stem: file for file in (ROOT / kind).glob(f"*{ending}")}
    assert names(kind) == sorted(files)
    assert kind != "scenes" or set(SCENES) == set(files)
    for name, file in files.items():
        assert shipped(kind, name) == file
        text = about(kind, name)
        assert text[-1] in ".?" and "`" not in text and 20 < len(text) < 180, text


def test_files_of_the_user_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    there = ROOT / "scenes" / "single_bead.usda"
    for said in ("single_bead", "single_bead.usda", "scenes/single_bead.usda", "./single_bead"):
        assert find("scenes", said) == there, said
    for said in ("single", "other/single_bead.usda", "single_bead.toml", "../scenes/single_bead.usda", "capture"):
        assert named("scenes", said) is None and find("scenes", said) == Path(said)
    assert find("scenes", "../scenes/table_trap.usda", beside=ROOT / "studies").resolve().parent == ROOT / "scenes"
    (tmp_path / "single_bead").mkdir()  # as the folder of a run
    assert find("scenes", "single_bead") == there
    (tmp_path / "single_bead.usda").write_text("mine")
    assert find("scenes", "single_bead.usda") == Path("single_bead.usda")


def test_a_name_is_enough_to_load_and_a_wrong_one_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(Scene.load("single_bead").traps) == 1
    with pytest.raises(InputError, match=r"^nix: is none of the shipped scenes; allowed: cell_delivery, "):
        shipped("scenes", "nix")


@pytest.mark.parametrize("said", [3, None, b"single_bead"])
def test_what_is_no_path_is_refused_in_a_line(said: object) -> None:
    with pytest.raises(InputError, match=r"^file of scenes is \S+; allowed: a path, or the name of a shipped one$"):
        Scene.load(said)  # type: ignore[arg-type]
