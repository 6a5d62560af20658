"""The benchmark of environments fills its tables from real, tiny measurements."""

import json

import pytest

pytest.importorskip("gymnasium")

from benchmarks import envs
from otwarp.envs.registration import task_of
from otwarp.errors import InputError
from otwarp.simulation import Simulation


def test_it_reports_steps_and_what_they_add(device):
    section = envs.measure(device, worlds=(1, 4), rounds=1, seconds=1e-3)
    tasks = [name for name in envs.MEASURED if name in envs.TASKS]
    assert [len(table.rows) for table in section.tables] == [2 * len(tasks), 2 * len(tasks)]
    json.dumps(section.json(), allow_nan=False)
    assert "stood still" not in section.tables[0].markdown()


def test_bare_worlds_that_stand_still_are_counted_and_many_refused(device):
    """Worlds count, not bodies; the note names rows that have some."""
    sim = Simulation(task_of("otwarp/CellDelivery-v0").load(), worlds=40, device=device)
    fault = sim.last_readout.fault.numpy()
    fault[3:5] = 1
    sim.last_readout.fault.assign(fault)
    assert fault.shape[1] > 1
    assert envs.few_standing("a task", sim) == 2
    fault[5, 0] = 1
    sim.last_readout.fault.assign(fault)
    with pytest.raises(InputError, match="3 of 40 bare worlds of a task have a fault"):
        envs.few_standing("a task", sim)
    rows = {"a task": {40: {"still": 2}, 1: {"still": 0}}}
    assert envs.told_standing(rows) == " Of the 40 bare worlds of `a task` up to 2 stood still after a fault."
