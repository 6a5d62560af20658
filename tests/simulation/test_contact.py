"""Contact in whole runs, by both drivers: rest, pressing, pushing, walls, adhesion; all with one feature set."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from otwarp.scene import Material
from otwarp.simulation.simulation import Simulation
from tests.reference.contact import sphere_obstacle
from tests.simulation.setups import CELL, contact_scene, drag, harmonic, line, neutral

EQUILIBRIUM = 2e-3
"""Relative error of a small overlap δ, the difference of coordinates of some µm in float32 (2e-7 of 0.05)."""

DRIVERS = ("world", "grid")


@pytest.fixture(params=DRIVERS)
def driver(request, monkeypatch) -> str:
    """Each test runs through both drivers; few bodies go to the grid driver when a world may hold none."""
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


def start(scene, driver: str, device: str, **more) -> Simulation:
    sim = Simulation(scene, device=device, allow_large_step=True, **more)
    assert sim.model.features.driver == driver
    f = sim.model.features
    assert (f.pairs, f.moving_obstacles, f.gravity, f.brownian, f.traps) == (True, True, True, True, 2)
    return sim


def places(sim: Simulation) -> np.ndarray:
    return sim.state.position.numpy().astype(float)[0]


def forces(sim: Simulation) -> tuple[np.ndarray, np.ndarray]:
    return sim.readout.contact_force.numpy().astype(float)[0], sim.readout.contact_load.numpy().astype(float)[0]


def pressed(gap: float, device: str, driver: str, *, apart: float = 0.0, **more) -> Simulation:
    """Two unequal cells held by two traps that stand `gap` nearer than touching; trap A reaches only A, B only B."""
    ra, rb = 1.5, 2.0
    stand = 0.5 * (ra + rb - gap)
    traps = (harmonic("TA", (-stand, 0, 9), cutoff=1.2), harmonic("TB", (stand, 0, 9), cutoff=1.2))
    first = neutral("A", (-stand - apart, 0, 9.0), radius=ra, material=CELL, kind="cell")
    second = neutral("B", (stand + apart, 0, 9.0), radius=rb, material=CELL, kind="cell")
    return start(contact_scene(first, second, traps=traps), driver, device, **more)


@pytest.mark.thorough
def test_third_law_while_moving(driver, device):
    """At every step of the approach, not just at rest."""
    sim = pressed(0.5, device, driver, apart=0.4, time_step=1e-4)
    worst = 0.0
    for _ in range(60):
        sim.step()
        force, _ = forces(sim)
        worst = max(worst, np.abs(force[0] + force[1]).max() / max(1.0, np.abs(force).max()))
    assert np.abs(force).max() > 1.0
    assert worst == 0.0 if driver == "world" else worst < 1e-5


def test_nothing_sinks_through_a_wall(driver, device):
    """A trap far below the floor pulls with 60 pN at a stiff bead: in 300 steps it would fall 20 µm, and sinks 3 nm."""
    hard = Material(youngs_modulus=1e6, poisson_ratio=0.4)
    pull = 60.0
    first = neutral("A", (0.0, 0.0, 1.0), material=hard)
    second = neutral("B", (30.0, 0.0, 8.0))
    traps = (harmonic("TA", (0, 0, 1.0 - pull / 20.0), cutoff=10.0), harmonic("TB", (30, 0, 8), cutoff=1.0))
    sim = start(contact_scene(first, second, traps=traps, time_step=2e-5), driver, device)
    assert 0.05 < pull / drag(1.0) * sim.time_step < 0.1
    lowest = 9.0
    for _ in range(150):
        sim.step(2)
        lowest = min(lowest, places(sim)[0, 2])
    exact = brentq(lambda d: sphere_obstacle(hard, 1.0, 1.0 - d)[0] - pull, 0, 0.1)
    assert places(sim)[0, 2] == pytest.approx(1.0 - exact, abs=2e-3)
    assert forces(sim)[0][0][2] == pytest.approx(pull, rel=2e-2)
    assert lowest > 1.0 - 0.1  # the first impact is seen one step late


@pytest.mark.thorough
def test_moving_box_pushes_a_bead(driver, device):
    """The box advances at 40 µm/s; the bead rides ahead of its face, pressed by the drag γv."""
    speed, half = 40.0, 2.0
    box = line((0.0, (0, 0, 9)), (10.0, (speed * 10, 0, 9)))
    first = neutral("A", (half + 1.0 + 0.3, 0.0, 9.0), material=CELL)
    second = neutral("B", (0.0, 50.0, 9.0))
    sim = start(contact_scene(first, second, box=box), driver, device)
    sim.step(20)
    np.testing.assert_allclose(places(sim)[0], [half + 1.3, 0, 9], atol=1e-4)  # not yet touched
    sim.run(0.5)
    push = drag(1.0) * speed
    overlap = brentq(lambda d: sphere_obstacle(CELL, 1.0, 1.0 - d)[0] - push, 0, 0.2)
    ahead = places(sim)[0, 0] - (speed * sim.time + half)
    assert ahead == pytest.approx(1.0 - overlap, abs=2e-4)
    np.testing.assert_allclose(forces(sim)[0][0], [push, 0, 0], rtol=2e-2, atol=1e-3)
    np.testing.assert_allclose(places(sim)[1], [0, 50, 9], atol=1e-4)


@pytest.mark.thorough
def test_squeezed_from_two_sides(driver, device):
    """A bead between the floor and a box that leaves 0.2 µm too little room: both push with the Hertz force of 0.1 µm.

    Nothing moves, so the time step may be as large as it likes: the stiffness times the mobility times dt is 19 here.
    """
    tight = 0.1
    first = neutral("A", (0.0, 0.0, 1.0 - tight), material=CELL)
    box = (0.0, 0.0, 2.0 - 2 * tight + 2.0)
    sim = start(contact_scene(first, neutral("B", (30.0, 0, 9.0)), box=box), driver, device)
    force = sphere_obstacle(CELL, 1.0, 1.0 - tight)[0]
    sim.step(50)
    assert places(sim)[0, 2] == pytest.approx(1.0 - tight, abs=1e-5)
    net, load = forces(sim)
    assert load[0] == pytest.approx(2 * force, rel=1e-3)
    np.testing.assert_allclose(net[0], 0.0, atol=1e-3 * force)


@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.85, 1.15], ids=["below", "above"])
def test_adhesion_holds_up_to_the_pull_off_force(share, driver, device):
    """Two sticky cells are drawn apart with `share` of the pull-off force 2πRW: they part above 1 and not below."""
    sticky = Material(youngs_modulus=2e3, poisson_ratio=0.45, adhesion=1.0, adhesion_range=0.02)
    pull_off = 2 * np.pi * 0.75 * 1.0
    place = 1.5 - 0.5 * 0.01
    first = neutral("A", (-place, 0, 9), radius=1.5, material=sticky)
    second = neutral("B", (place, 0, 9), radius=1.5, material=sticky)
    away = share * pull_off / 20.0
    path = [line((0.0, (s * place, 0, 9)), (0.4, (s * (1.5 + away), 0, 9)), (9.0, (s * (1.5 + away), 0, 9)))
            for s in (-1, 1)]  # fmt: skip
    traps = (harmonic("TA", path[0], cutoff=1.0), harmonic("TB", path[1], cutoff=1.0))
    sim = Simulation(contact_scene(first, second, traps=traps, time_step=1e-4), device=device)
    sim.run(0.45)
    apart = float(np.linalg.norm(places(sim)[0] - places(sim)[1])) - 3.0
    force = forces(sim)[0]
    if share < 1.0:
        assert apart < 0.0
        assert force[0, 0] == pytest.approx(share * pull_off, rel=0.05)
    else:
        assert apart == pytest.approx(2 * away, rel=0.02)
        np.testing.assert_array_equal(force, 0.0)
