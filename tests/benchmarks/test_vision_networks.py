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
    assert [len(table.rows) for table in section.tables] == [6, 4, 4, 3, 2, 1, 3]
    json.dumps(section.json(), allow_nan=False)
    assert "`python -m benchmarks.vision_networks --devices cpu cpu`" in section.markdown().splitlines()[0]


def test_the_speed_of_training_is_printed_alone() -> None:
    pytest.importorskip("torch")
    section = vision_networks.measure("cpu", rounds=2, speed=True, runs=TINY)
    (table,) = section.tables
    assert [row[:2] for row in table.rows] == [("small", "16")]
    assert len(section.data["training small 16"]["shipped"]) == 2
    assert min(section.data["training small 16"]["bare"]) > 0.0
    assert "`python -m benchmarks.vision_networks --speed --rounds 2`" in section.markdown().splitlines()[0]
