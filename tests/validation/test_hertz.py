"""Cells and beads at rest in contact: Hertz's law balances weight and traps, by both drivers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import root_scalar

from otwarp.scene import Material, Medium
from otwarp.units import STANDARD_GRAVITY
from tests.reference.contact import sphere_obstacle, sphere_pair
from tests.simulation.setups import CELL, contact_scene, sphere_body
from tests.simulation.test_contact import EQUILIBRIUM, forces, places, pressed, start

FORCE = 1e-3
"""Relative error of a contact force at rest, that of its overlap times 3/2."""

ROUNDING = 2e-7
"""Of an overlap, the difference of coordinates of 1 to 9 µm in float32 [µm]."""


@pytest.fixture(params=["world", pytest.param("grid", marks=pytest.mark.thorough)])
def driver(request, monkeypatch) -> str:
    """Few bodies go to the driver of crowds when a world may hold none."""
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


def balance(excess: Callable[[float], float], most: float) -> float:
    """Overlap at which no force is left [µm]."""
    return float(root_scalar(excess, bracket=(0.0, most)).root)


@pytest.mark.thorough
def test_rest_on_the_floor(expect_law, driver, device):
    """Under its weight a bead sinks into the floor until Hertz repulsion carries it; two materials.

    Source: Hertz 1882, doi:10.1515/crll.1882.92.156; Johnson 1985, Contact Mechanics, doi:10.1017/CBO9781139171731.
    """
    soft = Material(youngs_modulus=50.0, poisson_ratio=0.3)
    first = sphere_body("A", (0, 0, 1.0), collides=True, density=4000e-12, material=soft)
    second = sphere_body("B", (9.0, 0, 1.5), radius=1.5, collides=True, density=1500e-12, material=CELL)
    sim = start(contact_scene(first, second), driver, device)
    sim.step(8000)
    force, load = forces(sim)
    for b, body in enumerate((first, second)):
        r = body.spheres[0].radius
        weight = (body.density - Medium().density) * 4 / 3 * np.pi * r**3 * STANDARD_GRAVITY
        overlap = balance(lambda d, r=r, m=body.material, w=weight: sphere_obstacle(m, r, r - d)[0] - w, 0.4)
        found = r - places(sim)[b, 2]
        name = f"{driver}: {'bead of 50 Pa' if b == 0 else 'cell of 2 kPa'}"
        expect_law(f"{name}, overlap with the floor [µm]", found, overlap, ROUNDING, bias=EQUILIBRIUM * overlap)
        expect_law(f"{name}, force of the floor over the weight", force[b] / weight, [0, 0, 1], 1e-4, bias=FORCE)
        expect_law(f"{name}, load over the weight", load[b] / weight, 1.0, 1e-4, bias=FORCE)


@pytest.mark.thorough
def test_pressed_cells(expect_law, driver, device):
    """Two unequal cells held by two traps: at rest the pull K·(gap − δ)/2 is the Hertz force of the overlap δ.

    Source: Hertz 1882, doi:10.1515/crll.1882.92.156, with the reduced radius and modulus of the pair.
    """
    gap = 0.3
    sim = pressed(gap, device, driver)
    sim.step(4000)
    (xa, xb), (force, load) = places(sim), forces(sim)
    exact = balance(lambda d: sphere_pair(CELL, 1.5, CELL, 2.0, 3.5 - d)[0] - 20.0 * 0.5 * (gap - d), gap)
    overlap = 3.5 - np.linalg.norm(xa - xb)
    expect_law(f"{driver}: overlap of the cells [µm]", overlap, exact, ROUNDING, bias=EQUILIBRIUM * exact)
    pull = 20.0 * 0.5 * (gap - exact)
    expect_law(f"{driver}: contact force over the pull", force[0] / pull, [-1, 0, 0], 1e-4, bias=FORCE)
    held = sim.readout.trap_force.numpy()[0]
    expect_law(f"{driver}: trap and contact force over the pull", (held + force) / pull, 0.0, 1e-4, bias=FORCE)
    expect_law(f"{driver}: sum of both contact forces over the pull", (force[0] + force[1]) / pull, 0.0, 2e-5)
    if driver == "world":
        np.testing.assert_array_equal(force[0], -force[1])
        assert load[0] == load[1]
