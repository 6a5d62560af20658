"""The NumPy twins of contact: the force law and the loads of one step."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.scene import Material
from tests.reference.contact import adhesion_of, normal_force, pair_forces, sphere_obstacle, sphere_pair
from tests.reference.contact_loads import contact_loads

CELL = Material(youngs_modulus=1000.0, poisson_ratio=0.5, adhesion=0.5, adhesion_range=0.05)
POLYMER = Material(youngs_modulus=1e6, poisson_ratio=0.4, adhesion=0.1, adhesion_range=0.02)


def test_hertz_by_hand():
    """E* = 1000/0.75, R = 1 (two spheres of 2), δ = 0.04: 4/3·1333.3·0.008 = 14.222 pN between bare surfaces."""
    bare = Material(youngs_modulus=2000.0, poisson_ratio=0.5)
    force, stiffness = sphere_pair(bare, 2.0, bare, 2.0, 3.96)
    assert force == pytest.approx(4 / 3 * (1000 / 0.75) * 0.2**3)
    assert stiffness == pytest.approx(2 * (1000 / 0.75) * 0.2)


def test_pull_off_force_is_dmt():
    """The least force over all gaps is −2πRW, at first touch."""
    forces = [sphere_pair(CELL, 5.0, POLYMER, 1.5, d)[0] for d in np.linspace(6.4, 6.6, 4001)]
    radius = 5.0 * 1.5 / 6.5
    assert min(forces) == pytest.approx(-2 * np.pi * radius * CELL.adhesion)
    assert np.linspace(6.4, 6.6, 4001)[int(np.argmin(forces))] == pytest.approx(6.5, abs=1e-4)


@pytest.mark.parametrize("overlap", [0.0, -0.05])
def test_continuous(overlap):
    law = (1.2, 900.0, 0.3, 0.05)
    below, above = normal_force(overlap - 1e-9, *law)[0], normal_force(overlap + 1e-9, *law)[0]
    assert below == pytest.approx(above, abs=1e-6)


def test_stiffness_is_the_derivative():
    law, h = (1.2, 900.0, 0.3, 0.05), 1e-7
    for overlap in (0.01, 0.1, 0.3):
        slope = (normal_force(overlap + h, *law)[0] - normal_force(overlap - h, *law)[0]) / (2 * h)
        assert slope == pytest.approx(normal_force(overlap, *law)[1], rel=1e-6)


def test_repulsion_stores_the_hertz_energy():
    """∫F dδ = 8/15 E*√R δ^{5/2} (Johnson 1985)."""
    x, weight = np.polynomial.legendre.leggauss(40)
    delta = 0.2
    work = sum(w * normal_force(delta * (1 + t) / 2, 1.2, 900.0, 0.0, 0.0)[0] for t, w in zip(x, weight, strict=True))
    assert work * delta / 2 == pytest.approx(8 / 15 * 900.0 * np.sqrt(1.2) * delta**2.5, rel=1e-4)


def test_surface_that_adheres_more_decides():
    assert adhesion_of(CELL, POLYMER) == (0.5, 0.05) == adhesion_of(POLYMER, CELL)
    assert sphere_pair(CELL, 5.0, POLYMER, 1.5, 6.53)[0] < 0  # within the cell's range, beyond the polymer's
    assert sphere_pair(POLYMER, 1.5, CELL, 5.0, 6.551) == (0.0, 0.0)


def test_third_law_and_direction():
    centre_a, centre_b = np.array([1.0, 2, 3]), np.array([4.0, -2, 5])
    on_a, on_b = pair_forces(CELL, centre_a, 5.0, POLYMER, centre_b, 1.0)
    np.testing.assert_array_equal(on_a, -on_b)
    np.testing.assert_allclose(np.cross(on_a, centre_a - centre_b), 0, atol=1e-9)
    assert on_a @ (centre_a - centre_b) > 0  # deep overlap repels
    swapped = pair_forces(POLYMER, centre_b, 1.0, CELL, centre_a, 5.0)
    np.testing.assert_allclose(swapped[0], on_b)


def test_obstacle_is_the_limit_of_a_large_hard_sphere():
    hard = Material(youngs_modulus=1e15, poisson_ratio=0.3)
    large = 1e7
    flat = sphere_obstacle(CELL, 5.0, 4.9)
    np.testing.assert_allclose(sphere_pair(CELL, 5.0, hard, large, large + 4.9), flat, rtol=1e-5)


def random_contacts(seed: int, n: int = 5) -> tuple:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, 3))  # fewer freedoms than contacts: G is singular, as in a closed chain of contacts
    return (
        rng.normal(size=n) * 10,
        10.0 ** rng.uniform(0, 5, n),
        -rng.uniform(0, 3, n),
        rng.normal(size=n) * 0.05,
        root @ root.T * 1e-2,
    )


@pytest.mark.parametrize("seed", range(8))
def test_loads_solve_the_step(seed):
    force, stiffness, floor, free, give = random_contacts(seed)
    loads = contact_loads(force, stiffness, floor, free, give)
    expected = np.maximum(floor, force - stiffness * (free + give @ loads))
    np.testing.assert_allclose(loads, expected, atol=1e-7 * stiffness.max() * np.abs(give).max())


def test_loads_agree_with_gauss_seidel():
    """An unrelated method on the same problem: sweep contact by contact to convergence."""
    force, stiffness, floor, free, give = random_contacts(3)
    loads = np.zeros(len(force))
    for _ in range(20_000):
        for i in range(len(force)):
            others = free[i] + give[i] @ loads - give[i, i] * loads[i]
            loads[i] = max(floor[i], (force[i] - stiffness[i] * others) / (1 + stiffness[i] * give[i, i]))
    np.testing.assert_allclose(contact_loads(force, stiffness, floor, free, give), loads, rtol=1e-6, atol=1e-6)


def test_rigid_limit_stops_the_gap_from_closing():
    loads = contact_loads(np.array([0.0]), np.array([1e12]), np.array([0.0]), np.array([-0.02]), np.array([[0.5]]))
    np.testing.assert_allclose(loads, [0.04], rtol=1e-9)  # the load that undoes the approach of 0.02
    parting = contact_loads(np.array([0.0]), np.array([1e12]), np.array([0.0]), np.array([0.02]), np.array([[0.5]]))
    np.testing.assert_array_equal(parting, [0.0])
