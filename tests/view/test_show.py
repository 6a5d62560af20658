"""What `otwarp edit` proposes to write, and refuses before anything is drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.shipped import shipped

pytest.importorskip("viser")

from otwarp.view import ServeOptions, edit_scene
from otwarp.view.edit_page import EditPage


def test_a_scene_is_proposed_beside_it_and_a_shipped_one_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "sub" / "mine.usda"
    mine.parent.mkdir()
    mine.write_bytes(shipped("scenes", "single_bead").read_bytes())
    proposed: list[Path] = []
    init = EditPage.__init__

    def noted(self, server, editor, out, theme):
        proposed.append(out)
        init(self, server, editor, out, theme)

    monkeypatch.setattr(EditPage, "__init__", noted)
    for scene in (mine, shipped("scenes", "single_bead")):
        edit_scene(scene, ServeOptions(port=0), say=lambda line: None, stopped=lambda: True)
    assert proposed == [mine.with_name("mine_edited.usda"), Path("single_bead_edited.usda")]


def test_a_place_that_cannot_be_written_is_refused_before_one_draws(tmp_path: Path):
    scene = shipped("scenes", "single_bead")
    with pytest.raises(InputError, match=r"what is to be saved is /proc/a\.usda, which cannot be written"):
        edit_scene(scene, ServeOptions(port=0), out=Path("/proc/a.usda"), stopped=lambda: True)
