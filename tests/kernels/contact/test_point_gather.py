"""Matrix and right-hand sides of contacts in vector registers against those of contacts one by one."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact_list import ContactList
from otwarp.kernels.contact.point_gather import column, gather_lanes_term, gather_points_term, table
from tests.kernels.contact.test_body_solve import FEATURES
from tests.kernels.contact.test_implicit_law import samples
from tests.kernels.samples import on_device

PAIRS = np.repeat([[2, -1], [2, 0], [1, 0], [2, 1]], [1, 11, 3, 8], axis=0)
"""Obstacles, and pairs of more contacts, as many and fewer than there are lanes."""

ROUNDING = 2e-5
"""float32 sums of some ten entries, relative to the largest of them."""

ROWS = 9
_points, _lanes = gather_points_term(FEATURES), gather_lanes_term(replace(FEATURES, cached=True))
_column, _table = column(ROWS), table(ROWS, 3)


@wp.kernel(enable_backward=False)
def probe_gather(one: ContactList, other: ContactList, count: int, first: bool, found: wp.array3d(dtype=float)):
    drags = _table()
    moved = _column()
    for i in range(ROWS):
        moved[i] = 0.003 * float(i - 4)
        drags[i, i % 3] = 20.0
    system, right = _points(one, count, first, drags, moved)
    joint, side = _lanes(other, count, first, drags, moved)
    for i in range(ROWS):
        found[0, i, ROWS] = right[i]
        found[1, i, ROWS] = side[i]
        for j in range(i + 1):
            found[0, i, j] = system[i, j]
            found[1, i, j] = joint[i, j]


@pytest.mark.parametrize("first", [True, False], ids=["first", "later"])
def test_lanes_gather_what_contacts_do_one_by_one(first, device):
    """Runs of one contact, of less than a block, of a block, and of more."""
    if not wp.get_device(device).is_cpu:
        pytest.skip("vectors of contacts are for CPUs")
    laws, give, opening = (values[: len(PAIRS)] for values in samples())
    normal = np.random.default_rng(7).normal(size=(len(PAIRS), 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    lists = []
    for _ in range(2):
        listed = ContactList()
        listed.pair, listed.face, listed.law, listed.path, listed.depth = on_device(
            device,
            (PAIRS, wp.vec2i),
            (np.column_stack([normal, opening]), wp.vec4),
            (np.column_stack([laws[:, :2], give, np.full(len(PAIRS), -0.1)]), wp.vec4),
            (laws[:, 2:], wp.vec2),
            (np.full(len(PAIRS), 0.005), float),
        )
        lists.append(listed)
    found = wp.zeros((2, ROWS, ROWS + 1), dtype=float, device=device)
    wp.launch(probe_gather, 1, [*lists, len(PAIRS), first, found], device=device)
    alone, lanes = found.numpy()
    for a, b in ((alone[:, :ROWS], lanes[:, :ROWS]), (alone[:, ROWS], lanes[:, ROWS])):
        assert np.abs(a - b).max() < ROUNDING * np.abs(a).max()
        assert (np.abs(a) > 1e-3 * np.abs(a).max()).mean() > 0.3
    depths = [listed.depth.numpy() for listed in lists]
    assert np.abs(depths[0] - depths[1]).max() < ROUNDING * depths[0].max()
