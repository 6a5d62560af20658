"""The benchmark of simulated operators measures them at work: a tiny size, no claim about speed."""

from __future__ import annotations

import json

from benchmarks import operators


def test_it_reports_speed_and_parts(device):
    section = operators.measure(device, rounds=1, operators=(2,))
    assert [len(table.rows) for table in section.tables] == [1, 5, 4]
    assert all(row["median"] > 0.0 for row in section.data["parts"].values())
    json.dumps(section.json(), allow_nan=False)
    assert operators.loop_of(2, device).running == 2  # nobody is done when the measurement begins
