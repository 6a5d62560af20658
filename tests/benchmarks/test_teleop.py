"""The tables of live sessions at tiny sizes; what is on the virtual clock is held in teleop/session/test_drag.py."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks import teleop
from benchmarks.report import PAGES, put_on_page, save_json


def test_both_tables_go_to_the_page(tmp_path: Path):
    section = teleop.measure(
        "cpu", scenes=("ten_thousand_cells",), recorded="teleop_small", seconds=0.3, still=1.0, noisy=1.0
    )
    file = tmp_path / "numbers.json"
    save_json(file, [section])
    data = json.loads(file.read_text())["teleop"]
    crowd, taken = data["sessions"]["ten_thousand_cells"], data["sessions"]["teleop_small recorded"]
    assert crowd["hands"] == 0 and crowd["servo"] is None and crowd["bodies"] == 10_000
    assert taken["hands"] == 2 and taken["servo"]["cycles"] > 0 and taken["recorded"]
    for one in (crowd, taken):
        assert 0.0 < one["tick"]["p50"] <= one["tick"]["p99"] <= one["tick"]["max"]
        assert one["real_time_factor"] > 0.0 and 0.0 < one["busy"] <= 1.0
    assert [len(table.rows) for table in section.tables] == [10, 2]
    assert len(data["drag"]) == 10
    assert "| glides, predicted, no noise | 1.0" in put_on_page((PAGES / "teleop.md").read_text(), section)


def test_thermal_force_is_that_of_equipartition():
    scene = teleop.bead_in_trap(brownian=True)
    # √(k_BT·k) of 10 pN/µm at room temperature: 20 nm
    assert 0.19 < teleop.thermal_force_squared(scene) ** 0.5 < 0.21
