"""Hydrodynamic walls in whole runs: diffusion at a height, Boltzmann's distribution above a wall, contact, flow.

Bounds of statistical tests are five standard errors, with an allowance for the error of the time step where it matters;
seeds are fixed.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.hydrodynamics.bispherical import wall_resistance
from otwarp.kernels.core.features import Features
from otwarp.scene import Body, Flow, Medium, Obstacle, Quat, Rod, Scene, Settings
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from tests.kernels.test_step import source
from tests.reference import walls as reference
from tests.simulation.setups import ENERGY, VISCOSITY, drag, harmonic, obstacle, robot, sphere_body

SIGMAS = 5.0
FIT = 5e-3
"""Error that the fits of the resistances may have; they are far better."""
UNIT = ENERGY / drag(1.0)
"""Diffusion coefficient of a free sphere of 1 µm [µm²/s]."""


def wall(name: str = "Floor", position=(0.0, 0.0, 0.0), turn: Quat = (0.0, 0.0, 0.0, 1.0), shape="plane") -> Obstacle:
    return dataclasses.replace(obstacle(name, shape, position, (1.0, 1.0, 1.0), turn), hydrodynamic=True)


CHILLED = 1e-3
"""Temperature [K] at which noise is 2e-3 of that at 298 K, and still more than the rounding of coordinates."""

CEILING: Quat = (1.0, 0.0, 0.0, 0.0)
"""Turn about x that points a plane down."""


def density_for(length: float, volume: float) -> float:
    """Density [pN·s²/µm⁴] at which the weight of `volume` is k_B T/`length`."""
    return Medium().density + ENERGY / length / (volume * STANDARD_GRAVITY)


def heavy_bead(length: float, *, dt: float | None, **more) -> Scene:
    """A sphere of 1 µm above a wall, e^{−gap/length} high in equilibrium."""
    body = sphere_body("Bead", (0.0, 0.0, 1.5), density=density_for(length, 4 / 3 * np.pi), trapped=False, **more)
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(body,),
        obstacles=(wall(),),
        settings=Settings(gravity=True, time_step=dt),
    )


def start_at(sim: Simulation, height: np.ndarray) -> None:
    """Put the one body of each world at a height."""
    place = sim.state.position.numpy().astype(float)
    place[:, 0, 2] = height
    sim.set_state(position=place)


def touching_bead(dt: float | None) -> Scene:
    """A heavy bead that collides with its wall, and a trap on it."""
    scene = heavy_bead(0.2, dt=dt, collides=True)
    bead = dataclasses.replace(
        scene.bodies[0], spheres=(dataclasses.replace(scene.bodies[0].spheres[0], trapped=True),)
    )
    return dataclasses.replace(scene, bodies=(bead,), traps=(harmonic("Trap", (0.0, 0.0, 0.5), power=0.0),))


def test_a_sphere_pressed_on_a_wall(device):
    """Contact carries what the trap presses with, however slowly the liquid lets the sphere come down.

    The mobility of a sphere in contact is 1e-4 of 60 µm/s/pN; what is left of the approach after 0.1 s, and noise, are
    below a thousandth.
    """
    sim = Simulation(
        touching_bead(1e-4),
        device=device,
        parameters={"medium_temperature": CHILLED, "trap_power": 20.0, "trap_position": (0, 0, 0.5)},
    )
    start_at(sim, np.array([1.001]))
    sim.run(0.1)
    height = float(sim.state.position.numpy()[0, 0, 2])
    load = 20.0 * (height - 0.5) + ENERGY / 0.2
    assert height == pytest.approx(1.0, abs=2e-3)
    assert float(sim.readout.contact_load.numpy()[0, 0]) == pytest.approx(load, rel=2e-3)


def channel(dt: float, **more) -> Scene:
    """A light sphere between plates at 0 and 3 µm with Poiseuille flow."""
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(sphere_body("Bead", (0.0, 0.0, 1.5), trapped=False),),
        obstacles=(wall(), wall("Ceiling", (0.0, 0.0, 3.0), CEILING)),
        flow=Flow(prim="/World/Flow", kind="poiseuille", origin=(0.0, 0.0, 1.5), half_height=1.5, speed=10.0, **more),
        settings=Settings(time_step=dt),
    )


def test_channel(device):
    """Between two plates all heights are equally likely; standard error of each eighth 2.6 %, 5 % off by the step.

    Cold, the sphere follows the flow as the twin says.
    """
    worlds, step = 10_000, 0.003 / UNIT
    sim = Simulation(channel(step), worlds=worlds, seed=25, device=device)
    start_at(sim, 1.0 + np.random.default_rng(3).uniform(0.0, 1.0, worlds))
    # half a micrometre by diffusion at a tenth of the free mobility
    sim.run(0.5**2 / (0.2 * UNIT))
    counts = np.histogram(sim.state.position.numpy()[:, 0, 2], np.linspace(1.0, 2.0, 9))[0]
    assert counts.sum() == worlds
    np.testing.assert_allclose(counts, worlds / 8, rtol=SIGMAS * np.sqrt(7 / worlds) + 0.05)

    cold = Simulation(channel(step), worlds=3, device=device, parameters={"medium_temperature": CHILLED})
    start_at(cold, np.array([1.02, 1.3, 1.5]))
    before = cold.state.position.numpy().astype(float)
    cold.step(50)
    speed = (cold.state.position.numpy() - before)[:, 0, 0] / (50 * step)
    plates = (np.array([[0.0, 0, 1], [0.0, 0, -1]]), np.array([0.0, -3.0]))
    for z, found in zip((1.02, 1.3, 1.5), speed, strict=True):
        flow = np.array([10.0 * (1.0 - ((z - 1.5) / 1.5) ** 2), 0.0, 0.0])
        mean = flow - [10.0 / (3.0 * 1.5**2), 0.0, 0.0]  # a²/6 ∇²u
        expected = reference.sphere_carried(np.array([0, 0, z]), 1.0, plates, flow, mean)[0]
        assert found == pytest.approx(expected, rel=1e-3)


def dimer(dt: float | None, *, length: float = 1.0) -> Scene:
    """Two touching spheres of 1 µm, e^{−height/length} high in equilibrium."""
    pair = (((0.0, 0.0, -1.0), 1.0), ((0.0, 0.0, 1.0), 1.0))
    body = robot("Dimer", (0.0, 0.0, 3.0), shape=pair, trapped=False)
    body = dataclasses.replace(body, density=density_for(length, 8 / 3 * np.pi))
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(body,),
        obstacles=(wall(),),
        settings=Settings(gravity=True, time_step=dt),
    )


def test_a_rigid_sphere_in_shear_above_a_wall(device):
    """A body of one sphere, by its 6×6 resistance, follows the flow as the exact solution for a free sphere says."""
    gap, rate = 0.1, 4.0
    ball = sphere_body("Bead", (0.0, 0.0, 1.0 + gap), trapped=False)
    free = np.diag([1.0 / (6.0 * np.pi)] * 3 + [1.0 / (8.0 * np.pi)] * 3)
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(dataclasses.replace(ball, mobility=tuple(free.ravel())),),
        obstacles=(wall(),),
        flow=Flow(prim="/World/Flow", kind="shear", shear_rate=rate),
        settings=Settings(time_step=1e-3, brownian=False),
    )
    sim = Simulation(scene, device=device)
    sim.step(20)
    speed = sim.state.position.numpy()[0, 0].astype(float) / 0.02
    exact = wall_resistance(gap)
    carried = exact.shear_force * (1.0 + gap) + exact.coupling * exact.shear_torque / (2.0 * exact.roll)
    assert speed[0] == pytest.approx(rate * carried / exact.sliding, rel=FIT)
    turned = 2.0 * float(sim.state.orientation.numpy()[0, 0, 1]) / 0.02
    spin = (0.75 * exact.coupling * speed[0] + 0.5 * rate * exact.shear_torque) / exact.roll
    assert turned == pytest.approx(spin, rel=FIT)


def crowd(count: int) -> Scene:
    """Beads in a row that never touch, above a wall that they could touch."""
    bodies = tuple(sphere_body(f"B{i}", (5.0 * i, 0.0, 1.05), trapped=False, collides=True) for i in range(count))
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=bodies,
        obstacles=(wall(),),
        settings=Settings(time_step=1e-3, integrator="eulerMaruyama"),
    )


def test_both_drivers_take_the_same_steps(device):
    """24 beads by the world driver and the first 24 of 25 by the grid driver, to the rounding of 120 µm in float32."""
    few, many = (Simulation(crowd(n), seed=5, device=device) for n in (24, 25))
    assert (few.model.features.driver, many.model.features.driver) == ("world", "grid")
    few.step(5)
    many.step(5)
    np.testing.assert_allclose(few.state.position.numpy()[0], many.state.position.numpy()[0, :24], atol=5e-5)


def test_nothing_crosses_a_wall_that_nothing_else_stops(device):
    """A sphere that does not collide, thrown at the wall with a hundred times the right step, stays in front of it."""
    scene, step = heavy_bead(0.01, dt=1.0), 0.3 / UNIT
    sim = Simulation(scene, worlds=500, seed=8, device=device, time_step=step, allow_large_step=True)
    for _ in range(20):
        sim.step()
        assert sim.state.position.numpy()[:, 0, 2].min() >= 1.0 - 1e-6


def test_a_scene_without_walls_has_none(device):
    """Neither in the source of its step nor in its memory."""
    names = ("height_above", "frictions", "out_of_walls", ").walls)", "inverse_root")
    plain = source(Features(rigid=True))
    assert [n for n in names if n in plain] == []
    assert [n for n in names if n not in source(Features(rigid=True, walls=1, integrator="eulerMaruyama"))] == []
    scene = dataclasses.replace(heavy_bead(1.0, dt=1e-3), obstacles=(obstacle("Floor", "plane", (0, 0, 0)),))
    model = Model.build(scene, device=device)
    assert model.features.walls == 0
    assert model.data.walls.normal.shape == model.data.walls.sphere.shape == (0,)
    assert model.scales.wall is None


@pytest.mark.parametrize(("wanted", "used"), [("heun", "heun"), ("eulerMaruyama", "eulerMaruyama"),
                                              ("leimkuhlerMatthews", "heun"), ("exponential", "heun")])  # fmt: skip
def test_integrators_near_walls(wanted, used, device):
    scene = heavy_bead(1.0, dt=1e-3)
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, integrator=wanted))
    about = describe(scene, device=device)
    assert about["time_scales"]["integrator"] == used
    assert ("walls" in about["integrator_reason"]) == (wanted != used)


def test_the_step_follows_radius_and_weight(device):
    """½·accuracy of the time to diffuse a radius, or to fall by one if that is shorter."""
    for length, shorter in ((10.0, 1.0), (0.2, 0.2)):
        scales = Model.build(heavy_bead(length, dt=None), device=device).scales
        assert scales.wall == pytest.approx(shorter / UNIT, rel=1e-6)
    light = Model.build(heavy_bead(10.0, dt=None), device=device)
    # the interval between frames is shorter for a sphere of 1 µm
    assert light.scales.chosen_by == "frame interval"


BEHIND = sphere_body("Bead", (0.0, 0.0, -0.1))


@pytest.mark.parametrize(
    ("change", "allowed"),
    [
        ({"obstacles": (wall(shape="box", position=(0, 0, -5)),)}, "false on a Cube, true on a Plane"),
        ({"obstacles": (dataclasses.replace(wall(), position=obstacle("F", "plane", (0, 0, 0)).position.__class__(
            times=np.array([0.0, 1.0]), values=np.array([[0, 0, 0], [0, 0, 0.1]]))),)}, "false on an obstacle"),
        ({"bodies": (BEHIND,)}, "it starts at a height of -0.1 µm"),
        ({"flow": Flow(prim="/World/Flow", kind="uniform", speed=1.0)}, "uniform flow stands still nowhere"),
        ({"flow": Flow(prim="/World/Flow", kind="shear", shear_rate=1.0, origin=(0, 0, 0.1))}, "at 0 of the prim's"),
        ({"flow": Flow(prim="/World/Flow", kind="poiseuille", speed=1.0, half_height=2.0)}, "stands still at ±2 µm"),
    ],
)  # fmt: skip
def test_what_walls_do_not_go_with(change, allowed, device):
    """One line with file or root, prim, attribute, value and what is allowed."""
    with pytest.raises(InputError) as error:
        Model.build(dataclasses.replace(heavy_bead(1.0, dt=1e-3), **change), device=device)
    text = str(error.value)
    assert text.startswith(("/World: /World/F", "Scene: /World/F"))
    assert "ot:obstacle:hydrodynamic = true: must be " in text.replace("True", "true")
    assert allowed in text
    assert "\n" not in text


def test_rods_stand_as_rows_of_spheres(device):
    """Seven along a rod of six diameters, less the middle one inside the sphere, and the sphere."""
    rod = Rod(prim="/World/R/Rod", start=(-3.0, 0.0, 0.0), end=(3.0, 0.0, 0.0), radius=0.5)
    body: Body = dataclasses.replace(robot("R", (0.0, 0.0, 2.0), shape=(((0, 0, 0), 1.0),)), rods=(rod,))
    scene = dataclasses.replace(dimer(1e-3), bodies=(body,))
    model = Model.build(scene, device=device)
    assert model.data.walls.sphere.shape == (7,)


def test_contacts_near_a_wall_move_both_drivers_alike(device):
    """Two beads that overlap at a slant, one next to the wall: its own mobility, not that along the contact, moves it.

    The world driver takes a line for Hertz's law, good to 1e-3 of the radius: 2.4 % of this force.
    """
    moved = []
    for others in (22, 23):
        places = [(0.0, 0.0, 1.02), (1.6, 0.0, 2.2), *((10.0 * (i + 1), 0.0, 5.0) for i in range(others))]
        bodies = [sphere_body(f"B{i}", p, collides=True, trapped=False) for i, p in enumerate(places)]
        # as many bodies as in `crowd`, and noise of 1e-10 µm: the same kernels
        settings = Settings(time_step=1e-4, integrator="eulerMaruyama")
        medium = Medium(viscosity=VISCOSITY, temperature=1e-16)
        scene = Scene(medium=medium, bodies=tuple(bodies), obstacles=(wall(),), settings=settings)
        sim = Simulation(scene, device=device)
        assert sim.model.features.driver == ("grid" if others == 23 else "world")
        before = sim.state.position.numpy()[0, :2].astype(float)
        sim.step()
        moved.append(sim.state.position.numpy()[0, :2] - before)
    np.testing.assert_allclose(moved[1], moved[0], atol=0.04 * np.abs(moved[0]).max())
    # down by μ⊥ sin, not by what it moves along the contact
    assert abs(moved[0][0, 2]) < 0.1 * abs(moved[0][0, 0])
