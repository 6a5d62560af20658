"""The benchmark of environments fills its tables from real, tiny measurements."""

import json

import pytest

pytest.importorskip("gymnasium")

from benchmarks import envs


def test_it_reports_steps_and_what_they_add(device):
    section = envs.measure(device, worlds=(1, 4), rounds=1, seconds=1e-3)
    tasks = [name for name in envs.MEASURED if name in envs.TASKS]
    assert [len(table.rows) for table in section.tables] == [2 * len(tasks), 2 * len(tasks)]
    json.dumps(section.json(), allow_nan=False)
