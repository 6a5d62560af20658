"""Hydrodynamic walls in whole runs: diffusion at a height, Boltzmann's distribution above a wall, contact, flow.

Bounds of statistical tests are five standard errors, with an allowance for the error of the time step where it matters;
seeds are fixed.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad

from otwarp.errors import InputError
from otwarp.hydrodynamics.bispherical import wall_resistance
from otwarp.kernels.features import Features
from otwarp.scene.description import Body, Flow, Medium, Obstacle, Quat, Rod, Scene, Settings
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from otwarp.wall_fits import CONTACT_GAP, NORMAL
from tests.reference import walls as reference
from tests.simulation.setups import ENERGY, VISCOSITY, drag, harmonic, obstacle, robot, sphere_body
from tests.simulation.test_skipping import source

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


@pytest.mark.parametrize("gap", [0.02, 0.3, 3.0])
def test_diffusion_at_a_height(gap, device):
    """One short step of 40 000 worlds: ⟨Δx²⟩ = 2D∥dt and ⟨Δz²⟩ = 2D⊥dt by the exact resistances, ⟨Δz⟩ = D⊥' dt.

    Standard errors: of variances √(2/40000) = 0.7 %, along the wall less by √2; of the drift √(2D⊥dt/40000). The step
    is short beside g²/D⊥, so that the square of the drift, and the variance of its factor, add less than 0.5 %.
    """
    worlds = 40_000
    exact = wall_resistance(gap)
    step = 0.005 * gap**2 * exact.normal / UNIT
    sim = Simulation(heavy_bead(1e3, dt=step), worlds=worlds, seed=21, device=device)
    start_at(sim, np.full(worlds, 1.0 + gap))
    before = sim.state.position.numpy().astype(float)
    sim.step()
    move = (sim.state.position.numpy() - before)[:, 0]
    variance = 2.0 * UNIT * step
    error = SIGMAS * np.sqrt(2.0 / worlds) + FIT
    assert (move[:, :2] ** 2).mean() == pytest.approx(variance / exact.sliding, rel=error)
    assert move[:, 2].var() == pytest.approx(variance / exact.normal, rel=error + 5e-3)
    slope = (1.0 / wall_resistance(gap * 1.001).normal - 1.0 / wall_resistance(gap * 0.999).normal) / (0.002 * gap)
    drift = UNIT * step * (slope - 1e-3 / exact.normal)
    assert move[:, 2].mean() == pytest.approx(
        drift, abs=SIGMAS * np.sqrt(variance / exact.normal / worlds) + FIT * drift
    )


def mean_gap(length: float, power: float) -> float:
    """Mean of the density e^{−g/length} μ⊥(g)^power above a wall."""

    def moment(n: int) -> float:
        def weight(g: float) -> float:
            return g**n * np.exp(-g / length) * (1.0 + float(NORMAL(g)[0])) ** -power

        inner = quad(weight, 0.0, CONTACT_GAP)[0] + quad(weight, CONTACT_GAP, 0.01 * length, limit=200)[0]
        return inner + quad(weight, 0.01 * length, 40.0 * length, limit=200)[0]

    return moment(1) / moment(0)


def check_heights(sim: Simulation, length: float, bias: float) -> None:
    """Mean gap, and how many spheres are within 0.1 and 1 lengths of the wall, for independent worlds."""
    worlds = sim.model.worlds
    gap = sim.state.position.numpy()[:, 0, 2].astype(float) - 1.0
    assert gap.mean() == pytest.approx(length, rel=SIGMAS / np.sqrt(worlds) + bias)
    for part in (0.1, 1.0):
        share = 1.0 - np.exp(-part)
        error = SIGMAS * np.sqrt((1.0 - share) / share / worlds)
        assert (gap < part * length).mean() == pytest.approx(share, rel=error + 2.0 * bias)


@pytest.mark.parametrize("integrator", ["heun", "eulerMaruyama"])
def test_heights_above_a_wall(integrator, device):
    """Boltzmann's distribution stays what it is over five relaxation times; standard error of the mean 1 %.

    Without the thermal drift the density would be e^{−g/ℓ}/μ⊥, and the mean gap a sixth of what it is.
    """
    length, worlds = 0.2, 10_000
    step = 0.003 / UNIT
    sim = Simulation(heavy_bead(length, dt=step), worlds=worlds, seed=22, device=device, integrator=integrator)
    start_at(sim, 1.0 + np.random.default_rng(1).exponential(length, worlds))
    relaxation = length**2 * wall_resistance(length).normal / UNIT
    sim.run(5.0 * relaxation)
    # the step is three times the chosen one: 2 % within a tenth of a length
    check_heights(sim, length, 0.01)
    without_drift = mean_gap(length, -1.0)
    assert mean_gap(length, 0.0) == pytest.approx(length, rel=1e-6)
    assert without_drift < length * (1.0 - 10.0 * (SIGMAS / np.sqrt(worlds) + 0.01))


@pytest.mark.validate
def test_heights_above_a_wall_precisely(device):
    """From one height to Boltzmann's distribution with the chosen step; standard error of the mean 0.5 %."""
    length, worlds = 0.2, 40_000
    sim = Simulation(heavy_bead(length, dt=None), worlds=worlds, seed=23, device=device)
    assert sim.model.scales.chosen_by == "motion near hydrodynamic walls and wanted accuracy"
    sim.run(8.0 * length**2 * wall_resistance(length).normal / UNIT)
    check_heights(sim, length, sim.scene.settings.accuracy / 2.0)


def touching_bead(dt: float | None) -> Scene:
    """A heavy bead that collides with its wall, and a trap on it."""
    scene = heavy_bead(0.2, dt=dt, collides=True)
    bead = dataclasses.replace(
        scene.bodies[0], spheres=(dataclasses.replace(scene.bodies[0].spheres[0], trapped=True),)
    )
    return dataclasses.replace(scene, bodies=(bead,), traps=(harmonic("Trap", (0.0, 0.0, 0.5), power=0.0),))


def test_heights_of_a_sphere_that_touches(device):
    """The same with contact, by the world driver; the trap is off."""
    worlds = 3000
    sim = Simulation(touching_bead(0.003 / UNIT), worlds=worlds, seed=24, device=device)
    assert sim.model.features.driver == "world"
    start_at(sim, 1.0 + np.random.default_rng(2).exponential(0.2, worlds))
    sim.run(5.0 * 0.2**2 * wall_resistance(0.2).normal / UNIT)
    check_heights(sim, 0.2, 0.01)


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
        assert found == pytest.approx(reference.sphere_carried(np.array([0, 0, z]), 1.0, plates, flow)[0], rel=1e-3)


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


def check_dimer(sim: Simulation, length: float, bias: float) -> None:
    """Tilt and gap against their densities: both by quadrature, the gap independent of the tilt."""
    worlds = sim.model.worlds
    q = sim.state.orientation.numpy()[:, 0].astype(float)
    tilt = np.abs(1.0 - 2.0 * (q[:, 0] ** 2 + q[:, 1] ** 2))
    gap = sim.state.position.numpy()[:, 0, 2].astype(float) - tilt - 1.0
    norm = quad(lambda c: np.exp(-c / length), 0.0, 1.0)[0]
    first, second = (quad(lambda c, n=n: c**n * np.exp(-c / length), 0.0, 1.0)[0] / norm for n in (1, 2))
    spread = np.sqrt(second - first**2)
    assert tilt.mean() == pytest.approx(first, abs=SIGMAS * spread / np.sqrt(worlds) + bias * first)
    assert gap.mean() == pytest.approx(length, rel=SIGMAS / np.sqrt(worlds) + bias)
    share = 1.0 - np.exp(-0.1)
    assert (gap < 0.1 * length).mean() == pytest.approx(
        share, rel=SIGMAS * np.sqrt((1 / share - 1) / worlds) + 2 * bias
    )
    correlation = ((tilt - first) * (gap - length)).mean() / (spread * length)
    assert correlation == pytest.approx(0.0, abs=SIGMAS / np.sqrt(worlds) + bias)


def place_dimers(sim: Simulation, length: float, seed: int) -> None:
    """Put the dimers where Boltzmann has them: |cos θ| of density e^{−|cos θ|/length}, gaps of e^{−gap/length}."""
    rng, worlds = np.random.default_rng(seed), sim.model.worlds
    tilt = -length * np.log(1.0 - rng.uniform(size=worlds) * (1.0 - np.exp(-1.0 / length)))
    half = 0.5 * np.arccos(tilt)
    position, orientation = np.zeros((worlds, 1, 3)), np.zeros((worlds, 1, 4))
    position[:, 0, 2] = 1.0 + tilt + rng.exponential(length, worlds)
    orientation[:, 0, 0], orientation[:, 0, 3] = np.sin(half), np.cos(half)
    sim.set_state(position=position, orientation=orientation)


def test_dimer_above_a_wall(device):
    """Tilts and heights stay Boltzmann's over a rotational relaxation time; standard error of the mean gap 2 %."""
    length = 0.5
    sim = Simulation(dimer(0.006 / UNIT, length=length), worlds=2500, seed=26, device=device)
    place_dimers(sim, length, 4)
    sim.run(1.5 / UNIT)
    check_dimer(sim, length, 0.02)


@pytest.mark.validate
def test_dimer_finds_its_tilt_above_a_wall(device):
    """Upright dimers fall over and settle; quadrature of Boltzmann's weight; standard error of the mean gap 1.6 %."""
    length = 0.5
    sim = Simulation(dimer(0.0025 / UNIT, length=length), worlds=4000, seed=27, device=device)
    sim.run(8.0 / UNIT)
    check_dimer(sim, length, 0.01)


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
    sim = Simulation(heavy_bead(0.01, dt=0.3 / UNIT), worlds=500, seed=8, device=device)
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
        ({"obstacles": (wall(shape="box", position=(0, 0, -5)),)}, "false on a box; only planes at rest"),
        ({"obstacles": (dataclasses.replace(wall(), position=obstacle("F", "plane", (0, 0, 0)).position.__class__(
            times=np.array([0.0, 1.0]), values=np.array([[0, 0, 0], [0, 0, 0.1]]))),)}, "a plane that moves"),
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
    assert text.startswith("/World: /World/F")
    assert "ot:obstacle:hydrodynamic = true: must be " in text
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
    for others in (0, 28):
        places = [(0.0, 0.0, 1.02), (1.6, 0.0, 2.2), *((10.0 * (i + 1), 0.0, 5.0) for i in range(others))]
        bodies = [sphere_body(f"B{i}", p, collides=True, trapped=False) for i, p in enumerate(places)]
        settings = Settings(brownian=False, time_step=1e-4, integrator="eulerMaruyama")
        scene = Scene(medium=Medium(viscosity=VISCOSITY), bodies=tuple(bodies), obstacles=(wall(),), settings=settings)
        sim = Simulation(scene, device=device)
        assert sim.model.features.driver == ("grid" if others else "world")
        before = sim.state.position.numpy()[0, :2].astype(float)
        sim.step()
        moved.append(sim.state.position.numpy()[0, :2] - before)
    np.testing.assert_allclose(moved[1], moved[0], atol=0.04 * np.abs(moved[0]).max())
    # down by μ⊥ sin, not by what it moves along the contact
    assert abs(moved[0][0, 2]) < 0.1 * abs(moved[0][0, 0])
