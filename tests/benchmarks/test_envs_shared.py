"""Shared control with full SIMULATED operators: who has all authority is alone, and the chain knows where traps are."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("torch")

from benchmarks.envs_shared import CUBE, SPEED_LIMIT, LearntLoop, SharedLoop, row, study
from otwarp.operators.loop import Loop

ASKED = study(2, "with")


def loops(authority, device):
    """The same operators with a policy, which wants both hands to go along x at 3 µm/s, and alone."""
    people, how = ASKED.persons(np.arange(2)), {"seed": 1, "device": device}

    def policy(seen, fresh):
        assert set(seen) == {"body_position.x", "body_position.y", "time_left"}
        return np.tile([3.0, 0.0, 3.0, 0.0], (len(fresh), 1)) / SPEED_LIMIT

    return SharedLoop(ASKED.task, people, policy, authority, **how), Loop(ASKED.task, people, **how)


def foci(loop):
    return loop.sim.control.trap_position.numpy()


def test_an_operator_without_help_is_as_alone(device):
    shared, alone = loops(0.0, device)
    for n in range(8):
        shared.decide(first=n == 0)
        for loop in (shared, alone):
            loop.run(0.05)
    assert np.array_equal(foci(shared), foci(alone))
    assert np.array_equal(shared.sim.state.position.numpy(), alone.sim.state.position.numpy())


def test_shares_add_up_and_hands_feel_the_traps_where_they_are(device):
    start = np.array([trap.position.at(0.0) for trap in ASKED.task.scene.traps])
    way = {}
    for authority in (0.5, 1.0):
        loop, _ = loops(authority, device)
        loop.decide(first=True)
        loop.run(0.2)
        way[authority] = foci(loop) - start
        # what a chain has carried is where its traps are
        carried = loop.chain.motion.numpy()["commanded"].reshape(2, -1, 3)
        hands = loop.people.task.hand_of.numpy()
        assert np.allclose(way[authority], carried[:, hands], atol=1e-4)
    assert np.allclose(way[1.0], [0.6, 0.0, 0.0], atol=2e-3)
    assert np.all(np.abs(way[0.5][..., 0] - 0.3) < 0.25)


def test_a_trained_policy_sees_what_its_environment_shows_and_is_no_faster_than_there(device):
    seen_in = []

    def policy(seen, fresh):
        seen_in.append(seen)
        return np.tile([3.0, 4.0, 0.0, 0.0], (len(fresh), 1))

    how = {"seed": 1, "device": device}
    loop = LearntLoop(ASKED.task, ASKED.persons(np.arange(2)), policy, 1.0, **how)
    start = foci(loop).copy()
    for n in range(2):
        loop.decide(first=n == 0)
        loop.run(0.05)
    assert list(seen_in[0]) == [column.name for column in loop.observer.layout.seen]
    assert np.allclose([seen["time_left"] for seen in seen_in], [[20.0], [19.95]])
    way = (foci(loop) - start)[:, loop.people.task.hand_of.numpy() == 0]
    assert np.allclose(way, SPEED_LIMIT * 0.1 * np.array([0.6, 0.8, 0.0]), atol=2e-3)


def test_a_row_counts_outcomes():
    wanted = "| 0.25 | with | 0.500 [0.013, 0.987] | 0.354 | cell left behind 1 | 8.5 to 8.5 |"
    assert row("0.25", "with", np.array([1, 3], dtype=np.int32), np.array([8.5, np.nan])) == wanted


def test_a_study_leaves_an_obstacle_out():
    kept, all_of_them = study(2, "with", without=CUBE).scene.obstacles, ASKED.scene.obstacles
    assert len(kept) == len(all_of_them) - 1 and CUBE in {o.prim for o in all_of_them}
