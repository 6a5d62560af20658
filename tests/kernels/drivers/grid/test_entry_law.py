"""The law of a contact in a sweep, in the root of its overlap, against float64."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.excursion import swept_reach
from otwarp.kernels.drivers.grid.contacts import end_overlap
from otwarp.kernels.drivers.grid.entry_law import end_root, error_alone, momentum_of, path_reach

COUNT = 400


@wp.kernel(enable_backward=False)
def probe(numbers: wp.array2d(dtype=wp.float32), found: wp.array2d(dtype=wp.float32)):
    """Root of the overlap, what is lacking for a change of 1 pN, and momentum of two sweeps, of one contact each."""
    i = wp.tid()
    c = Contact()
    c.overlap = numbers[i, 0]
    c.give = numbers[i, 1]
    c.hardness = numbers[i, 2]
    c.floor = numbers[i, 3]
    opened = numbers[i, 4]
    start = numbers[i, 5]
    row_sum = numbers[i, 6]
    root = end_root(c, opened, start, row_sum, -1.0)
    load = c.floor + c.hardness * root * root * root
    found[i, 0] = root
    found[i, 1] = error_alone(c, row_sum, root, -1.0, 1.0)
    c.load = start + 0.5 * (start - load)  # on the way to where the sweep leads
    found[i, 2] = momentum_of(c, row_sum * c.give, root, start, load, 3) * wp.sign(load - start)
    c.load = load + (load - start)  # beyond it: the sweep before went too far
    found[i, 3] = momentum_of(c, row_sum * c.give, root, start, load, 3)


@wp.kernel(enable_backward=False)
def probe_paths(numbers: wp.array2d(dtype=wp.float32), found: wp.array2d(dtype=wp.float32)):
    """What paths ask for, and the overlap at which their contacts end, by both forms of the law."""
    i = wp.tid()
    c = Contact()
    c.overlap = numbers[i, 0]
    c.give = numbers[i, 1]
    c.hardness = numbers[i, 2]
    c.wander = numbers[i, 3]
    c.layer = numbers[i, 4]
    opened = numbers[i, 5]
    start = numbers[i, 6]
    row_sum = numbers[i, 7]
    reach = path_reach(c, opened, start, row_sum)
    root = end_root(c, opened, start, row_sum, reach)
    found[i, 0] = reach
    found[i, 1] = root * root
    found[i, 2] = swept_reach(c, opened, start, row_sum)
    found[i, 3] = end_overlap(c, opened, start, row_sum, found[i, 2])


def test_paths_ask_for_what_they_do_in_lists_by_body(device):
    """The least of what paths ask for is what is left of differences of 0.1 µm in float32."""
    rng = np.random.default_rng(6)
    numbers = np.zeros((COUNT, 8), dtype=np.float32)
    numbers[:, 0] = rng.uniform(-0.02, 0.02, COUNT)
    numbers[:, 1] = 10.0 ** rng.uniform(-4, -1, COUNT)
    numbers[:, 2] = 10.0 ** rng.uniform(0, 6, COUNT)
    numbers[:, 3] = np.where(rng.random(COUNT) < 0.8, 10.0 ** rng.uniform(-6, -3, COUNT), 0.0)
    numbers[:, 4] = rng.uniform(0, 2e-3, COUNT)
    numbers[:, 5] = rng.uniform(-0.02, 0.02, COUNT)
    numbers[:, 6] = np.where(rng.random(COUNT) < 0.8, rng.uniform(0, 5, COUNT), 0.0)
    numbers[:, 7] = rng.uniform(1, 8, COUNT)
    found = wp.zeros((COUNT, 4), dtype=wp.float32, device=device)
    wp.launch(probe_paths, dim=COUNT, inputs=[wp.array(numbers, device=device), found], device=device)
    reach, overlap, other_reach, other_overlap = found.numpy().astype(float).T
    assert min(np.count_nonzero(reach > 0.0), np.count_nonzero(reach < 0.0)) > 50
    np.testing.assert_allclose(reach, other_reach, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(overlap, other_overlap, rtol=1e-4, atol=1e-7)


def test_a_contact_ends_where_its_law_and_its_way_meet(device):
    """δ + r·give·k·δ^{3/2} is what loads leave it, over ten orders of its hardness; none is left where it is open."""
    rng = np.random.default_rng(5)
    numbers = np.zeros((COUNT, 7), dtype=np.float32)
    numbers[:, 0] = rng.uniform(-0.02, 0.1, COUNT)
    numbers[:, 1] = 10.0 ** rng.uniform(-4, -1, COUNT)
    numbers[:, 2] = 10.0 ** rng.uniform(0, 6, COUNT)
    numbers[:, 3] = np.where(rng.random(COUNT) < 0.3, -rng.uniform(0, 1, COUNT), 0.0)
    numbers[:, 4] = rng.uniform(-0.02, 0.05, COUNT)
    numbers[:, 5] = numbers[:, 3] + rng.uniform(0, 5, COUNT)
    numbers[:, 6] = rng.uniform(1, 8, COUNT)
    found = wp.zeros((COUNT, 4), dtype=wp.float32, device=device)
    wp.launch(probe, dim=COUNT, inputs=[wp.array(numbers, device=device), found], device=device)
    root, lacking, momentum, restarted = found.numpy().astype(float).T
    overlap, give, hardness, floor, opened, start, row_sum = numbers.astype(float).T
    kept = overlap - opened + row_sum * give * (start - floor)
    closed = kept > 1e-6
    assert min(np.count_nonzero(closed), np.count_nonzero(kept < -1e-6)) > 10
    left = root**2 + row_sum * give * hardness * root**3
    np.testing.assert_allclose(left[closed], kept[closed], rtol=3e-6)
    assert np.all(root[kept < -1e-6] == 0.0)
    # alone it gives way by give and not by row_sum·give: what it lacks is the same gap over another slope
    slope = 1.5 * give * hardness * root
    np.testing.assert_allclose(lacking, give * (1.0 + row_sum * slope) / (1.0 + slope), rtol=1e-5)
    assert np.all(momentum >= 0.0) and np.any(momentum > 0.0) and np.all(restarted == 0.0)
