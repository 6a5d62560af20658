"""The benchmark of worlds fills its tables from real, tiny measurements."""

import json

from benchmarks import worlds


def test_it_reports_calls_ended_worlds_and_devices(device):
    tiny = {"calls": (1, 16), "many": 64, "shared": 32, "channels_of": (), "rounds": 1, "seconds": 2e-3}
    section = worlds.measure(device, devices=[device] * 3, **tiny)
    assert [len(table.rows) for table in section.tables] == [2, len(worlds.MOVING), 0, 2]
    assert [row[0] for row in section.tables[3].rows] == ["2", "3"]
    json.dumps(section.json(), allow_nan=False)
    assert f"`python -m benchmarks.worlds --devices {device} {device} {device}`" in section.markdown().splitlines()[0]
