"""Terms compiled for the shapes of a scene: which functions are made anew, and what comes out of them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

pytest.importorskip("gymnasium")

from otwarp.envs import Batch, TaskNow, term
from otwarp.envs import terms as t
from otwarp.envs.kernels import geometry, terms
from otwarp.envs.kernels.geometry import gap_of
from otwarp.envs.kernels.specialise import finds_gap, for_shapes, gap_parameters
from otwarp.envs.layout import Layout
from tests.envs.bead_task import BEAD
from tests.envs.bead_task import task as bead_task

SHAPES = ("box", "cylinder")


def test_only_what_asks_for_distances_is_made_anew():
    assert for_shapes(terms.goal_offset, SHAPES) is terms.goal_offset
    twin = for_shapes(terms.obstacle_offset, SHAPES)
    assert twin is not terms.obstacle_offset and twin is for_shapes(terms.obstacle_offset, SHAPES)
    assert twin.__globals__["surface_of"] is not geometry.surface_of
    assert twin.__globals__["body_place"] is geometry.body_place
    assert terms.obstacle_offset.__globals__["surface_of"] is geometry.surface_of


def reassigned(now: TaskNow, body: int) -> float:
    """Gap of the body after it."""
    body = body + 1
    return gap_of(now, body)


def test_parameters_whose_gaps_are_asked_for_are_read_from_the_source():
    assert [gap_parameters(f) for f in (terms.nearness, terms.collided)] == [("body",)] * 2
    assert gap_parameters(terms.progress) == ()
    assert gap_parameters(enclosed(geometry.gap_of).function.function) is None
    assert gap_parameters(reassigned) is None


def test_terms_that_find_a_gap_are_told_by_what_they_call():
    assert [finds_gap(f) for f in (terms.gap, terms.nearness, terms.collided)] == [True] * 3
    assert not any(finds_gap(f) for f in (terms.touched, terms.obstacle_offset, terms.progress))


def enclosed(found: wp.Function):
    """A term that takes what it calls from the function around it, and its body from no parameter."""

    @term(unit="µm")
    def around(now: TaskNow) -> float:
        """Gap of the first body."""
        return found(now, 0)

    return around


@term(unit="µm")
def by_module(now: TaskNow, body: int) -> float:
    """Gap of a body, by a function that is named by its module: that for all shapes."""
    return geometry.find_gap(now, body)


@pytest.mark.thorough
def test_a_gap_is_the_same_however_a_term_comes_by_it(device):
    """Known before the terms, found by one that names no body, or found by the function for all shapes."""
    rewards = (t.gap(body=BEAD), enclosed(geometry.gap_of)(), by_module(body=BEAD), t.goal_distance(body=BEAD))
    task = dataclasses.replace(bead_task(), rewards=rewards, ends=(t.kept_up(duration=9.0),))
    # each by itself as well, where nothing else makes the gap known
    tasks = [task, *(dataclasses.replace(task, rewards=(reward,)) for reward in rewards[:3])]
    found = []
    for chosen in tasks:
        batch = Batch(chosen, 20, device=device)
        batch.restart(seeds=np.arange(20))
        batch.actions.fill_(0.4)
        for _ in range(10):
            batch.step()
        found.append(batch.verdict.earned.numpy())
    together, *alone = found
    assert np.ptp(together[:, 0]) > 1.0
    for column in (*together[:, 1:3].T, *(a[:, 0] for a in alone)):
        assert np.allclose(column, together[:, 0], atol=1e-5)
    assert [Layout(chosen, chosen.load()).watched() for chosen in tasks] == [[0], [0], [], []]
