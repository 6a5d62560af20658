"""The float64 kernel of exact forces against its NumPy twin."""

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.exact_data import ExactData
from otwarp.kernels.optics.exact import exact_force_term
from otwarp.optics import batched
from otwarp.optics.batched import batched_force, pack_force
from otwarp.optics.beam import JONES, Beam
from otwarp.optics.exact import evaluate
from otwarp.optics.field import force
from otwarp.optics.mie import Particle

AGREEMENT = 1e-10
"""Relative to the largest Q of the points: both sum the same series in float64, with other numbers of nodes."""

LARGE_AGREEMENT = 1e-8
"""The same for r = 10 µm, where the recurrences of a hundred orders add up."""

SIZES = [0.005, 0.1, 0.5, 1.0, 3.0]


def places(radius: float, count: int, seed: int) -> np.ndarray:
    """Points near the sphere, on and just off the axis, and up to 30 µm away."""
    rng = np.random.default_rng(seed)
    around = rng.uniform(-1.0, 1.0, (count, 3)) * (1.0 + 1.5 * radius)
    far = rng.uniform(-17.0, 17.0, (3, 3))
    special = [[0, 0, 0], [0, 0, 0.7], [0.4, 0, 0], [0, -1e-6, -0.3], [1e-12, 1e-13, 0.1], [30.0, 0, 0], [0, 0, -30.0]]
    return np.concatenate([around, far, special])


def near(radius: float, count: int, seed: int) -> np.ndarray:
    """Those of them that need few nodes."""
    points = places(radius, count, seed)
    return points[np.linalg.norm(points, axis=1) < 5.0 * (1.0 + radius)]


def difference(beam: Beam, sphere: Particle, points: np.ndarray, device: str) -> float:
    """Largest difference between kernel and NumPy, relative to the largest Q."""
    expected = force(beam, sphere, points)
    found = batched_force(beam, sphere, points, device=device)
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("radius", SIZES)
def test_agrees_with_numpy_for_all_sizes(device, radius):
    beam = Beam(numerical_aperture=1.2, polarization=(1.0, 0.3 - 0.6j))
    points = places(radius, 30, 1)
    assert difference(beam, Particle(radius=radius, index=1.59), points, device) < AGREEMENT


def test_agrees_with_numpy_for_a_large_sphere(device):
    beam = Beam(numerical_aperture=1.2, polarization="x")
    points = np.array([[0.0, 0, 9.0], [3.0, -7.0, 1.0], [8.0, 6.0, -4.0], [0.0, 0.0, -12.0]])
    assert difference(beam, Particle(radius=10.0, index=1.45), points, device) < LARGE_AGREEMENT


@pytest.mark.parametrize("polarization", [*JONES, (0.2, -0.9j)])
@pytest.mark.parametrize("charge", [0, 1])
def test_agrees_with_numpy_for_all_polarizations(device, polarization, charge):
    beam = Beam(numerical_aperture=1.1, polarization=polarization, charge=charge)
    assert difference(beam, Particle(radius=0.3, index=1.5 + 0.05j), near(0.3, 20, 2), device) < AGREEMENT


@pytest.mark.parametrize("charge", [-3, 2, -40, 40])
def test_agrees_with_numpy_for_vortices(device, charge):
    """Also where the charge exceeds the sphere's orders, and one side of the sum is empty."""
    beam = Beam(polarization=(1.0, 0.5j), charge=charge)
    sphere = Particle(radius=0.3, index=1.59)
    # the ring of light of a high charge is far from the axis
    points = near(0.3, 20, 3) if abs(charge) < 10 else places(0.3, 20, 3)
    assert difference(beam, sphere, points, device) < AGREEMENT


@pytest.mark.parametrize(
    "beam",
    [
        Beam(kind="sine", numerical_aperture=0.9, polarization="y"),
        Beam(kind="aplanatic", filling=1.5, depth=4.0, glass_index=1.518, numerical_aperture=1.2),
    ],
    ids=lambda b: b.kind,
)
def test_agrees_with_numpy_for_other_beams(device, beam):
    assert difference(beam, Particle(radius=0.6, index=1.45 + 0.3j), near(0.6, 20, 4), device) < AGREEMENT


def test_order_and_number_of_points_change_no_bit(device):
    """Points are sorted and shared out over launches; a point's force is its own."""
    beam, sphere = Beam(polarization="45"), Particle(radius=0.2, index=1.59)
    points = np.random.default_rng(5).uniform(-2.0, 2.0, (3 * batched.CHUNK_PER_CORE + 7, 3))
    all_at_once = batched_force(beam, sphere, points, device=device)
    assert np.array_equal(batched_force(beam, sphere, points[::-1], device=device), all_at_once[::-1])
    some = [0, 11, len(points) - 1]
    assert np.array_equal(batched_force(beam, sphere, points[some], device=device), all_at_once[some])


def test_batches_of_several_launches(device, monkeypatch):
    monkeypatch.setattr(batched, "LAUNCH_SHARE", 1e-6)  # some ten points
    monkeypatch.setattr(batched, "CHUNK_PER_CORE", 10)
    beam, sphere, points = Beam(polarization="x"), Particle(radius=0.2), near(0.2, 30, 6)
    assert difference(beam, sphere, points, device) < AGREEMENT


def test_points_beyond_the_largest_rule_are_computed_all_the_same(device, monkeypatch):
    monkeypatch.setattr(batched, "MOST_NODES", 100)
    beam, sphere = Beam(numerical_aperture=1.2), Particle(radius=0.1, index=1.59)
    with pytest.raises(InputError, match="reach"):
        pack_force(beam, sphere, reach=25.0, device=device)
    points = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 25.0], [15.0, 20.0, 0.0]])
    found = batched_force(beam, sphere, points, device=device)
    assert found == pytest.approx(evaluate(beam, sphere, points).force, abs=1e-15)
    assert found[1, 2] > 1e-9


def test_force_with_a_device_is_the_kernel(device):
    beam, sphere, points = Beam(), Particle(radius=0.2, index=1.59), places(0.2, 5, 7)
    assert np.array_equal(
        force(beam, sphere, points, device=device), batched_force(beam, sphere, points, device=device)
    )
    assert force(beam, sphere, np.zeros((0, 3)), device=device).shape == (0, 3)


def test_power_does_not_change_q(device):
    points = np.array([[0.1, 0.2, 0.3]])
    one, other = (batched_force(Beam(power=p), Particle(radius=0.2), points, device=device) for p in (1.0, 40.0))
    assert np.array_equal(one, other) and np.abs(one).max() > 1e-5


def kernel_of_two(term: wp.Function):
    @wp.kernel(module="unique", enable_backward=False)
    def both(one: ExactData, two: ExactData, at: wp.array(dtype=wp.vec3d), out: wp.array2d(dtype=wp.vec3d)):
        i = wp.tid()
        out[0, i] = term(one, at[i])
        out[1, i] = term(two, at[i])

    return both


def test_term_serves_other_kernels_for_two_pairs_at_once(device):
    """As a simulation would use it: one term, tables of several beams and spheres, zero beyond reach."""
    pairs = [
        (Beam(polarization="x"), Particle(radius=0.1, index=1.59)),
        (Beam(charge=1), Particle(radius=0.4, index=1.45)),
    ]
    first, second = (pack_force(b, s, reach=2.0, device=device) for b, s in pairs)
    term = exact_force_term(max(first.orders, second.orders), max(first.nodes, second.nodes))

    both = kernel_of_two(term)
    points = np.array([[0.1, 0.2, -0.3], [1.0, -0.5, 1.0], [0.0, 0.0, 90.0]])
    found = wp.zeros((2, len(points)), dtype=wp.vec3d, device=device)
    inputs = [first.data, second.data, wp.array(points, dtype=wp.vec3d, device=device), found]
    wp.launch(both, dim=len(points), inputs=inputs, device=device)
    for (beam, sphere), packed, q in zip(pairs, (first, second), found.numpy(), strict=True):
        assert 2.0 <= packed.reach < 90.0
        assert q[:2] == pytest.approx(force(beam, sphere, points[:2]), abs=AGREEMENT)
        assert np.all(q[2] == 0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda d: force(Beam(), Particle(radius=1.0), np.zeros((1, 3)), device="tpu:0"),
            ["device", "tpu:0", "allowed"],
        ),
        (lambda d: force(Beam(), Particle(radius=1.0), np.array([[np.inf, 0, 0]]), device=d), ["point 0", "inf"]),
        (lambda d: force(Beam(), Particle(radius=1.0), np.zeros(3), device=d), ["(3,)", "(n, 3)"]),
        (lambda d: force(Beam(), Particle(radius=80.0), np.zeros((1, 3)), device=d), ["80", "up to"]),
        (lambda d: pack_force(Beam(), Particle(radius=1.0), reach=0.0, device=d), ["reach", "0 µm", "above 0"]),
        (lambda d: pack_force(Beam(), Particle(radius=1.0), reach=1e4, device=d), ["reach", "10000", "up to"]),
    ],
)
def test_bad_input(device, make, words):
    with pytest.raises(InputError) as error:
        make(device)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)
