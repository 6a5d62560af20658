"""The tables of haptics: what runs on a virtual clock is checked, what needs the machine's is only there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import haptics
from benchmarks.report import PAGES, put_on_page, save_json
from otwarp.haptics.check.zwidth import Width

WANTED = 0.999
"""R² at servo rate, as in the tests of the chain."""


@pytest.mark.parametrize("axis", ["axial", "radial"])
def test_the_force_follows_its_model(axis: str):
    assert haptics.fidelity(axis, 0.2, quantum=0.0, sweeps=1.0) >= WANTED


def test_r2_is_one_for_the_model_and_less_for_a_lag():
    model = [0.1 * n for n in range(20)]
    assert haptics.determination(model, model) == 1.0
    assert haptics.determination([0.0, *model[:-1]], model) < 1.0


def test_all_tables_go_to_the_page(monkeypatch, tmp_path: Path):
    rows = (Width("bare", 400.1, False, 400.0, "2b/T"), Width("stable", 20_000.0, True, None, ""))
    monkeypatch.setattr(haptics, "widths", lambda: rows)
    monkeypatch.setattr(haptics, "chain_width", lambda chain, *, high, wall, **how: high if wall else 0.5 * high)
    section = haptics.measure("cpu", seconds=0.1, speeds=(0.2,), steps=10, tables=dict)
    file = tmp_path / "numbers.json"
    save_json(file, [section])
    data = json.loads(file.read_text())["haptics"]
    assert data["latency"]["cycles"] == 100
    assert data["width"]["stable"] == {"spring": 100_000.0, "wall": 200_000.0}
    assert [len(table.rows) for table in section.tables] == [4, 2, 6, 4, 2, 2, 11]
    forces = data["forces"].values()
    assert all(one["law"] == "compiled" and one["compiled"]["p50"] < one["in Python"]["p50"] for one in forces)
    assert "≥ 200000" in put_on_page((PAGES / "haptics.md").read_text(), section)
