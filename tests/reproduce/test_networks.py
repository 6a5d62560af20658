"""The networks' table: its plans, what it says without torch, and a tiny one end to end where torch is."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from otwarp.cli.main import main
from otwarp.errors import PlausibilityWarning
from otwarp.reproduce.item import Request, Result
from otwarp.reproduce.items import networks
from otwarp.reproduce.items.networks_plan import FULL, QUICK, Plan, settings_of, write_layout
from otwarp.vision.datasets import load_spec
from otwarp.vision.networks import Settings

SCENE = Path("scenes/strategy_b.usda")


def test_the_full_layout_is_the_shipped_one(tmp_path: Path):
    ours = load_spec(write_layout(FULL, SCENE, tmp_path / "data.toml"))
    shipped = load_spec("vision/paper.toml")
    assert ours.described() == shipped.described()
    assert ours.count * len(ours.classes) == 5700


def test_the_full_plan_is_the_published_recipe():
    for name in ("vgg16", "resnet18", "resnet50"):
        how = settings_of(FULL, name, split="random", seed=0)
        assert (how.heads, how.schedule, how.epochs, how.batch, how.augment) == ("paper", "step", 20, 32, False)
    assert FULL.seeds == 5
    assert QUICK.layout["width"] * QUICK.layout["pixel"] == pytest.approx(FULL.layout["width"] * FULL.layout["pixel"])


def test_without_torch_the_item_is_left_out(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setitem(sys.modules, "torch", None)
    words = ["reproduce", "--out", str(tmp_path), "--quick", "--device", "cpu", "--only", "networks"]
    assert main(words) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert "install otwarp[vision]" in said[-1] and "--only is networks" in said[-1]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Not computed: networks need torch" in page


def tiny(monkeypatch: pytest.MonkeyPatch, epochs: int) -> None:
    """A table of few images and one small network, in place of the quick one."""
    pytest.importorskip("torch")
    layout = {**QUICK.layout, "tilts": 3, "count": 8, "random": [4, 2, 2], "blocks": 4, "gap": 0}
    how = {**QUICK.networks["small"], "epochs": epochs}
    plan: Plan = dataclasses.replace(QUICK, layout=layout, networks={"small": how}, ablation="small")
    monkeypatch.setattr(networks, "QUICK", plan)


def asked(place: Path, say: Callable[[str], None] = lambda line: None) -> Request:
    """What the runner asks of the item, for folders at a place."""
    folders = [place / "item", place / "work"]
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
    return Request(quick=True, device="cpu", scenes=Path("scenes"), seed=0, folder=folders[0], work=folders[1], say=say)


def test_a_tiny_table_end_to_end(tmp_path: Path, monkeypatch, recwarn):
    tiny(monkeypatch, epochs=1)
    request = asked(tmp_path)
    folders = [request.folder, request.work]
    found = networks.run(request)
    rows = found.numbers["small, random, right"]
    assert rows[0]["test"]["images"] == 6 and Settings.read(rows[0]["settings"]).size == 64
    assert {f.file for f in found.figures} == {p.name for p in folders[0].iterdir()}
    assert not list(folders[1].rglob("*.pt")), "weights do not stay"
    assert found.comparisons[0].ours.said() == "not in a quick report"
    assert not [w for w in recwarn if issubclass(w.category, PlausibilityWarning)], "the report says what is too few"


def without_times(result: Result) -> dict[str, Any]:
    """Numbers of a table, other than how long it took."""
    rows = {name: [dict(row) for row in rows] for name, rows in result.numbers.items()}
    for row in (row for some in rows.values() for row in some):
        del row["training_seconds"], row["images_per_second"]
    return rows


def test_a_table_that_was_cut_is_that_of_one_go(tmp_path: Path, monkeypatch):
    """Cut while images are rendered and within trainings; what is brought elsewhere lacks images and weights."""
    tiny(monkeypatch, epochs=2)
    whole = without_times(networks.run(asked(tmp_path / "whole")))
    for line in ("images of pose 1", "training small_random_0, epoch 1", "training small_broadcast, epoch 1"):

        def cut(said: str, line: str = line) -> None:
            if said.startswith(line):
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            networks.run(asked(tmp_path / "cut", cut))
    begun = []
    shutil.rmtree(tmp_path / "cut" / "work" / "data")
    for file in (tmp_path / "cut").rglob("*.pt"):
        file.unlink()
    assert without_times(networks.run(asked(tmp_path / "cut", begun.append))) == whole
    assert [line for line in begun if line.startswith("training")] == [
        "training small_broadcast, epoch 1 of 2",
        "training small_broadcast, epoch 2 of 2",
    ]
