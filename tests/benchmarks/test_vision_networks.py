"""The benchmark of networks fills its tables from real, tiny trainings."""

import json
from pathlib import Path

import pytest

from benchmarks import vision_networks


def test_it_reports_splits_bounds_photons_and_run_times(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("onnxruntime")
    tiny = {"small": {"net": "small", "epochs": 1, "batch": 32}}
    section = vision_networks.measure("cpu", folder=tmp_path / "work", runs=tiny, devices=("cpu", "cpu"))
    assert [len(table.rows) for table in section.tables] == [6, 4, 4, 3, 2, 3]
    json.dumps(section.json(), allow_nan=False)
    assert "`python -m benchmarks.vision_networks --devices cpu cpu`" in section.markdown().splitlines()[0]
