"""Few contacts solved for their forces: laws and equation of motion in float64."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.body_solve import open_gaps_term
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, put_term, solved_term
from otwarp.kernels.contact.few_solve import solve_few_term
from otwarp.kernels.core.types import ModelData, ReadoutData, vec6
from tests.kernels.contact.test_body_solve import (
    BODIES,
    COUNT,
    FEATURES,
    PARTNERS,
    Problem,
    listed_of,
    pressed_contacts,
)
from tests.reference import contact_law

_put, _open, _solve, _solved = (
    put_term(FEATURES), open_gaps_term(FEATURES), solve_few_term(FEATURES, COUNT), solved_term(FEATURES)
)  # fmt: skip


@wp.kernel(enable_backward=False)
def probe_few(
    model: ModelData,
    position: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    given: wp.array(dtype=Contact),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    again: bool,
    alone: bool,
    listed: ContactList,
    load: wp.array(dtype=float),
    error: wp.array(dtype=float),
):
    """All contacts together, or each as if it were alone."""
    start = wp.zeros(shape=(wp.static(2 * BODIES),), dtype=wp.vec3)
    still = wp.zeros(shape=(BODIES,), dtype=vec6)
    for b in range(BODIES):
        start[b] = linear[b]
        start[BODIES + b] = angular[b]
    listed_of(given, linear, angular, listed)
    times = int(1)  # noqa: RUF046, UP018
    if alone:
        times = int(COUNT)
    for i in range(times):
        count = int(COUNT)
        if alone:
            count = _put(ReadoutData(), 0, listed, 0, given[i], wp.int64(0))
            _open(listed, count, False, linear, angular, still, still)
        # again: the same step once more, from the solution of the first
        stages = wp.where(again, 2, 1)
        for stage in range(stages):
            for b in range(BODIES):
                linear[b] = start[b]
                angular[b] = start[BODIES + b]
            found = _solve(model, 0, listed, count, rotation, stage > 0, linear, angular)
            error[0] = wp.max(error[0], found)
        if alone:
            load[i] = _solved(listed, 0).load
            for b in range(BODIES):
                linear[b] = start[b]
                angular[b] = start[BODIES + b]
    if not alone:
        for i in range(COUNT):
            load[i] = _solved(listed, i).load


HARDNESS = pytest.mark.parametrize("hardness", [2e2, 2e3, 2e5, 2e6], ids=["soft", "stiffer", "stiff", "hard"])
AGAIN = pytest.mark.parametrize("again", [False, True], ids=["first stage", "second stage"])


BALANCE = 2e-5
"""How far [µm] the moves of a lone contact's force are from those of its load, see `BALANCED`."""


@HARDNESS
@AGAIN
def test_loads_obey_law_and_motion(hardness, again, device):
    """As `test_body_solve`."""
    assert pressed_contacts(PARTNERS, probe_few, hardness, again, device, more=(False,), most=BALANCE) > 40


@HARDNESS
@AGAIN
def test_a_lone_contact_obeys_its_law(hardness, again, device):
    """λ = λ(s⁰ + give·λ) of each contact by itself, in float64."""
    pressed = 0
    for seed in range(12):
        problem = Problem(seed, hardness)
        load, _, error = problem.solve(device, again=again, kernel=probe_few, more=(True,))
        assert error == 0.0
        rows = problem.rows()
        give = np.diag(rows @ problem.mobility() @ rows.T)
        opening = rows @ problem.turned(problem.free) + give * load
        # λ falls with s
        most, least = (contact_law.loads(opening + by, problem.floor, problem.law, give) for by in (-BALANCE, BALANCE))
        slack = 0.015 * (most - problem.floor) + 1e-3
        assert np.all((least - slack <= load) & (load <= most + slack))
        pressed += np.sum(load > problem.floor + 1e-3)
    assert pressed > 40
