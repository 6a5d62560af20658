"""Space that repeats: what happens across a boundary of the cell is what happens inside it, in every driver."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Flow, Medium, Obstacle, Scene, Settings, Vec3
from otwarp.simulation.simulation import Simulation
from tests.reference.contact import sphere_pair
from tests.simulation.crowds import SOFT, crowd, jumbled, places
from tests.simulation.setups import (
    CELL,
    COLD,
    ENERGY,
    VISCOSITY,
    bead_scene,
    drag,
    harmonic,
    neutral,
    obstacle,
    sphere_body,
)
from tests.simulation.test_checkpoint import authored

DRIVERS = ("world", "grid")

ROUNDING = 1e-5
"""Of a contact force of 1 pN whose overlap is the difference of coordinates of 20 µm in float32 [pN]."""

PERIOD: Vec3 = (24.0, 24.0, 0.0)
"""Long enough for the cells of the grid driver."""

SHIFTS = ((0.0, 0.0, 0.0), (12.2, 0.0, 0.0), (-11.0, 12.5, 0.0), (10.9, 11.3, 0.0), (48.0, -24.0, 0.0))
"""Where the pair is put: inside, across a face, across an edge, with the obstacle on the other side, far outside."""


@pytest.fixture(params=DRIVERS)
def driver(request, monkeypatch) -> str:
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


def squeezed(shift: Vec3 = (0.0, 0.0, 0.0), period: Vec3 = PERIOD) -> Scene:
    """A trap pulls A onto B, which leans on a ball and on a wall that goes through the whole cell along x."""

    def at(x: float, y: float = 0.0) -> Vec3:
        return (x + shift[0], y + shift[1], 3.0 + shift[2])

    wall = obstacle("Wall", "box", at(5.0, -4.0), (20.0, 3.05, 2.0))
    return Scene(
        medium=Medium(temperature=COLD, viscosity=VISCOSITY),
        bodies=tuple(
            neutral(name, at(x), material=CELL, kind="cell") for name, x in (("A", -1.0), ("B", 0.9))
        ),
        traps=(harmonic("Trap", at(-0.5), cutoff=1.2),),
        obstacles=(obstacle("Ball", "sphere", at(3.3), (1.5, 0.0, 0.0)), wall),
        settings=Settings(time_step=2e-4, period=period),
    )  # fmt: skip


def outcome(scene: Scene, driver: str, device: str) -> dict[str, np.ndarray]:
    """Forces and moves after ten steps."""
    sim = Simulation(scene, device=device, allow_large_step=True)
    assert sim.model.features.driver == driver
    start = sim.unwrapped_position()[0]
    sim.step(10)
    inside = places(sim)[0]
    length = np.array(scene.settings.period)
    assert np.all(np.abs(inside[:, length > 0.0]) <= 0.5 * length[length > 0.0])
    return {
        "force": sim.readout.contact_force.numpy()[0],
        "load": sim.readout.contact_load.numpy()[0],
        "trap": sim.readout.trap_force.numpy()[0],
        "distance": sim.readout.trap_distance.numpy()[0],
        "move": sim.unwrapped_position()[0] - start,
        "escape": sim.readout.escape_step.numpy(),
    }


@pytest.fixture(scope="module")
def inside(device) -> dict[str, dict[str, np.ndarray]]:
    """Outcomes where nothing is across a boundary, by driver; filled by the first test that asks."""
    return {}


@pytest.mark.parametrize("shift", SHIFTS[1:])
def test_contact_across_a_boundary_is_contact_inside(shift, driver, inside, device):
    """The scene moved by a part of the period has the same forces, whoever meets across what."""
    wanted = inside.setdefault(driver, outcome(squeezed(), driver, device))
    assert wanted["load"].min() > 1.0
    for name, value in outcome(squeezed(shift), driver, device).items():
        # contact forces on a sphere between two others all but cancel: what is left is no rounder than each of them
        size = max(1.0, wanted["load"].max()) if name == "force" else 1.0
        np.testing.assert_allclose(value, wanted[name], rtol=2e-4, atol=20 * ROUNDING * size, err_msg=name)


def test_inside_the_cell_is_open_space(device):
    """Bit for bit: images at home have no shift."""
    wanted = outcome(squeezed(period=(0.0, 0.0, 0.0)), "world", device)
    for name, value in outcome(squeezed(), "world", device).items():
        assert np.array_equal(value, wanted[name]), name


SIDE = 11.4
"""Six spheres of the crowd in a row fill this [µm]."""


def test_soft_crowd_feels_all_nearest_images(device):
    """Cold, one step of 216 spheres in a cell that they fill: Δx = F·dt/6πηa with F summed over nearest images."""
    where = jumbled(216)
    scene = crowd(where, time_step=8e-4)
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, period=(SIDE,) * 3))
    sim = Simulation(scene, device=device, integrator="eulerMaruyama", allow_large_step=True)
    assert sim.model.features.soft_contacts
    sim.step()
    net = np.zeros((216, 3))
    across = 0
    for i in range(216):
        way = where[i] - where
        image = way - SIDE * np.rint(way / SIDE)
        for j in np.flatnonzero(np.linalg.norm(image, axis=1) < 2.0):
            if j != i:
                distance = float(np.linalg.norm(image[j]))
                net[i] += sphere_pair(SOFT, 1.0, SOFT, 1.0, distance)[0] * image[j] / distance
                across += bool(np.any(image[j] != way[j]))
    assert across > 100
    move = sim.unwrapped_position()[0] - where.astype(np.float32)
    np.testing.assert_allclose(move, net * 8e-4 / drag(1.0), rtol=1e-4, atol=5e-6)


def test_soft_crowd_does_not_know_where_the_cell_begins(device):
    """300 steps over several lists: the crowd moved by a third of the period goes where it went."""
    where = jumbled(216)
    moves = []
    for shift in (0.0, SIDE / 3.0):
        scene = crowd(where + shift, time_step=8e-4)
        scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, period=(SIDE,) * 3))
        sim = Simulation(scene, device=device, integrator="eulerMaruyama", allow_large_step=True)
        start = sim.unwrapped_position()
        sim.step(300)
        moves.append(sim.unwrapped_position() - start)
    assert np.abs(moves[0]).max() > 0.05
    np.testing.assert_allclose(moves[1], moves[0], rtol=0.0, atol=2e-4)


SPEED = 50.0


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_unwrapped_displacement_in_a_flow(precision, device):
    """Mean U·t and variance 2Dt of 4096 beads that go round a short cell: standard errors √(2Dt/n) and √(2/3n)."""
    worlds, steps, dt = 4096, 200, 1e-3
    scene = dataclasses.replace(
        bead_scene(time_step=dt),
        bodies=(sphere_body("Bead", (0.4, 0.0, 0.0), trapped=False),),
        traps=(),
        flow=Flow(prim="/World/Flow", kind="uniform", speed=SPEED),
        settings=Settings(time_step=dt, period=(3.0, 5.0, 0.0)),
    )
    sim = Simulation(scene, worlds=worlds, seed=5, device=device, precision=precision)
    sim.step(steps)
    image = sim.state.image.numpy()
    assert image[..., 0].min() >= 2 and not image[..., 2].any()
    moved = sim.unwrapped_position()[:, 0] - np.array([0.4, 0.0, 0.0])
    variance = 2.0 * ENERGY / drag(1.0) * steps * dt
    mean = moved.mean(axis=0) - np.array([SPEED * steps * dt, 0.0, 0.0])
    assert np.all(np.abs(mean) < 5.0 * np.sqrt(variance / worlds))
    ratio = moved.var(axis=0).mean() / variance
    assert abs(ratio - 1.0) < 5.0 * np.sqrt(2.0 / (3 * worlds))


def test_a_checkpoint_keeps_the_images(tmp_path, device):
    scene = authored(squeezed(SHIFTS[1]), tmp_path / "pair.usda")
    assert scene.settings.period == PERIOD
    sim = Simulation(scene, device=device, allow_large_step=True)
    sim.step(50)
    again = Simulation.restore(sim.save(tmp_path / "half.npz"), device=device)
    for one in (sim, again):
        one.step(50)
    assert sim.state.image.numpy().any()
    assert np.array_equal(sim.unwrapped_position(), again.unwrapped_position())


def test_a_state_set_from_outside_is_put_into_the_cell(device):
    sim = Simulation(squeezed(), device=device, allow_large_step=True)
    asked = np.array([[100.0, -45.0, 3.0], [0.5, 13.0, 3.0]])
    sim.set_state(position=asked)
    np.testing.assert_allclose(sim.unwrapped_position()[0], asked, atol=1e-5)
    assert np.all(np.abs(places(sim)[0, :, :2]) <= 12.0)
    sim.step()
    np.testing.assert_allclose(sim.unwrapped_position()[0], asked, atol=0.01)


def test_bodies_that_overlap_across_a_boundary_are_refused(device):
    scene = squeezed(SHIFTS[1])
    first = dataclasses.replace(scene.bodies[0], position=(-11.99, 0.0, 3.0))
    second = dataclasses.replace(scene.bodies[1], position=(11.99, 0.0, 3.0))
    with pytest.raises(ValueError, match=r"overlap with /World/A = 1\.98 µm"):
        Simulation(dataclasses.replace(scene, bodies=(first, second)), device=device)


def bar(turn: float, half: float) -> Obstacle:
    """A box turned about z."""
    q = (0.0, 0.0, float(np.sin(0.5 * turn)), float(np.cos(0.5 * turn)))
    return obstacle("Bar", "box", (0.0, 0.0, 30.0), (half, 1.0, 1.0), q)


ACROSS = (0.0, 0.5**0.5, 0.0, 0.5**0.5)
SHEAR = Flow(prim="/World/F", kind="shear", shear_rate=1.0)
REFUSED = {
    "negative": ({"period": (-1.0, 0.0, 0.0)}, {}, "ot:scene:period = .* at least 0 m along x"),
    "short": ({"period": (4.0, 0.0, 0.0)}, {}, "0 or at least 4.4e-06 m along x"),
    "coupled": ({"coupling": True}, {}, "with ot:scene:hydrodynamicCoupling"),
    "plane": ({}, {"obstacles": (obstacle("P", "plane", (0, 0, 0), turn=ACROSS),)}, "parallel to x"),
    "ends": ({}, {"obstacles": (bar(0.0, 11.5),)}, "extent = -11.5 … 11.5 µm: must be within 10.9 µm"),
    "slanted": ({}, {"obstacles": (bar(0.3, 40.0),)}, "straight along it from -13.1 to 13.1 µm"),
    "flow": ({"period": (0.0, 0.0, 24.0)}, {"flow": SHEAR}, "vary along z"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_repeat_is_refused(case):
    settings, more, message = REFUSED[case]
    scene = dataclasses.replace(squeezed(), **{"obstacles": (), "traps": (), **more})
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, **settings))
    with pytest.raises(ValueError, match=message):
        scene.check()


def test_the_cells_of_a_crowd_need_room(device):
    scene = crowd(jumbled(27), time_step=8e-4)
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, period=(8.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match=r"ot:scene:period = 8e-06 m along x; allowed: 0, or at least .* many-body"):
        Simulation(scene, device=device, integrator="eulerMaruyama", allow_large_step=True)
