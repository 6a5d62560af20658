"""Meshes that bodies meet: at rest where the exact shape has them rest, inside what encloses them."""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from otwarp.scene import IDENTITY, Body, Medium, Obstacle, SceneBuilder, Settings, Sphere, Track

trimesh = pytest.importorskip("trimesh")

PUSH = 2.0
"""Force on the bead [pN]."""

TUBE, LONG = 4.0, 30.0
"""Radius through the corners of a meshed tube, and its length [µm]."""

ROUNDING = 5e-6
"""Single precision at some µm, and what is left of the way after the time that is simulated [µm]."""


def builder(start: tuple[float, float, float], push: tuple[float, float, float], kelvin: float) -> SceneBuilder:
    """A bead of radius 1 that is pushed; without heat it stays where it is pushed to."""
    made = SceneBuilder(medium=Medium(temperature=kelvin), settings=Settings(duration=1.0))
    ball = Sphere(prim="/World/bead/sphere", radius=1.0)
    made.add(Body(prim="/World/bead", position=start, spheres=(ball,), forces={"external_force": push}))
    return made


def at_rest(made: SceneBuilder, device: str) -> np.ndarray:
    sim = ot.Simulation(made.scene(), device=device)
    sim.run(0.1)  # 2 pN move the bead by 120 µm/s
    return sim.state.position.numpy()[0, 0]


def tube(sides: int):
    """A closed prism about y whose lowest side is level, for the liquid in it."""
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides - 0.5 * np.pi
    ring = TUBE * np.stack([np.cos(angles), np.zeros(sides), np.sin(angles)], axis=1)
    half = np.array([0.0, 0.5 * LONG, 0.0])
    return trimesh.convex.convex_hull(np.concatenate([ring - half, ring + half]))


def indentation() -> float:
    """Of the bead before a flat rigid wall: Hertz's law, F = 4/3 E* √R δ^{3/2} [µm]."""
    material = Body(prim="/b", spheres=(Sphere(prim="/b/s", radius=1.0),)).material
    modulus = material.youngs_modulus / (1.0 - material.poisson_ratio**2)
    return (0.75 * PUSH / modulus) ** (2.0 / 3.0)


def test_a_bead_rests_on_a_meshed_plane_as_on_the_plane(device: str) -> None:
    exact = builder((0.3, 0.2, 1.2), (0.0, 0.0, -PUSH), 0.0)
    place, turn = Track.constant((0.0, 0.0, 0.0)), Track.constant(IDENTITY)
    exact.add(Obstacle(prim="/World/floor", shape="plane", position=place, orientation=turn))
    meshed = builder((0.3, 0.2, 1.2), (0.0, 0.0, -PUSH), 0.0)
    slab = trimesh.creation.box((40.0, 40.0, 4.0)).subdivide().subdivide()
    meshed.add_mesh("/World/floor", slab, position=(0.0, 0.0, -2.0))
    there = at_rest(exact, device)
    np.testing.assert_allclose(at_rest(meshed, device), there, atol=ROUNDING)
    assert there[2] == pytest.approx(1.0 - indentation(), abs=ROUNDING)


def test_the_error_of_a_meshed_tube_is_that_of_its_facets(device: str) -> None:
    """Flat sides lie R (1 − cos π/n) within the circle: a quarter for twice as many."""
    errors = []
    for sides in (8, 16, 32):
        made = builder((0.0, 0.0, 1.0 - TUBE * np.cos(np.pi / sides) + 0.2), (0.0, 0.0, -PUSH), 0.0)
        made.add_mesh("/World/tube", tube(sides), kind="chamber")
        errors.append(at_rest(made, device)[2] - (1.0 - TUBE - indentation()))
        assert errors[-1] == pytest.approx(TUBE * (1.0 - np.cos(np.pi / sides)), abs=ROUNDING)
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.04)


def test_a_hot_bead_stays_in_its_tube(device: str) -> None:
    made = builder((0.0, 0.0, 0.0), (10.0, 0.0, -10.0), 300.0)
    made.add_mesh("/World/tube", tube(16), kind="chamber")
    sim = ot.Simulation(made.scene(), worlds=64, seed=3, device=device)
    for _ in range(5):
        sim.run(0.05)
        place = sim.state.position.numpy()[:, 0]
        # a side gives way by less than 0.01 µm at 14 pN
        assert np.hypot(place[:, 0], place[:, 2]).max() < TUBE - 1.0 + 0.01
    assert np.ptp(place[:, 1]) > 0.5  # along the tube they diffuse
