"""The benchmark of contacts fills its tables from real, tiny measurements."""

import json

import pytest

from benchmarks import contact
from otwarp.simulation import model


@pytest.fixture(scope="module")
def section(device):
    return contact.measure(
        device,
        worlds=(2,),
        steps=5,
        compared=2,
        rounds=1,
        channels=1,
        length=0.02,
        parts=2,
        moduli=list(contact.MODULI)[:1],
    )


def test_it_reports_steps_solvers_and_a_channel(section):
    assert [len(table.rows) for table in section.tables] == [2, 3, 2]
    json.dumps(section.json(), allow_nan=False)
    ends = [part["until"] for part in section.data["channel"]]
    assert 0.0 < ends[0] < ends[1] == pytest.approx(2.0 * ends[0], rel=0.1)
    assert all(part["time"] > 0.0 and 0.0 <= part["touching"] <= 201.0 for part in section.data["channel"])


def test_each_solver_keeps_to_the_exact_one_and_none_fails(section):
    """What is out of balance moves no body by more than a thousandth of the radius, 0.46 µm."""
    found = section.data["solvers"]
    assert len(found) == 3
    assert all(0.0 < f["mean"] <= f["largest"] < 1e-3 and f["failed"] == 0.0 for f in found.values())


def test_a_solver_is_taken_within_and_left_behind(device):
    before = model.body_space
    features = []
    for solver in contact.SOLVERS:
        with contact.taking(solver):
            features.append(model.Model.build(contact.load(contact.TOUCHING), device=device).features.body_space)
    assert features == [True, True, False] and model.body_space is before
