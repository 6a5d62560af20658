"""Exact forces against the Optical Tweezers Toolbox, limits of small and large spheres, and conservation laws."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.optics.analysis import stiffness, trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.exact import evaluate
from otwarp.optics.field import force
from otwarp.optics.mie import Particle, highest_order, mie_coefficients
from tests.optics.pack_reference import cases

TOOLBOX = 1e-6
"""Agreement in Q asked of the toolbox (its own agreement with a plane-wave code is 7e-10); relative to max|Q| for the
smallest spheres, whose Q are small."""

CASES = {c.name: c for c in cases()}
RNG = np.random.default_rng(5)


@pytest.mark.parametrize("name", CASES)
def test_force_agrees_with_the_toolbox(name):
    c = CASES[name]
    got = evaluate(c.beam, c.sphere, c.points)
    scale = np.abs(c.force).max() if name.startswith(("c5", "c6")) else 1.0
    assert np.abs(got.force - c.force).max() <= TOOLBOX * scale
    assert got.error < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_stiffness_and_equilibrium_agree_with_the_toolbox(name):
    c = CASES[name]
    at = np.array([0.0, 0.0, c.equilibrium])
    assert stiffness(c.beam, c.sphere, at) == pytest.approx(tuple(c.stiffness), rel=1e-4)
    assert trap_properties(c.beam, c.sphere).equilibrium == pytest.approx(c.equilibrium, abs=1e-6)


def test_energy_is_conserved_and_a_lossless_sphere_feels_no_torque():
    points = RNG.uniform(-3.0, 3.0, (60, 3))
    got = evaluate(Beam(polarization=(1.0, 0.4j)), Particle(radius=1.3, index=1.5), points)
    assert np.abs(got.absorbed).max() < 1e-10
    assert np.abs(got.torque).max() < 1e-10


def test_absorption_takes_the_spin_of_the_light():
    """On the axis a circular beam gives ħ per absorbed photon: torque · ω = absorbed power."""
    beam = Beam(polarization="circular")
    got = evaluate(beam, Particle(radius=0.4, index=1.5 + 0.02j), np.array([[0.0, 0.0, 0.3], [0.0, 0.0, -1.0]]))
    assert np.all(got.absorbed > 1e-3)
    assert got.torque[:, 2] == pytest.approx(got.absorbed, rel=1e-9)
    left = evaluate(
        dataclasses.replace(beam, polarization="left"), Particle(radius=0.4, index=1.5 + 0.02j), np.array([[0, 0, 0.3]])
    )
    assert left.torque[0, 2] == pytest.approx(-got.torque[0, 2], rel=1e-9)


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_force_turns_with_point_and_polarization(charge):
    """Turning point and Jones vector about the beam axis turns the force; a vortex phase turns into a constant."""
    angle, points = 0.7, RNG.uniform(-2.0, 2.0, (20, 3))
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    jones = np.array([0.8, 0.3 + 0.5j])
    sphere = Particle(radius=0.6, index=1.59)
    here = force(Beam(polarization=tuple(jones), charge=charge), sphere, points)
    there = force(Beam(polarization=tuple(turn[:2, :2] @ jones), charge=charge), sphere, points @ turn.T)
    assert np.abs(there - here @ turn.T).max() < 1e-12


def test_field_is_continuous_through_the_axis():
    sphere, beam = Particle(radius=1.0, index=1.59), Beam(polarization="x", numerical_aperture=1.2)
    near = force(beam, sphere, np.array([[1e-9, 0.0, 0.5], [0.0, 0.0, 0.5], [0.0, -1e-9, 0.5]]))
    assert np.abs(near - near[1]).max() < 1e-8


def test_a_cover_glass_pulls_the_trap_towards_it():
    """Paraxial rays from oil (1.518) into water meet at n₂/n₁ of the nominal depth, marginal ones nearer still."""
    flat = Beam(numerical_aperture=1.0, kind="aplanatic")
    deep = dataclasses.replace(flat, depth=2.0, glass_index=1.518)
    sphere = Particle(radius=0.15, index=1.45)
    shift = trap_properties(deep, sphere).equilibrium - trap_properties(flat, sphere).equilibrium
    paraxial = -2.0 * (1.0 - 1.33 / 1.518)
    assert 2.5 * paraxial < shift < 0.8 * paraxial
    matched = dataclasses.replace(flat, depth=2.0, glass_index=1.33)
    at = np.array([[0.3, 0.1, 0.2]])
    assert force(matched, sphere, at) == pytest.approx(force(flat, sphere, at), abs=1e-12)


def test_rayleigh_limit():
    """r = 5 nm: gradient force of a dipole, F = ¼ ε Re α ∇|E|² (Harada and Asakura 1996, 10.1016/0030-4018(95)00753-9).

    Taken as a ratio of stiffnesses of two radii and of two indices, for which the field drops out: k ∝ r³ (m² − 1)/
    (m² + 2), with relative deviations of order (k r)² = 1.5e-3.
    """
    beam = Beam(polarization="circular", numerical_aperture=1.2)
    at = np.zeros(3)

    def k(radius: float, index: float) -> float:
        return stiffness(beam, Particle(radius=radius, index=index), at)[0]

    assert k(0.005, 1.59) / k(0.004, 1.59) == pytest.approx((5 / 4) ** 3, rel=3e-3)

    def clausius(index: float) -> float:
        m2 = (index / 1.33) ** 2
        return (m2 - 1.0) / (m2 + 2.0)

    assert k(0.005, 1.59) / k(0.005, 1.45) == pytest.approx(clausius(1.59) / clausius(1.45), rel=3e-3)


def ray_optics_axial(beam: Beam, index: float, radius: float, z: float) -> float:
    """Q_z of a sphere on the axis by ray optics (Ashkin 1992, doi:10.1016/S0006-3495(92)81860-X)."""
    x, w = np.polynomial.legendre.leggauss(200)
    t = 0.5 * beam.edge * (x + 1.0)
    power = np.abs(beam.amplitude(t)) ** 2 * np.sin(t) * w
    # ray through the focus at angle t; the sphere's centre is z downstream of it
    sine = z * np.sin(t) / radius
    hits = np.abs(sine) < 1.0
    ti = np.arcsin(np.abs(sine[hits]))
    m = index / beam.medium_index
    tr = np.arcsin(np.sin(ti) / m)
    total_s = total_g = 0.0
    for r in (
        ((np.cos(ti) - m * np.cos(tr)) / (np.cos(ti) + m * np.cos(tr))) ** 2,
        ((np.cos(tr) - m * np.cos(ti)) / (np.cos(tr) + m * np.cos(ti))) ** 2,
    ):
        d = 1.0 + r**2 + 2.0 * r * np.cos(2 * tr)
        through = (1.0 - r) ** 2
        scatter = 1.0 + r * np.cos(2 * ti) - through * (np.cos(2 * ti - 2 * tr) + r * np.cos(2 * ti)) / d
        gradient = r * np.sin(2 * ti) - through * (np.sin(2 * ti - 2 * tr) + r * np.sin(2 * ti)) / d
        total_s, total_g = total_s + 0.5 * scatter, total_g + 0.5 * gradient
    along = total_s * np.cos(t[hits]) + np.sign(z) * total_g * np.sin(t[hits])
    return float(np.sum(along * power[hits]) / np.sum(power))


@pytest.mark.parametrize("z", [-8.0, -4.0, 4.0, 8.0])
def test_ray_optics_limit(z):
    """r = 10 µm, k r = 79: Q_z within 0.02 of ray optics, whose own error is of order (k r)^(-2/3) = 0.05 of Q."""
    beam = Beam(numerical_aperture=1.2, polarization="circular")
    got = force(beam, Particle(radius=10.0, index=1.45), np.array([[0.0, 0.0, z]]))[0, 2]
    assert got == pytest.approx(ray_optics_axial(beam, 1.45, 10.0, z), abs=0.02)


@pytest.mark.parametrize("size", [0.03, 0.5, math.pi, 8.0, 78.0, 200.0])
def test_mie_coefficients_conserve_energy(size):
    a, b = mie_coefficients(size, 1.2, highest_order(size))
    assert np.abs(np.abs(1.0 - 2.0 * a) - 1.0).max() < 1e-12
    assert np.abs(np.abs(1.0 - 2.0 * b) - 1.0).max() < 1e-12


def test_mie_coefficients_of_a_small_sphere():
    """a₁ → −(2i/3) x³ (m² − 1)/(m² + 2) (Bohren and Huffman 1983, eq. 5.4)."""
    x, m = 0.01, 1.2
    a, _ = mie_coefficients(x, m, 3)
    assert a[0].imag == pytest.approx(-2.0 / 3.0 * x**3 * (m * m - 1.0) / (m * m + 2.0), rel=1e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Beam(numerical_aperture=1.4), ["1.4", "1.33", "immersion"]),
        (lambda: Beam(kind="bessel"), ["bessel", "gaussian"]),
        (lambda: Beam(polarization=(0.0, 0.0)), ["polarization"]),
        (lambda: Beam(polarization="sideways"), ["sideways", "circular"]),
        (lambda: Particle(radius=0.0), ["radius", "0"]),
        (lambda: Particle(radius=1.0, index=1.5 - 0.1j), ["index"]),
        (lambda: force(Beam(), Particle(radius=1.0), np.array([[0.0, np.nan, 0.0]])), ["point 0", "nan"]),
        (lambda: force(Beam(), Particle(radius=1.0), np.zeros((3, 2))), ["(3, 2)", "(n, 3)"]),
        (lambda: force(Beam(), Particle(radius=80.0), np.zeros((1, 3))), ["80", "up to"]),
        (lambda: trap_properties(Beam(numerical_aperture=0.4), Particle(radius=1.0, index=1.59)), ["no stable point"]),
    ],
)
def test_bad_input(make, words):
    with pytest.raises(InputError) as error:
        make()
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)
