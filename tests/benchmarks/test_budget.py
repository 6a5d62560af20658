"""The table of budgets: a tiny real measurement, no claim about speed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from benchmarks import budget
from benchmarks.report import PAGES, put_on_page, save_json


def test_a_budget_becomes_a_row(tmp_path: Path):
    section = budget.measure("cpu", cases=(("single_bead", ("auto", 1e-4)),), seconds=0.01)
    file = tmp_path / "numbers.json"
    save_json(file, [section])
    data = json.loads(file.read_text())["budget"]
    assert data["single_bead auto"]["fits"] and not data["single_bead auto"]["reduced"]
    assert data["single_bead 0.0001"]["speed"] < 1.0
    assert [row[0] for row in section.tables[0].rows] == ["`single_bead`"] * 2
    assert "single_bead" in put_on_page((PAGES / "budget.md").read_text(), section)


def test_the_bead_of_the_crowd_has_room():
    scene = budget.crowd_with_trap()
    place = np.array([b.position for b in scene.bodies])
    assert np.linalg.norm(place[1:] - place[0], axis=1).min() > budget.ROOM
    assert np.linalg.norm(scene.traps[0].position.values[0] - place[0]) < 1.0
