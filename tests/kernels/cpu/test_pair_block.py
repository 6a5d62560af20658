"""Pairs in vector registers against all pairs in NumPy, with and without images."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import PeriodData
from otwarp.kernels.cpu.pair_block import PAIRS, among_term, near_term, sort_slots, touching_term

MOST = 24
COUNT = 300
SIDE = 16.0
"""Of the cube [µm]: four cells along each axis, of which those along x and y are twice as wide as they need be."""

CELLS, EDGE = (4, 4, 8), (4.0, 4.0, 2.0)
FAR = 1.8
PERIODS = {"open": 0.0, "periodic": SIDE}


@wp.kernel(module="unique", enable_backward=False)
def probe(
    period: PeriodData, places: wp.array2d(dtype=wp.vec4), order: wp.array2d(dtype=wp.int32),
    key: wp.array(dtype=wp.int32), start: wp.array(dtype=wp.int32), finish: wp.array(dtype=wp.int32),
    sorted: wp.array2d(dtype=wp.float32), list: wp.array(dtype=wp.int32), count: wp.array(dtype=wp.int32),
    chosen: wp.array(dtype=wp.int32), found: wp.array(dtype=wp.int32), shape: wp.array(dtype=wp.int32),
    constant: wp.array(dtype=wp.float32),
):  # fmt: skip
    """Sort the spheres, list the later neighbours of each, and pick those that touch."""
    near = wp.static(near_term(True))
    touching = wp.static(touching_term(True))
    edge = wp.vec3(4.0, 4.0, 2.0)
    cells = wp.vec3i(4, 4, 8)
    sort_slots(places, 0, order, 0, 0, COUNT, edge, cells, 0, key, start, finish, sorted)
    at = int(0)  # noqa: RUF046, UP018 -- Warp wants to know that it changes
    for i in range(COUNT):
        p = places[1, i]
        here = wp.vec3(p[0], p[1], p[2])
        cell = wp.vec3i(int(wp.floor(p[0] / 4.0)), int(wp.floor(p[1] / 4.0)), int(wp.floor(p[2] / 2.0)))
        count[i] = near(
            period, sorted, start, finish, edge, cells, 0, cell, here, FAR, i, i % PAIRS, list, at, MOST
        )  # fmt: skip
        at += count[i]
    begin = int(0)  # noqa: RUF046, UP018
    for first in range(0, COUNT, PAIRS):
        end = int(begin)
        for i in range(first, wp.min(first + PAIRS, COUNT)):
            end += count[i]
        found[0] = touching(
            period, places, 1, first, wp.min(PAIRS, COUNT - first), list, begin, end, 0.0, order, 1, shape, constant,
            constant, constant, chosen, found[0],
        )  # fmt: skip
        begin = end


def length_of(period: float) -> PeriodData:
    data = PeriodData()
    data.length = wp.vec3(period)
    data.per_length = wp.vec3(1.0 / period if period else 0.0)
    return data


@pytest.mark.parametrize("name", PERIODS)
def test_lists_and_touching_pairs_are_those_of_all_pairs(name, device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("pairs in blocks are for CPUs")
    period = PERIODS[name]
    rng = np.random.default_rng(8)
    start = np.concatenate([rng.uniform(0.0, SIDE, (COUNT, 3)), rng.choice([0.0, 0.1, 0.15], (COUNT, 1))], axis=1)
    # the last is beside the first across a face of the cube
    start[-1], start[0] = (0.01, 5.0, 5.0, 0.1), (SIDE - 0.01, 5.0, 5.0, 0.1)
    places = wp.array(np.stack([start, start]).astype(np.float32), dtype=wp.vec4, device=device)
    order = wp.array(np.tile(rng.permutation(COUNT), (2, 1)).astype(np.int32), dtype=wp.int32, device=device)
    names = order.numpy()[0].copy()
    sizes = (COUNT, np.prod(CELLS), np.prod(CELLS), COUNT * MOST + PAIRS, COUNT, 2 * (COUNT * MOST + PAIRS), 1)
    key, first, last, near, count, chosen, found = (wp.zeros(int(n), dtype=wp.int32, device=device) for n in sizes)
    columns = wp.zeros((4, COUNT + PAIRS), dtype=wp.float32, device=device)
    inputs = [length_of(period), places, order, key, first, last, columns, near, count, chosen, found]
    inputs += [wp.zeros(COUNT, dtype=dtype, device=device) for dtype in (wp.int32, wp.float32)]
    wp.launch(probe, dim=1, inputs=inputs, device=device)

    p, body = places.numpy()[1], order.numpy()[1]
    cell = np.floor(p[:, :3] / EDGE).astype(int)
    assert np.all(np.diff(np.ravel_multi_index(cell.T, CELLS)) >= 0)
    origin = {int(b): i for i, b in enumerate(names)}
    np.testing.assert_array_equal(p, start.astype(np.float32)[[origin[int(b)] for b in body]])
    np.testing.assert_array_equal(columns.numpy()[:, :COUNT].T, p)

    away = p[:, None, :3] - p[None, :, :3]
    away -= period * np.rint(away / SIDE)
    distance, radius = np.linalg.norm(away.astype(float), axis=2), p[:, 3].astype(float)
    # each pair once, with the first of its spheres
    wanted = np.triu((distance < FAR + radius[None]) & (radius[None] > 0.0), 1)
    counts, listed = count.numpy(), near.numpy()
    np.testing.assert_array_equal(counts, wanted.sum(axis=1))
    owner, pairs = np.repeat(np.arange(COUNT), counts), listed[: counts.sum()]
    np.testing.assert_array_equal(pairs % PAIRS, owner % PAIRS)
    assert set(zip(owner, pairs // PAIRS, strict=True)) == set(zip(*np.nonzero(wanted), strict=True))

    touch = wanted & (distance < radius[:, None] + radius[None])
    picked = chosen.numpy()[: 2 * found.numpy()[0]].reshape(-1, 2)
    assert set(map(tuple, picked)) == set(zip(*np.nonzero(touch), strict=True))
    across = {int(np.flatnonzero(body == names[k])[0]) for k in (0, COUNT - 1)}
    assert (tuple(sorted(across)) in set(map(tuple, picked))) == (name == "periodic")
    assert len(set(map(tuple, picked))) == len(picked)


TURN = 3
"""Spheres of a body: the last one of the world has fewer."""


@wp.kernel(module="unique", enable_backward=False)
def probe_among(
    period: PeriodData, columns: wp.array2d(dtype=wp.float32), first: int, last: int, list: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
):  # fmt: skip
    """List the spheres of other bodies near each of a world."""
    among = wp.static(among_term(True))
    for i in range(first, last):
        here = wp.vec3(columns[0, i], columns[1, i], columns[2, i])
        own = first + (i - first) // TURN * TURN
        count[i] = among(period, columns, first, last, own, own + TURN, here, FAR, list, i * MOST, MOST)


@pytest.mark.parametrize("name", PERIODS)
def test_spheres_of_other_bodies_among_all_of_a_world(name, device):
    """Numbers that ascend, none of the spheres before or after the world's, and a full list keeps the first."""
    if not wp.get_device(device).is_cpu:
        pytest.skip("pairs in blocks are for CPUs")
    period, first, last = PERIODS[name], 5, COUNT - 7
    rng = np.random.default_rng(9)
    places = np.concatenate([rng.uniform(0.0, SIDE, (COUNT, 3)), rng.choice([0.0, 0.1, 0.15], (COUNT, 1))], axis=1)
    # of about 60 neighbours the list keeps the first
    places[:80, :3] *= 0.2
    columns = np.zeros((4, COUNT + PAIRS), dtype=np.float32)
    columns[:, :COUNT] = places.T
    near, count = (wp.zeros(n, dtype=wp.int32, device=device) for n in (COUNT * MOST, COUNT))
    inputs = [length_of(period), wp.array(columns, dtype=wp.float32, device=device), first, last, near, count]
    wp.launch(probe_among, dim=1, inputs=inputs, device=device)
    p = columns[:, :COUNT].T.astype(float)
    away = p[:, None, :3] - p[None, :, :3]
    away -= period * np.rint(away / SIDE)
    body = (np.arange(COUNT) - first) // TURN
    wanted = (np.linalg.norm(away, axis=2) < FAR + p[None, :, 3]) & (p[None, :, 3] > 0.0)
    wanted &= body[:, None] != body[None]
    wanted[:, :first] = wanted[:, last:] = False
    for i in range(first, last):
        found = np.flatnonzero(wanted[i])
        assert count.numpy()[i] == len(found)
        np.testing.assert_array_equal(near.numpy()[i * MOST :][: min(len(found), MOST)], found[:MOST])
    assert count.numpy().max() > MOST > 0
