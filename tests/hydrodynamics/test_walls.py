"""A sphere near a plane: exact resistances against published values and series, and the fits against the exact ones."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.hydrodynamics import body_mobility
from otwarp.hydrodynamics.bispherical import WallResistance, wall_resistance
from otwarp.hydrodynamics.walls import body_resistance, sphere_excess, sphere_mobility
from otwarp.laws.wall_fits import (
    CONTACT_GAP,
    COUPLING,
    ENTRAINED,
    FIT_ERROR,
    GAP_FAR,
    GAP_FLOOR,
    NORMAL,
    PARALLEL,
    ROLL,
    SHEAR_FORCE,
    SHEAR_TORQUE,
    SLIDING,
    SPIN,
    GapFit,
)

WANTED = 5e-3
"""What the fits are asked for: 0.5 % of the resistance."""

PRINTED = 6e-5
"""Half a unit in the last of the five printed digits, relative, with 1 unit for the rounding of hand computation."""

TRANSLATION = {3.0: (1.1252, 1.0591), 2.0: (1.4129, 1.1738), 1.5: (1.8375, 1.3079), 1.0: (3.0361, 1.5675),
               0.5: (9.2518, 2.1514)}  # fmt: skip
"""arcosh(h/a): resistance to approach (Brenner 1961, table 1), along the wall (O'Neill 1964; Goldman et al. 1967)."""

ROTATION = {1.0: (1.4649e-2, 1.0998), 0.5: (7.3718e-2, 1.3877)}
"""arcosh(h/a): torque by translation over 8πηa², torque by rotation over 8πηa³ (Goldman, Cox, Brenner 1967, I)."""

FITS: dict[str, GapFit] = {
    "normal": NORMAL, "sliding": SLIDING, "parallel": PARALLEL, "roll": ROLL, "spin": SPIN, "coupling": COUPLING,
    "shear_force": SHEAR_FORCE, "shear_torque": SHEAR_TORQUE,
}  # fmt: skip

TILTED = np.array([0.48, -0.6, 0.64])
"""A unit normal along no axis."""


@pytest.fixture(scope="module")
def gaps() -> np.ndarray:
    """Between the places where the fits were made, too."""
    return np.geomspace(GAP_FLOOR, 300.0, 47)


@pytest.fixture(scope="module")
def exact(gaps: np.ndarray) -> list[WallResistance]:
    return [wall_resistance(float(g)) for g in gaps]


def at(alpha: float) -> WallResistance:
    return wall_resistance(float(2.0 * np.sinh(0.5 * alpha) ** 2))


@pytest.mark.parametrize("alpha", TRANSLATION)
def test_published_translation(alpha):
    found = at(alpha)
    assert (found.normal, found.parallel) == pytest.approx(TRANSLATION[alpha], rel=PRINTED)


@pytest.mark.parametrize("alpha", ROTATION)
def test_published_rotation(alpha):
    """The torque by translation, 8πηa²·T, is the force by rotation, 6πηa²·C, by reciprocity: T = ¾C."""
    found = at(alpha)
    assert (0.75 * found.coupling, found.roll) == pytest.approx(ROTATION[alpha], rel=PRINTED)


@pytest.mark.parametrize("height", [6.0, 12.0, 24.0])
def test_far_from_the_wall(height):
    """Faxén's series of μ∥ to (a/h)⁵ (Happel & Brenner 1965, §7.4), Lorentz's of μ⊥ to (a/h)³; what follows is next."""
    x = 1.0 / height
    found = wall_resistance(height - 1.0)
    assert 1.0 / found.sliding == pytest.approx(
        1.0 - 9 / 16 * x + x**3 / 8 - 45 / 256 * x**4 - x**5 / 16, abs=0.5 * x**6
    )
    assert 1.0 / found.normal == pytest.approx(1.0 - 9 / 8 * x + x**3 / 2, abs=x**4)
    assert found.roll - 1.0 == pytest.approx(5 / 16 * x**3, rel=2.0 * x**3)
    assert found.spin - 1.0 == pytest.approx(x**3 / 8, rel=2.0 * x**3)
    assert found.coupling == pytest.approx(x**4 / 8 * (1.0 - 3 / 8 * x), rel=2.0 * x**2)
    assert found.shear_force == pytest.approx(1.0 + 9 / 16 * x, abs=x**2)
    assert 1.0 - found.shear_torque == pytest.approx(3 / 16 * x**3, rel=x)


@pytest.mark.parametrize("gap", [1e-3, 1e-4])
def test_lubrication(gap):
    """Singular terms near contact: Brenner 1961 and Cox & Brenner 1967; O'Neill & Stewartson 1967,
    doi:10.1017/S0022112067002551; Goldman et al. 1967, I. What follows is of order g ln g.

    The constants behind the logarithms are those of the limit, -8/15 ln g + 0.9543 and so on; hand computation at
    finite gaps had given 0.9588, 0.3817 and -0.1895.
    """
    found, log = wall_resistance(gap), np.log(gap)
    next_term = -1.0 * gap * log
    assert found.normal == pytest.approx(1.0 / gap - 0.2 * log + 0.9713, abs=next_term)
    assert found.parallel == pytest.approx(-8 / 15 * log + 0.9543, abs=next_term)
    assert found.coupling == pytest.approx(4 / 3 * (-0.1 * log - 0.1929), abs=next_term)
    assert found.roll == pytest.approx(-0.4 * log + 0.3709, abs=next_term)
    # Jeffery 1915 at contact, zeta(3)
    assert found.spin == pytest.approx(1.2020569, abs=next_term)
    # O'Neill 1968, doi:10.1016/0009-2509(68)89039-6: a sphere that touches
    assert (found.shear_force, found.shear_torque) == pytest.approx((1.7005, 0.9440), abs=next_term)


@pytest.mark.parametrize("name", FITS)
def test_fits(name, gaps, exact):
    """Below the error the module states, which is below the one wanted."""
    values = np.array([getattr(r, name) for r in exact])
    scale = np.array([np.sqrt(r.parallel * r.roll) for r in exact]) if name == "coupling" else values
    free = 0.0 if name == "coupling" else 1.0
    excess = -FITS[name](gaps)[0] if name == "shear_torque" else FITS[name](gaps)[0]
    error = np.abs(free + excess - values) / scale
    assert error.max() < FIT_ERROR < WANTED


def test_approach_down_to_contact():
    gap = np.array([CONTACT_GAP, 3e-4])
    exact = [wall_resistance(float(g)).normal for g in gap]
    np.testing.assert_allclose(1.0 + NORMAL(gap)[0], exact, rtol=FIT_ERROR)


def test_speed_of_a_sphere_carried_along(gaps, exact):
    """No force and no torque: U·sliding = u(h)·shear_force + coupling·shear_torque·a·γ̇/(2 roll)."""
    carried = np.array([r.shear_force + r.coupling * r.shear_torque / (2.0 * r.roll) for r in exact])
    carried = np.array([r.shear_force for r in exact]) + (carried - [r.shear_force for r in exact]) / (1.0 + gaps)
    assert np.abs((1.0 + ENTRAINED(gaps)[0]) / carried - 1.0).max() < FIT_ERROR


@pytest.mark.parametrize("fit", [*FITS.values(), ENTRAINED], ids=[*FITS, "entrained"])
def test_slopes_are_those_of_the_fits(fit):
    """Against central differences; constant outside the range of the fits."""
    g = np.geomspace(2e-3, 100.0, 30)
    h = 1e-5 * g
    slope = (fit(g + h)[0] - fit(g - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(fit(g)[1], slope, rtol=1e-6, atol=1e-12)
    for outside, rim in ((-0.1, fit.floor), (1e9, GAP_FAR)):
        assert fit(outside)[0] == fit(rim)[0]
        assert fit(outside)[1] == 0.0


def test_mobility_of_a_lone_sphere():
    gap = np.array([0.01, 0.3, 5.0])
    normal, along, slope = sphere_mobility(gap)
    np.testing.assert_allclose(normal, [1.0 / wall_resistance(g).normal for g in gap], rtol=WANTED)
    np.testing.assert_allclose(along, [1.0 / wall_resistance(g).sliding for g in gap], rtol=WANTED)
    np.testing.assert_allclose(
        slope, (sphere_mobility(gap + 1e-6)[0] - sphere_mobility(gap - 1e-6)[0]) / 2e-6, rtol=1e-6
    )


@pytest.mark.parametrize("gap", [-0.2, 1e-3, 0.05, 0.7, 10.0])
def test_a_wall_only_takes_energy(gap):
    """Least dissipation: ΔR is positive definite, so R_free + Σ KᵀΔRK always has a factor."""
    excess, slope = sphere_excess(gap, 1.5, TILTED)
    np.testing.assert_array_equal(excess, excess.T)
    np.testing.assert_array_equal(slope, slope.T)
    assert np.linalg.eigvalsh(excess).min() > 0.0


def test_a_lone_sphere_as_a_body():
    """The 6×6 matrix of one sphere, inverted, has the mobilities of a sphere that is free to rotate."""
    radius, gap = 0.8, 0.02
    free = body_mobility(np.zeros((1, 3)), np.array([radius]))
    centre = TILTED * radius * (1.0 + gap) + np.cross(TILTED, [1.0, 2.0, 3.0])
    spheres = np.array([[0.0, 0.0, 0.0, radius]])
    mobility = np.linalg.inv(body_resistance(free.resistance, spheres, centre, np.eye(3), TILTED[None], np.zeros(1)))[
        :3, :3
    ] * (6.0 * np.pi * radius)
    normal, along, _ = (float(v) for v in sphere_mobility(gap))
    expected = normal * np.outer(TILTED, TILTED) + along * (np.eye(3) - np.outer(TILTED, TILTED))
    np.testing.assert_allclose(mobility, expected, atol=2.0 * FIT_ERROR)


def test_far_walls_do_nothing():
    free = body_mobility(np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.ones(2))
    spheres = np.array([[-1.0, 0, 0, 1.0], [1.0, 0, 0, 1.0]])
    near = body_resistance(free.resistance, spheres, np.array([0.0, 0, 1e4]), np.eye(3), np.eye(3)[2:], np.zeros(1))
    np.testing.assert_allclose(near, free.resistance, rtol=3e-4, atol=1e-3)


@pytest.mark.parametrize("spheres", [2, 5])
def test_what_superposition_misses(spheres):
    """Far away only the image of the total force counts, −(9/16, 9/8)/6πηh (Lorentz 1907), whatever the shape.

    Spheres that add their own excess each take the image of one force for the sum of theirs, and the screening between
    them from the free body: a row of two is 31 % off along its axis and 4 % across, one of five 24 % and 24 %.
    """
    centres = np.zeros((spheres, 3))
    centres[:, 0] = 2.0 * np.arange(spheres)
    free = body_mobility(centres, np.ones(spheres))
    rows = np.column_stack([centres - free.reference, np.ones(spheres)])
    height = 100.0
    near = body_resistance(free.resistance, rows, np.array([0.0, 0, height]), np.eye(3), np.eye(3)[2:], np.zeros(1))
    change = np.diag(np.linalg.inv(near) - free.mobility)[:3]
    image = -np.array([9 / 16, 9 / 16, 9 / 8]) / (6.0 * np.pi * height)
    np.testing.assert_allclose(change / image, 1.0, atol=0.35)
    assert np.all(change < 0.0)


@pytest.mark.parametrize("gap", [0.0, -1.0, 1e-6, 1e5, float("nan")])
def test_gaps_out_of_range(gap):
    with pytest.raises(InputError, match=r"argument gap: .*allowed: \[1e-05, 10000\]"):
        wall_resistance(gap)
