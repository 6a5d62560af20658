"""Few contacts solved for their forces: laws and equation of motion in float64."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact_list import solved_term
from otwarp.kernels.contact.few_solve import solve_few_term
from otwarp.kernels.core.types import ModelData
from tests.kernels.contact.test_body_solve import (
    AGAIN,
    COUNT,
    FEATURES,
    HARDNESS,
    PARTNERS,
    Pressed,
    Problem,
    freed,
    listed_of,
    listed_one,
    loads_of,
    pressed_contacts,
)
from tests.reference import contact_law

_solve, _solved = solve_few_term(FEATURES, COUNT), solved_term(FEATURES)


@wp.kernel(enable_backward=False)
def probe_few(model: ModelData, p: Pressed, alone: bool):
    """All contacts together, or each as if it were alone."""
    listed_of(p)
    times = wp.where(alone, COUNT, 1)
    for i in range(times):
        count = int(COUNT)
        if alone:
            count = listed_one(p, 0, i)
        stages = wp.where(p.again, 2, 1)
        for stage in range(stages):
            freed(p)
            found = _solve(model, 0, p.listed, count, p.rotation, stage > 0, p.linear, p.angular)
            p.error[0] = wp.max(p.error[0], found)
        if alone:
            p.load[i] = _solved(p.listed, 0).load
            freed(p)
    if not alone:
        loads_of(p)


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
