"""What `otwarp validate` says of a scene that is drawn."""

from __future__ import annotations

import queue
from pathlib import Path

import pytest

from otwarp.scene import Scene, SceneBuilder, Settings
from otwarp.scene.finding import Finding
from otwarp.view import remarks as remarks_module
from otwarp.view.remarks import MOST_SHOWN, Remarks, as_html, judged
from tests.view.runs import SCENE


def test_the_newest_scene_is_judged_as_validate_does(tmp_path: Path):
    dark = SceneBuilder(settings=Settings(duration=1.0))
    dark.add_cell("/World/cell", (0.0, 0.0, 5.0), 2.0)
    dark.save(tmp_path / "dark.usda")
    scene, answers = Scene.load(tmp_path / "dark.usda"), queue.SimpleQueue()
    remarks = Remarks(answers.put)
    for _ in range(5):
        remarks.ask(scene)
    found = answers.get(timeout=60.0)
    remarks.close()
    assert list(found) == judged(scene, tmp_path / "dark.usda")
    assert any("no light" in remark.message for remark in found)
    assert answers.qsize() <= 4  # those that were overtaken are passed over


def test_a_judge_that_breaks_is_told_and_judges_the_next(monkeypatch: pytest.MonkeyPatch):
    scene, answers = Scene.load(SCENE), queue.SimpleQueue()
    with monkeypatch.context() as broken:
        broken.setattr(remarks_module, "check_run", lambda scene: [][1])
        remarks = Remarks(answers.put)
        remarks.ask(scene)
        assert "IndexError" in answers.get(timeout=60.0)[0].message
    remarks.ask(scene)
    assert answers.get(timeout=60.0) == []
    remarks.close()


def test_a_scene_of_ours_needs_no_remark():
    assert judged(Scene.load(SCENE), SCENE) == []
    assert "nothing" in as_html([], light=False)


def test_findings_are_shown_errors_first_and_not_without_end():
    found = [Finding(prim="/World/<b>", message="no light")] * MOST_SHOWN
    shown = as_html([*found, Finding(severity="error", prim="/", message="bad")], light=True)
    assert shown.index("bad") < shown.index("no light") and "and 1 more" in shown
    assert "&lt;b&gt;" in shown and "<b>:" not in shown
