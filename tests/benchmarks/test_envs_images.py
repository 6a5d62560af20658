"""The benchmark of images as observations fills its table from real, tiny measurements."""

import json

import pytest

pytest.importorskip("gymnasium")

from benchmarks import envs_images


def test_it_reports_images_beside_steps(device, monkeypatch):
    monkeypatch.setattr(envs_images, "SIZES", ((16, 1), (16, 2)))
    monkeypatch.setattr(envs_images, "MEASURED", ("otwarp/Push-v0",))
    monkeypatch.setattr(envs_images, "DRAWN", ("otwarp/Push-v0",))
    monkeypatch.setattr(envs_images, "PICTURE_SIZES", ((24, 18),))
    section = envs_images.measure(device, rounds=1)
    assert [row[1:4] for row in section.tables[0].rows] == [("16 × 16", "1", "2.56"), ("16 × 16", "2", "5.12")]
    assert section.tables[1].rows[0][:2] == ("`otwarp/Push-v0`", "24 × 18")
    assert section.data.pop("picture otwarp/Push-v0 24")["median"] > 0.0
    for found in section.data.values():
        assert found["image"]["median"] > 0.0 and found["step"]["median"] > 0.0
    json.dumps(section.json(), allow_nan=False)
