"""Hands that are probed: where they go, and what is told of forces that are known."""

import numpy as np
import pytest
import warp as wp

from otwarp.operators.chain import zeros
from otwarp.operators.kernels import probing
from otwarp.operators.kernels.probing import TRACKED, ProbeSums
from otwarp.operators.kernels.types import MindData, Person
from otwarp.operators.perception.probe import AMPLITUDES, FREQUENCIES, Probing, answers_of, probe_persons, probe_rows
from otwarp.operators.population import load_population
from otwarp.operators.task import task_of
from tests.operators.work import scene

PERIOD, BEFORE = 1e-3, 500
LAG, SIZE = np.array([0.03, 0.02]), np.array([0.8, 1.3])
"""Delay [s] and size of the known force against the perfect one, at both frequencies."""


@pytest.fixture(scope="module")
def probed(device):
    """Both kinds of hands over 1.5 s with a known force, where they went, and what was summed after the first 0.5 s."""
    task = task_of(scene(), load_population())
    place, where = wp.get_device(device), {"device": device}
    mind = MindData()
    for name in ("tick", "deviation", "velocity"):
        shape = (2,) if name == "tick" else (2, 2)
        setattr(mind, name, zeros(shape, MindData.vars[name].type.dtype, place))
    sums = ProbeSums()
    sums.first = BEFORE
    more = {"force": (2,), "reference": (2,), "track": (1000 // TRACKED,)}
    for name in ("counted", "force", "reference", "place", "square", "track"):
        setattr(sums, name, zeros((2, 2, *more.get(name, ())), ProbeSums.vars[name].type.dtype, place))
    rows = wp.array(probe_rows(task, ["driven", "held"]), dtype=probing.ProbeRow, **where)
    persons = probe_persons(task, load_population(), np.arange(2, dtype=np.uint32))
    people = wp.array(persons, dtype=Person, **where)
    force, reference, hand = (zeros((2, 2), wp.vec3d, place) for _ in range(3))
    done = zeros((2,), wp.int32, place)
    went = []
    for tick in range(1, 1501):
        inputs = [rows, people, PERIOD, mind, done, force, hand]
        wp.launch(probing.probe, dim=2, inputs=inputs, **where)
        turn = 2.0 * np.pi * np.array(FREQUENCIES) * tick * PERIOD
        for array, value in (
            (force, SIZE * np.sin(turn - 2 * np.pi * np.array(FREQUENCIES) * LAG)),
            (reference, np.sin(turn)),
        ):
            array.assign(np.tile([value.sum(), 0.1, -0.2], (2, 2, 1)))
        inputs = [rows, PERIOD, mind.tick, force, reference, hand, sums]
        wp.launch(probing.add_answer, dim=(2, 2), inputs=inputs, **where)
        went.append(hand.numpy().copy())
    return task, persons, np.array(went), sums


def test_driven_hands_go_in_two_sines_along_x(probed):
    task, _, went, _ = probed
    times = np.arange(1, 1501) * PERIOD
    way = sum(a * np.sin(2 * np.pi * f * times) for a, f in zip(AMPLITUDES, FREQUENCIES, strict=True))
    for h, plan in enumerate(task.plans):
        traps = went[:, 0, h] @ np.array(plan.config.axis_map).T * task.motion_gain
        np.testing.assert_allclose(traps, np.stack([way, 0 * way, 0 * way], axis=1), atol=1e-9)


def test_held_hands_yield_as_the_arm_does(probed):
    """A spring of its stiffness is deflected by a steady force, once it has come to rest."""
    _, persons, went, _ = probed
    rest = np.array([0.1, -0.2]) / persons["stiffness"][0]
    np.testing.assert_allclose(went[-1, 1, 0, 1:], rest, rtol=1e-2)


def test_phase_and_gain_of_a_known_force(probed):
    """Exact over whole periods of both sines; and the sway of a hand is its deviation."""
    *_, went, sums = probed
    found = answers_of(sums, 1.0 / PERIOD, 1, Probing(seconds=1.0, repeats=1))
    expected = -360.0 * np.array(FREQUENCIES) * LAG
    np.testing.assert_allclose(found["phase"][0, 0], np.tile(expected, (2, 1)), atol=1e-7)
    np.testing.assert_allclose(found["gain"][0, 0], np.tile(SIZE, (2, 1)), rtol=1e-9)
    sway = np.sqrt(np.sum(np.var(went[BEFORE:, 1], axis=0), axis=-1))
    np.testing.assert_allclose(found["sway"][0, 0], sway, rtol=1e-6)


def test_places_are_kept_for_the_search_of_limit_cycles(probed):
    """Every fifth period from the first that counts; a second tells of no cycle below 4 Hz, and it goes at 1."""
    *_, went, sums = probed
    track = sums.track.numpy()
    np.testing.assert_array_equal(track[1], np.moveaxis(went[BEFORE + TRACKED - 1 :: TRACKED, 1], 0, 1))
    found = answers_of(sums, 1.0 / PERIOD, 1, Probing(seconds=1.0, repeats=1))
    assert np.all(np.isnan(found["cycle"])) and not np.any(found["cycle_amplitude"])


def test_worlds_that_ended_before_are_not_told(probed):
    found = answers_of(probed[-1], 1.0 / PERIOD, 1, Probing(seconds=4.0, repeats=1))
    assert all(np.all(np.isnan(row)) for row in found.values())
