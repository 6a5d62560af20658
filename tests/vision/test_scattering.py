"""Vector spherical waves: identities, translations, and two spheres that scatter as one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from otwarp.vision.harmonics import bessel, legendre, tangential, wigner
from otwarp.vision.scattering import Cluster, axial_translation, frame
from otwarp.vision.specimen import Specimen
from tests.reference.pairs import ANGLES, DIFFERENTIAL, EXTINCTION, INDEX, MEDIUM, RADIUS, WAVELENGTH


@pytest.mark.quick
def test_harmonics_are_those_of_scipy() -> None:
    theta, phi = np.array([0.3, 1.4, 2.9]), np.array([0.1, 2.0, 5.0])
    p, slope, over = legendre(9, np.cos(theta))
    for n in range(1, 10):
        for m in range(n + 1):
            turn = np.exp(1j * m * phi)
            assert np.allclose(p[n, m] * turn, sph_harm_y(n, m, theta, phi), atol=1e-13)
            step = 1e-5
            difference = (sph_harm_y(n, m, theta + step, phi) - sph_harm_y(n, m, theta - step, phi)) / (2 * step)
            assert np.allclose(slope[n, m] * turn, difference, atol=1e-7)
            assert np.allclose(over[n, m], m * p[n, m] / np.sin(theta), atol=1e-12)


@pytest.mark.quick
def test_rotations_turn_harmonics() -> None:
    n, beta = 7, 1.1
    point = np.array([0.48, 0.6, 0.64])
    turn = np.array([[np.cos(beta), 0, np.sin(beta)], [0, 1, 0], [-np.sin(beta), 0, np.cos(beta)]])
    at = lambda v: np.array([sph_harm_y(n, m, np.arccos(v[2]), np.arctan2(v[1], v[0])) for m in range(-n, n + 1)])  # noqa: E731
    assert np.allclose(at(turn.T @ point), wigner(n, beta).T @ at(point), atol=1e-13)


def wave(kind: int, n: int, m: int, place: np.ndarray, *, outgoing: bool) -> np.ndarray:
    """The field M (0) or N (1) at points (p, 3), from its definition."""
    r = np.linalg.norm(place, axis=1)
    unit = place / r[:, None]
    z, slope = bessel(n, r, outgoing=outgoing)
    theta, phi = tangential(n, unit[:, 2], np.arctan2(place[:, 1], place[:, 0]))[n * n + n + m - 1]
    along, across = frame(unit)
    if kind == 0:
        return z[n][:, None] * (-phi[:, None] * along + theta[:, None] * across)
    y = sph_harm_y(n, m, np.arccos(unit[:, 2]), np.arctan2(place[:, 1], place[:, 0]))
    radial = (np.sqrt(n * (n + 1)) * z[n] / r * y)[:, None] * unit
    return radial + slope[n][:, None] * (theta[:, None] * along + phi[:, None] * across)


@pytest.mark.parametrize(("kind", "n", "m"), [(0, 1, 0), (0, 3, 2), (1, 2, -1), (1, 5, -3)])
def test_translated_waves_are_the_same_waves(kind: int, n: int, m: int) -> None:
    highest, distance = 18, 9.0
    same, other = axial_translation(highest, distance, 4.0)
    around = np.array([[0.6, 1.2, -1.0], [1.0, -0.4, 1.5], [-1.4, 0.3, 0.2]])
    column = n - max(1, abs(m))
    found = np.zeros((3, 3), dtype=complex)
    for nu, a, b in zip(
        range(max(1, abs(m)), highest + 1), same[abs(m)][:, column], other[abs(m)][:, column], strict=True
    ):
        b = b if m >= 0 else -b
        magnetic, electric = (a, b) if kind == 0 else (b, a)
        found += magnetic * wave(0, nu, m, around, outgoing=False) + electric * wave(1, nu, m, around, outgoing=False)
    wanted = wave(kind, n, m, around + np.array([0, 0, distance]), outgoing=True)
    assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()


def test_touching_spheres_obey_the_optical_theorem() -> None:
    """What is taken from the wave forward is what is scattered anywhere, for spheres that do not absorb."""
    pair = Specimen.of_spheres([[0.35, 0.1, -0.3], [-0.35, -0.1, 0.3]], np.sqrt(0.35**2 + 0.1**2 + 0.3**2), 1.55)
    cluster = Cluster(pair, 1.33, 0.55)
    incoming = np.array([[0.0, 0.0, 1.0]])
    waves = cluster.scattered(incoming, np.array([[1.0, 0.0, 0.0]]))
    forward = cluster.far_field(waves, incoming)[0, 0]
    taken = 4 * np.pi / cluster.k * forward[0].imag  # θ̂ of the z axis is x
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angles = 2 * np.pi * np.arange(80) / 80
    c, a = (v.ravel() for v in np.meshgrid(nodes, angles, indexing="ij"))
    s = np.sqrt(1 - c**2)
    far = cluster.far_field(waves, np.stack([s * np.cos(a), s * np.sin(a), c], axis=1))[0]
    scattered = np.sum(np.repeat(weights, 80) * 2 * np.pi / 80 * np.sum(np.abs(far) ** 2, axis=1))
    assert taken == pytest.approx(scattered, rel=1e-4)
    # cut at a higher order, the field hardly changes
    finer = Cluster(pair, 1.33, 0.55, highest=cluster.highest + 8)
    assert np.allclose(
        finer.far_field(finer.scattered(incoming, np.array([[1.0, 0, 0]])), incoming)[0, 0], forward, rtol=1e-3
    )


@pytest.mark.parametrize(("along", "wanted"), EXTINCTION.items())
def test_a_pair_takes_what_another_code_says(along: tuple[float, float, float], wanted: float) -> None:
    step = RADIUS * np.array(along) / np.linalg.norm(along)
    cluster = Cluster(Specimen.of_spheres([step, -step], RADIUS, INDEX), MEDIUM, WAVELENGTH)
    forward, taken, sideways = np.array([[0.0, 0.0, 1.0]]), [], []
    theta, phi = np.radians(ANGLES).T
    there = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    for axis, polarisation in enumerate(np.eye(3)[:2]):
        waves = cluster.scattered(forward, polarisation[None])
        taken.append(4.0 * np.pi / cluster.k * cluster.far_field(waves, forward)[0, 0][axis].imag)
        sideways.append(np.sum(np.abs(cluster.far_field(waves, there)[0]) ** 2, axis=1))
    assert np.mean(taken) == pytest.approx(wanted, rel=1e-5)
    assert np.mean(sideways, axis=0) == pytest.approx(DIFFERENTIAL[along], rel=3e-4)
