"""Threads that share out a world: what each of them hears of the others, counted in NumPy."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.team import ALONE, count_below, first_of, team_of

SIZES, THREADS = (1, 8, 16), 128


def probe(size: int) -> wp.Kernel:
    """Kernel whose threads vote, and hand on their number from the voter that comes first."""
    team = team_of(Features(phased=True, team=size))
    size_of, lane_of, votes_of, value_of, bits_of, wait = (
        team.size, team.lane, team.votes, team.value, team.bits, team.wait
    )  # fmt: skip

    @wp.kernel(module="unique", enable_backward=False)
    def listen(flag: wp.array(dtype=bool), found: wp.array2d(dtype=int), shared: wp.array(dtype=int)):
        i = wp.tid()
        votes = votes_of(flag[i])
        found[i, 0] = size_of()
        found[i, 1] = lane_of()
        found[i, 2] = count_below(votes, lane_of())
        found[i, 3] = count_below(votes, size_of())
        if votes != 0:
            found[i, 4] = int(value_of(float(i), first_of(votes)))
            found[i, 5] = bits_of(i, first_of(votes))
        shared[i] = i
        wait()
        found[i, 6] = shared[i - lane_of()]

    return listen


@pytest.mark.parametrize("size", SIZES)
def test_threads_hear_their_team(size, device):
    """Votes before each thread and in all, and numbers of the first that has voted; on a CPU each thread is alone."""
    assert (team_of(Features()) is ALONE) and (size > 1 or team_of(Features(phased=True)) is ALONE)
    flag = np.random.default_rng(5).random(THREADS) < 0.3
    found = wp.full((THREADS, 7), -1, dtype=int, device=device)
    arrays = [wp.array(flag, dtype=bool, device=device), found, wp.zeros(THREADS, dtype=int, device=device)]
    wp.launch(probe(size), dim=THREADS, inputs=arrays, device=device)
    own = size if wp.get_device(device).is_cuda else 1
    teams = flag.reshape(-1, own)
    first = np.where(teams.any(1), own * np.arange(len(teams)) + teams.argmax(1), -1)
    expected = (
        own, np.arange(THREADS) % own, (np.cumsum(teams, 1) - teams).ravel(), np.repeat(teams.sum(1), own),
        np.repeat(first, own), np.repeat(first, own), np.arange(THREADS) // own * own,
    )  # fmt: skip
    for column, value in enumerate(expected):
        np.testing.assert_array_equal(found.numpy()[:, column], value)
