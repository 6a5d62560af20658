"""The NumPy twin of the trap force: the paper's samples, energy, equivariance, sums."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.laws import TrapLaw
from otwarp.scene import Track, Trap
from tests.reference.rotations import exponential, matrix, multiply
from tests.reference.traps import body_wrench, curve, limited_focus, potential, sphere_force

PAPER = TrapLaw(stiffness=12000.0, threshold=0.08, inverse_square=16.18, offset=-1568.0, cutoff=0.10, power=20.0)
RADIAL = TrapLaw(stiffness=20.0, threshold=0.5, inverse_square=3.0, offset=-1.0, cutoff=1.5, power=20.0, radius=1.5)
AXIAL = TrapLaw(stiffness=6.0, threshold=0.8, inverse_square=4.0, offset=-0.5, cutoff=2.2, power=20.0, radius=1.5)
TILT = tuple(exponential(np.array([0.4, -0.7, 0.2])))


def trap(radial: TrapLaw = RADIAL, axial: TrapLaw | None = None, **kwargs) -> Trap:
    return Trap(
        prim="/World/Trap", position=Track.constant((0, 0, 0)), power=Track.constant(20.0), radial=radial, axial=axial,
        **kwargs,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("d", "force"), [(0.02, 240), (0.04, 480), (0.085, 671.4), (0.09, 429.5), (0.095, 224.8), (0.1, 0), (0.2, 0)]
)
def test_samples_of_the_paper(d, force):
    assert curve(PAPER, d) == pytest.approx(force, abs=0.05)


def test_jumps_of_the_paper():
    """Continuous at the threshold to its printed digits, a jump of 50 at the cutoff."""
    assert curve(PAPER, 0.08) == pytest.approx(960.0, abs=0.2)
    assert curve(PAPER, 0.08 - 1e-12) == pytest.approx(960.0, abs=1e-6)
    assert curve(PAPER, 0.1 - 1e-12) == pytest.approx(50.0, abs=1e-3)


def test_harmonic_uses_stiffness_and_cutoff_alone():
    assert curve(RADIAL, 1.4, "harmonic") == 28.0
    assert curve(RADIAL, 1.5, "harmonic") == 0.0


@pytest.mark.parametrize("model", ["piecewise", "harmonic"])
@pytest.mark.parametrize("d", [0.1, 0.3, 0.7, 1.2, 1.7])
def test_force_is_the_derivative_of_the_energy(model, d):
    h = 1e-6
    slope = (potential(RADIAL, d + h, model) - potential(RADIAL, d - h, model)) / (2 * h)
    assert slope == pytest.approx(curve(RADIAL, d, model), abs=1e-6)


def test_power_and_size_scale():
    centre, focus = np.array([0.2, 0.1, -0.1]), np.zeros(3)
    force = sphere_force(trap(), focus, 20.0, centre, 1.5)
    np.testing.assert_allclose(sphere_force(trap(), focus, 5.0, centre, 1.5), force / 4)
    np.testing.assert_allclose(sphere_force(trap(), focus, 20.0, 2 * centre, 3.0), force)  # depends on d/r alone
    np.testing.assert_allclose(force, -20.0 * centre)


def test_force_vanishes_at_the_equilibrium_point():
    t = trap(axial=AXIAL, equilibrium=0.3, orientation=TILT)
    focus = np.array([1.0, 2, 3])
    point = focus + 0.3 * matrix(np.array(TILT))[:, 2]
    np.testing.assert_allclose(sphere_force(t, focus, 20.0, point, 1.5), 0, atol=1e-13)
    assert np.linalg.norm(sphere_force(t, focus, 20.0, focus, 1.5)) == pytest.approx(0.3 * AXIAL.stiffness)


def test_radial_and_axial_parts():
    t, focus = trap(axial=AXIAL), np.zeros(3)
    force = sphere_force(t, focus, 20.0, np.array([0.3, -0.4, -0.9]), 1.5)
    np.testing.assert_allclose(force[:2], -curve(RADIAL, 0.5) * np.array([0.6, -0.8]))
    assert force[2] == pytest.approx(curve(AXIAL, 0.9))
    # Beyond the radial cutoff, but inside the axial one: only the axial part is left.
    beyond = sphere_force(t, focus, 20.0, np.array([1.6, 0, 0.5]), 1.5)
    np.testing.assert_allclose(beyond, [0, 0, -3.0])
    # Beyond both in distance, although each coordinate alone is inside its cutoff.
    np.testing.assert_array_equal(sphere_force(t, focus, 20.0, np.array([1.4, 0, 1.8]), 1.5), 0)


@pytest.mark.parametrize("axial", [None, AXIAL])
@pytest.mark.parametrize("seed", range(4))
def test_equivariant_under_rotation(axial, seed):
    rng = np.random.default_rng(seed)
    turn = exponential(rng.normal(size=3))
    q, focus = exponential(rng.normal(size=3)), rng.normal(size=3)
    centre = focus + rng.uniform(-0.6, 0.6, size=3)  # within reach, on either side of the threshold
    force = sphere_force(trap(axial=axial, orientation=tuple(q), equilibrium=0.2), focus, 20.0, centre, 1.5)
    turned = trap(axial=axial, orientation=tuple(multiply(turn, q)), equilibrium=0.2)
    r = matrix(turn)
    assert np.linalg.norm(force) > 0
    np.testing.assert_allclose(sphere_force(turned, r @ focus, 20.0, r @ centre, 1.5), r @ force, atol=1e-12)


def test_isotropic_force_is_conservative():
    """Central differences of the potential in space, through both branches."""
    rng, h = np.random.default_rng(1), 1e-6
    for centre in rng.uniform(-0.8, 0.8, size=(20, 3)):
        force = sphere_force(trap(), np.zeros(3), 20.0, centre, 1.5)
        slope = [
            (potential(RADIAL, np.linalg.norm(centre + h * e)) - potential(RADIAL, np.linalg.norm(centre - h * e)))
            / (2 * h)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(force, -np.array(slope), atol=1e-6)


def test_body_wrench_is_the_sum_over_traps_and_spheres():
    q = exponential(np.array([0.1, 0.5, -0.3]))
    position, reference = np.array([0.3, 0.1, 0.0]), np.array([0.05, -0.1, 0.2])
    spheres = [(np.array([-0.6, 0, 0]), 1.5), (np.array([0.5, 0.2, 0]), 1.2)]
    traps = [(trap(axial=AXIAL), np.array([-0.4, 0, 0.1]), 15.0), (trap(), np.array([0.6, 0.3, 0]), 25.0)]
    force, torque = body_wrench(traps, position, q, reference, spheres)
    parts = [body_wrench([t], position, q, reference, [s]) for t in traps for s in spheres]
    np.testing.assert_allclose(force, sum(p[0] for p in parts))
    np.testing.assert_allclose(torque, sum(p[1] for p in parts))
    # The torque about the world's origin does not depend on the reference point chosen.
    other = np.array([1.0, 2.0, -0.5])
    moved = position + matrix(q) @ (other - reference)
    force2, torque2 = body_wrench(traps, moved, q, other, spheres)
    np.testing.assert_allclose(force2, force)
    np.testing.assert_allclose(torque2 + np.cross(moved, force2), torque + np.cross(position, force))


def test_virtual_work_of_a_rigid_body():
    """Force and torque are the derivatives of the summed energy under translation and rotation of the body."""
    q, position, h = exponential(np.array([0.2, -0.4, 0.1])), np.array([0.1, 0.0, 0.05]), 1e-6
    spheres = [(np.array([-0.4, 0, 0.0]), 1.5), (np.array([0.3, 0.3, 0]), 1.0)]
    traps = [(trap(), np.array([-0.3, 0, 0.1]), 15.0), (trap(), np.array([0.3, 0.2, 0]), 25.0)]

    def energy(x, orientation):
        total = 0.0
        for t, focus, power in traps:
            for offset, radius in spheres:
                s = t.radial.radius / radius
                d = np.linalg.norm(x + matrix(orientation) @ offset - focus)
                total += power / t.radial.power * potential(t.radial, d * s) / s
        return total

    force, torque = body_wrench(traps, position, q, np.zeros(3), spheres)
    for k, e in enumerate(h * np.eye(3)):
        slope = (energy(position + e, q) - energy(position - e, q)) / (2 * h)
        turn = (energy(position, multiply(exponential(e), q)) - energy(position, multiply(exponential(-e), q))) / (
            2 * h
        )
        assert -slope == pytest.approx(force[k], abs=1e-6)
        assert -turn == pytest.approx(torque[k], abs=1e-6)


def test_speed_limit():
    now, wanted = np.array([1.0, 1, 1]), np.array([4.0, 5, 1])
    np.testing.assert_allclose(limited_focus(now, wanted, 10.0, 0.1), [1.6, 1.8, 1])
    np.testing.assert_array_equal(limited_focus(now, wanted, 100.0, 0.1), wanted)
    np.testing.assert_array_equal(limited_focus(now, wanted, float("inf"), 0.1), wanted)
