"""`otwarp new`: templates that validate and run, and replace nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.cli.validate import SLOW
from otwarp.scene import Scene
from otwarp.shipped import TEMPLATES
from otwarp.studies.file import load_study

SCENES = [kind for kind, file in TEMPLATES.items() if file.endswith(".usda")]


@pytest.mark.quick
@pytest.mark.parametrize("kind", TEMPLATES)
def test_a_template_is_valid_and_replaces_nothing(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / f"mine{Path(TEMPLATES[kind]).suffix}"
    assert main(["new", kind, str(file)]) == 0
    capsys.readouterr()
    text = file.read_text()
    assert "\n# " in text or text.startswith("# "), "comments lead through it"
    if kind == "study":
        assert load_study(file).plan().points == 16
    else:
        assert main(["validate", str(file)]) == 0
        # a computer that others use takes long enough to say so
        assert capsys.readouterr().err.replace(f"otwarp: {SLOW}\n", "") == "", "no warnings"
        assert Scene.load(file).camera is not None, "a microscope sees it"
    file.write_text("mine")
    assert main(["new", kind, str(file)]) == 2
    assert "is there already; allowed: a new file, or --force to replace it" in capsys.readouterr().err
    assert file.read_text() == "mine"
    assert main(["new", kind, str(file), "--force"]) == 0 and file.read_text() == text
    assert main(["new", kind, str(tmp_path / "mine.txt")]) == 2
    assert "allowed: a name that ends in" in capsys.readouterr().err


def test_what_to_do_next_can_be_pasted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "robot", "my köder.usda"]) == 0
    assert "next   otwarp run 'my köder.usda'\n" in capsys.readouterr().out


@pytest.mark.parametrize("kind", SCENES)
def test_a_template_runs_and_loses_nothing(kind: str, tmp_path: Path, device: str) -> None:
    file, out = tmp_path / "mine.usda", tmp_path / "out"
    assert main(["new", kind, str(file)]) == 0
    assert main(["run", str(file), "--out", str(out), "--device", device]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["duration_s"] == pytest.approx(Scene.load(file).settings.duration)
