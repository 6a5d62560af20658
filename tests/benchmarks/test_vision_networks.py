"""The benchmark of networks fills its tables from real, tiny trainings."""

import json
from pathlib import Path

import pytest

from benchmarks import vision_networks

TINY = {"small": {"net": "small", "epochs": 1, "batch": 32}}


def test_it_reports_splits_bounds_photons_and_run_times(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("onnxruntime")
    section = vision_networks.measure("cpu", folder=tmp_path / "work", runs=TINY, devices=("cpu", "cpu"))
    assert [len(table.rows) for table in section.tables] == [6, 10, 3, 4, 8, 4, 3, 2, 1, 3]
    json.dumps(section.json(), allow_nan=False)
    assert "`python -m benchmarks.vision_networks --devices cpu cpu`" in section.markdown().splitlines()[0]


PAPERS = {"resnet18": {"net": "resnet18", "heads": "paper", "schedule": "step", "epochs": 1, "batch": 32, "size": 32}}
"""Of the first network of the full table: no pose."""


@pytest.mark.validate
def test_the_full_tables_are_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("onnxruntime")
    text = (vision_networks.SPECS / "smoke.toml").read_text(encoding="utf-8")
    (tmp_path / "paper.toml").write_text(text, encoding="utf-8")
    (tmp_path / "shifted.toml").write_text(text.replace("seed = 7", "seed = 8"), encoding="utf-8")
    monkeypatch.setattr(vision_networks, "SPECS", tmp_path)
    runs = PAPERS | {"small, pose": TINY["small"]}
    section = vision_networks.measure("cpu", full=True, folder=tmp_path / "work", runs=runs, devices=("cpu", "cpu"))
    assert section.tables[2].title == "Other optics, other robots"
    assert [len(table.rows) for table in section.tables] == [8, 5, 4, 3, 4, 10, 4, 3, 2, 2, 4]
    json.dumps(section.json(), allow_nan=False)


def test_the_speed_is_printed_alone() -> None:
    pytest.importorskip("torch")
    section = vision_networks.measure("cpu", rounds=2, speed=True, runs=TINY)
    trained, looked = section.tables
    assert [row[:2] for row in trained.rows] == [("small", "16")]
    assert len(looked.rows) == 2
    assert len(section.data["training small 16"]["shipped"]) == 2
    assert min(section.data["training small 16"]["bare"]) > 0.0
    assert "`python -m benchmarks.vision_networks --speed --rounds 2`" in section.markdown().splitlines()[0]
