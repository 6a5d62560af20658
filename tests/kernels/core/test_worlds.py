"""Worlds with clocks of their own: only a step of such worlds asks which, since when, and by which number."""

import pytest

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.worlds import (
    all_worlds,
    common_step,
    living_world,
    living_worlds,
    number_term,
    own_step,
    start_term,
    time_term,
    trial_number,
    world_itself,
    world_term,
    worlds_term,
)


@pytest.mark.parametrize(
    ("term", "own", "common"),
    [
        (number_term, trial_number, world_itself),
        (world_term, living_world, world_itself),
        (worlds_term, living_worlds, all_worlds),
        (start_term, own_step, common_step),
    ],
)
def test_terms_follow_the_feature(term, own, common):
    assert term(Features(episodes=True)) is own and term(Features()) is common


def test_time_is_that_of_a_world_or_of_all():
    for on, name in ((True, "own_time"), (False, "common_time")):
        assert time_term(Features(episodes=on)).key.endswith(name)
