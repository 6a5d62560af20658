"""Sums of contact forces in whole numbers: of any order the same bits, and next to no rounding."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.drivers.grid.pushes import MOST_LOAD, QUANTA, of_quanta, quanta
from tests.kernels.drivers.grid.test_soft import soft_simulation
from tests.simulation.crowds import crowd, jumbled


@wp.kernel(enable_backward=False)
def probe(
    forces: wp.array(dtype=wp.vec3), loads: wp.array(dtype=wp.float32), order: wp.array2d(dtype=wp.int32),
    sums: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """Sum in the order of a row."""
    row = wp.tid()
    total = wp.vec4l()
    for k in range(order.shape[1]):
        total += quanta(forces[order[row, k]], loads[order[row, k]])
    sums[row] = wp.vec4(of_quanta(total[0]), of_quanta(total[1]), of_quanta(total[2]), of_quanta(total[3]))


def test_sums_do_not_depend_on_their_order(device: str) -> None:
    """Of forces from a nanonewton to a millionth of a piconewton; to half a unit of float32 and of each quantum."""
    rng = np.random.default_rng(1)
    size = (10.0 ** rng.uniform(-6.0, 3.0, (500, 1))).astype(np.float32)
    forces = (size * rng.normal(size=(500, 3))).astype(np.float32)
    order = np.stack([rng.permutation(500) for _ in range(6)]).astype(np.int32)
    arrays = [
        wp.array(forces, dtype=wp.vec3, device=device),
        wp.array(size[:, 0], dtype=wp.float32, device=device),
        wp.array(order, dtype=wp.int32, device=device),
        wp.zeros(6, dtype=wp.vec4, device=device),
    ]
    wp.launch(probe, dim=6, inputs=arrays, device=device)
    sums = arrays[-1].numpy()
    assert np.array_equal(sums, np.broadcast_to(sums[0], sums.shape))
    exact = np.concatenate([forces, size], axis=1).astype(float).sum(axis=0)
    np.testing.assert_allclose(sums[0], exact, rtol=2.0**-24, atol=500 / float(QUANTA))


def test_the_largest_sums_have_64_bits() -> None:
    """32 contacts of the largest load."""
    assert 32.0 * float(MOST_LOAD) * float(QUANTA) == 2.0**63


@pytest.mark.thorough
def test_a_pair_pushes_both_alike(device: str) -> None:
    """To the last bit, and nothing else is pushed."""
    where = jumbled(40, 4.0)
    where[31] = where[12] + np.array([1.7, 0.3, -0.2])
    sim = soft_simulation(crowd(where), device=device)
    sim.step()
    force, load = sim.readout.contact_force.numpy()[0], sim.readout.contact_load.numpy()[0]
    np.testing.assert_array_equal(force[12], -force[31])
    assert load[12] == load[31] == pytest.approx(np.linalg.norm(force[12]), rel=1e-6)
    assert set(np.flatnonzero(load)) == {12, 31}
