"""The benchmark of longer trainings fills its table from real, tiny ones."""

import json

import pytest

from benchmarks import vision_longer, vision_networks


def test_it_reports_a_row_for_each_training():
    pytest.importorskip("torch")
    epochs = {"small, pose": (1, 2)}
    section = vision_longer.measure("cpu", rounds=2, spec=vision_networks.SPECS / "smoke.toml", epochs=epochs)
    (table,) = section.tables
    assert [row[:2] for row in table.rows] == [("small, pose", "1"), ("small, pose", "2")]
    assert "`python -m benchmarks.vision_longer`" in section.markdown().splitlines()[0]
    json.dumps(section.json(), allow_nan=False)
