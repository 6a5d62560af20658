"""The benchmark of contacts fills its tables from real, tiny measurements."""

import json

from benchmarks import contact


def test_it_reports_steps_and_residuals(device):
    section = contact.measure(device, worlds=(2,), steps=5, compared=2, rounds=1)
    assert [len(table.rows) for table in section.tables] == [2, 1]
    # what is out of balance moves no body by more than a thousandth of the radius, 0.46 µm
    assert 0.0 < section.data["residual"]["mean"] <= section.data["residual"]["largest"] < 1e-3
    json.dumps(section.json(), allow_nan=False)
