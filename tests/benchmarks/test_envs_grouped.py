"""The benchmark of environments whose scenes differ fills its table from real, tiny measurements."""

import json

import pytest

pytest.importorskip("gymnasium")

from benchmarks import envs_grouped


def test_it_reports_several_models_beside_one(device, monkeypatch):
    monkeypatch.setattr(envs_grouped, "SIZES", ((2, 3),))
    section = envs_grouped.measure(device, rounds=1, seconds=1e-3)
    (row,) = section.tables[0].rows
    assert row[:2] == ("2", "3")
    assert section.data["2 models, 3"]["over"]["median"] > 0.0 and section.data["2 models, 3"]["built"] > 0.0
    json.dumps(section.json(), allow_nan=False)
