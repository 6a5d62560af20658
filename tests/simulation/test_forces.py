"""Forces that users write, in every driver, integrator and precision: what they move, and what they count for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.errors import InputError
from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Body, Medium, Scene, SceneBuilder, Settings
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.resolved import resting_loads
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN
from tests.simulation.crowds import SOFT_STEP, crowd, jumbled
from tests.simulation.forces import (
    AMPLITUDE,
    DRIVERS,
    ROUNDING,
    SLOPE,
    by_size,
    colliding,
    constant,
    quiet,
    shaken,
    spring,
    tether,
    turning,
)
from tests.simulation.setups import (
    FIVE,
    POWER,
    STIFFNESS,
    VISCOSITY,
    drag,
    harmonic,
    model_with,
    obstacle,
    robot,
    sphere_body,
)


@pytest.mark.parametrize(
    ("driver", "precision"),
    [(d, p) for d in DRIVERS for p in ROUNDING if (d, p) != ("grid", "float64")],
)
def test_a_constant_force_moves_a_body_by_its_mobility(driver: str, precision: str, device: str):
    scene, force = DRIVERS[driver], np.array([0.3, -0.2, 0.5])
    worlds = np.array([1.0, 2.0])[:, None, None] * force
    sim = Simulation(
        scene,
        worlds=2,
        device=device,
        precision=precision,
        forces=[constant],
        parameters={"constant_push": np.broadcast_to(worlds, (2, len(scene.bodies), 3))},
    )
    assert sim.model.features.driver == {"coupled": "world", "rigid": "solo"}.get(driver, driver)
    start = sim.state.position.numpy().astype(float)
    sim.step(50)
    moved = sim.state.position.numpy() - start
    mobility = np.eye(3) / drag(1.0)
    if driver == "rigid":
        centres, radii = np.array([o for o, _ in FIVE]), np.array([r for _, r in FIVE])
        mobility = body_mobility(centres, radii, accuracy=Body.mobility_accuracy).mobility[:3, :3] / VISCOSITY
    expected = 50 * 1e-4 * np.array([1.0, 2.0])[:, None] * (mobility @ force)
    # coupled beads 4 mm apart carry each other along by 1.5·radius/distance; a robot that is pushed turns a little, too
    far = 1e-3 if driver in ("coupled", "rigid") else 30 * ROUNDING[precision]
    # float32 positions up to 200 µm from the origin
    spacing = 50 * np.spacing(np.float32(4000.0 if driver == "coupled" else 200.0)) if precision == "float32" else 0.0
    np.testing.assert_allclose(moved[:, 0], expected, rtol=far, atol=0.0 if driver in ("solo", "rigid") else spacing)
    force_now = sim.readout.body_force.numpy()
    np.testing.assert_allclose(force_now[:, 0, 0], worlds[:, 0] * [[1.0]], rtol=1e-6)


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential"])
def test_every_stage_of_every_integrator_sums_it(integrator: str, device: str):
    """A spring relaxes as e^{−kt/γ}, to the order of the scheme; only a force that both stages see is of order two."""
    rate = SLOPE / drag(1.0)
    dt = 0.1 / rate
    scene = quiet(sphere_body("B", (1.0, 0.0, 0.0)))
    sim = Simulation(scene, device=device, time_step=dt, integrator=integrator, forces=[spring(stiffness=SLOPE)])
    assert sim.model.features.integrator == integrator
    sim.step(10)
    order = {"eulerMaruyama": 1, "leimkuhlerMatthews": 1}.get(integrator, 2)
    lost = sim.state.position.numpy()[0, 0, 0] / np.exp(-1.0) - 1.0
    # local error z²/2 or z³/6 per step
    assert abs(lost) == pytest.approx(10 * 0.1 ** (order + 1) / (order * (order + 1)), rel=0.15)


def test_a_spring_of_the_users_is_a_spring_of_a_trap(device: str):
    """The same step is chosen, and the same path taken, as in a harmonic trap of this stiffness."""
    law = {"stiffness": SLOPE, "power": 1.0}
    trap = dataclasses.replace(harmonic("T", power=1.0), radial=dataclasses.replace(harmonic("T").radial, **law))
    bead = sphere_body("B", (0.1, 0.0, 0.0))
    trapped = Simulation(Scene(bodies=(bead,), traps=(trap,)), worlds=4, seed=3, device=device)
    pulled = Simulation(Scene(bodies=(bead,)), worlds=4, seed=3, device=device, forces=[spring(stiffness=SLOPE)])
    # the slope was measured by differences in float64
    assert pulled.time_step == pytest.approx(trapped.time_step, rel=1e-6)
    assert pulled.model.scales.stiffest_body == bead.name
    for sim in (trapped, pulled):
        sim.step(200)
    np.testing.assert_allclose(pulled.state.position.numpy(), trapped.state.position.numpy(), atol=2e-5)


TILTED = (0.0, 0.2, 0.0, 0.96**0.5)
"""Turn about y, by 23°."""
CENTRE = (0.3, -0.2, 2.0)
"""Where the springs of `HELD` pull to [µm]."""
STEP = Settings(time_step=5e-5, integrator="eulerMaruyama")
FLOOR = dataclasses.replace(obstacle("Floor", "plane", (0.0, 0.0, 0.0)), hydrodynamic=True)
SOFT_BEADS = crowd(jumbled(30), trapped=2, temperature=Medium.temperature)
HELD = {
    "sphere at a plane": Scene(bodies=(sphere_body("B", (0.0, 0.0, 1.2)),), obstacles=(FLOOR,), settings=STEP),
    "robot at a plane": Scene(bodies=(robot("B", (0.0, 0.0, 2.5), TILTED),), obstacles=(FLOOR,), settings=STEP),
    "coupled robots": Scene(
        bodies=(robot("B0"), robot("B1", (0.0, 2.5, 0.0), TILTED)), settings=dataclasses.replace(STEP, coupling=True)
    ),
    "soft beads": dataclasses.replace(SOFT_BEADS, settings=dataclasses.replace(STEP, time_step=SOFT_STEP)),
}
"""Scenes whose spheres a spring holds, of a trap or of the user."""


@pytest.mark.parametrize("name", HELD)
def test_springs_at_spheres_are_a_trap_wherever_mobility_comes_from(name: str, device: str):
    """The same noisy path as in a harmonic trap that acts on the same spheres, torques and contacts included."""
    scene, power = HELD[name], 0.1 if name == "soft beads" else 20.0
    trap = harmonic("T", CENTRE, power=power)
    acts = {body.prim: STIFFNESS / POWER * power for body in scene.bodies if body.spheres[0].trapped}
    how = {"worlds": 2, "seed": 3, "device": device, "allow_large_step": True}
    trapped = Simulation(dataclasses.replace(scene, traps=(trap,)), **how)
    pulled = Simulation(scene, forces=[tether(stiffness=acts, centre=CENTRE)], **how)
    assert pulled.model.features.soft_contacts == (name == "soft beads")
    for sim in (trapped, pulled):
        sim.step(100)
    for kept in ("position", "orientation"):
        found, expected = (getattr(sim.state, kept).numpy() for sim in (pulled, trapped))
        np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("first", [0, 1])
def test_two_forces_add_in_double_precision(first: int, device: str):
    """The Euler scheme's own x ← x + μ dt (F − k (x − c)), world by world, in whatever order the forces are given."""
    push, stiffness = np.array([[0.1, 0.0, -0.3], [0.7, -0.2, 0.0]]), np.array([1.3, 2.6])
    forces = [constant, spring(centre=CENTRE)]
    sim = Simulation(
        quiet(sphere_body("B"), integrator="eulerMaruyama"),
        worlds=2,
        device=device,
        precision="float64",
        forces=[forces[first], forces[1 - first]],
        parameters={"constant_push": push[:, None], "spring_stiffness": stiffness[:, None]},
    )
    sim.step(40)
    place = np.zeros((2, 3))
    for _ in range(40):
        place += 1e-4 / drag(1.0) * (push - stiffness[:, None] * (place - CENTRE))
    np.testing.assert_allclose(sim.state.position.numpy()[:, 0], place, rtol=ROUNDING["float64"])
    both = [push, -stiffness[:, None] * (place - CENTRE)]
    found = sim.readout.body_force.numpy()[:, :, 0]
    np.testing.assert_allclose(found, np.stack([both[first], both[1 - first]], axis=1), rtol=1e-10)


@pytest.mark.parametrize("order", [1, -1])
def test_instances_are_named_together_by_their_prim_and_singly_by_their_index(order: int, device: str):
    """One that is named itself has its own value, whether it is named before its prim or after it."""
    cells = [dataclasses.replace(sphere_body("Cells", (5.0 * i, 0.0, 0.0)), instance=i) for i in range(3)]
    push = {"/World/Cells": (0.0, 0.0, 1.0), "/World/Cells[1]": (0.0, 0.0, -2.0)}
    given = dict(list(push.items())[::order])
    scene = quiet(*cells, sphere_body("Other", (0.0, 5.0, 0.0)))
    sim = Simulation(scene, device=device, forces=[constant(push=given)])
    sim.step(10)
    moved = sim.state.position.numpy()[0, :, 2] * drag(1.0) / 1e-3
    np.testing.assert_allclose(moved, [1.0, -2.0, 1.0, 0.0], rtol=10 * ROUNDING["float32"])


def test_a_stated_slope_takes_the_place_of_the_measured_one(device: str):
    @ot.force(stiffness="pN/µm", slope=lambda stiffness: 4.0 * stiffness, load=1.0)
    def stated(body: ot.ForceInput, stiffness: float):
        return -stiffness * body.position

    bead = Scene(bodies=(sphere_body("B", (0.1, 0.0, 0.0)),))
    models = [model_with(bead, f(stiffness=SLOPE), device) for f in (spring, stated)]
    assert models[1].time_step == pytest.approx(models[0].time_step / 4.0, rel=1e-3)  # a whole number in a run
    assert models[1].loads[0].force == 1.0


def test_a_spring_that_is_said_to_be_no_load_has_a_traps_step_at_a_plane(device: str):
    """By itself the force where the body starts counts, as weight does: nobody knows that it is a spring."""

    @ot.force(stiffness="pN/µm", centre="µm", load=0.0)
    def held(body: ot.ForceInput, stiffness: float, centre: wp.vec3):
        return -stiffness * (body.position - centre)

    scene = dataclasses.replace(HELD["sphere at a plane"], settings=Settings())
    trapped = dataclasses.replace(scene, traps=(harmonic("T", CENTRE),))
    values = {"stiffness": STIFFNESS, "centre": CENTRE}
    steps = [
        Model.build(s, worlds=1, device=wp.get_device(device), options=StepOptions(forces=forces)).time_step
        for s, forces in ((trapped, ()), (scene, (held(**values),)), (scene, (spring(**values),)))
    ]
    assert steps[1] == pytest.approx(steps[0], rel=1e-6)
    assert steps[2] < steps[0]


def test_a_spring_holds_the_thermal_variance(device: str):
    """⟨x²⟩ = k_B T/k, standard error √(2/N) of N = 3·4096 independent values; the step errs by 1 % at most."""
    sim = Simulation(Scene(bodies=(sphere_body("B"),)), worlds=4096, seed=11, device=device,
                     forces=[spring(stiffness=SLOPE)])  # fmt: skip
    sim.run(8.0 * drag(1.0) / SLOPE)
    values = sim.state.position.numpy().ravel()
    expected = BOLTZMANN * Medium().temperature / SLOPE
    assert abs(np.mean(values**2) / expected - 1.0) < 0.01 + 5.0 * np.sqrt(2.0 / values.size)


def test_forces_on_spheres_turn_a_body_and_torques_too(device: str):
    """Against sums over the spheres, and angular velocity M_rr T."""
    scene = quiet(robot("R"))
    sim = Simulation(scene, device=device, forces=[by_size(per_radius=0.4), turning(strength=0.3)])
    reference = sim.model.reference[0]
    offsets, radii = np.array([o for o, _ in FIVE]) - reference, np.array([r for _, r in FIVE])
    forces = np.stack([0 * radii, 0 * radii, 0.4 * radii], axis=1)
    found = sim.readout.body_force.numpy()[0, :, 0], sim.readout.body_torque.numpy()[0, :, 0]
    np.testing.assert_allclose(found[0], [forces.sum(axis=0), np.zeros(3)], atol=1e-6)
    np.testing.assert_allclose(found[1], [np.cross(offsets, forces).sum(axis=0), (0, 0, 0.3)], atol=1e-5)


@pytest.mark.parametrize("precision", ROUNDING)
def test_functions_and_constants_that_it_uses_come_along(precision: str, device: str):
    sim = Simulation(quiet(sphere_body("B")), device=device, precision=precision, forces=[shaken(frequency=100.0)])
    sim.step(25)  # a quarter of a period: 2.5 ms
    assert sim.readout.body_force.numpy()[0, 0, 0, 0] == pytest.approx(AMPLITUDE, rel=30 * ROUNDING[precision])


def test_it_acts_where_it_is_given_and_costs_nothing_elsewhere(device: str):
    scene = quiet(*colliding(2))
    sim = Simulation(scene, device=device, forces=[constant(push={"/World/B1": (0.0, 0.0, 1.0)})])
    sim.step(20)
    moved = sim.state.position.numpy()[0, :, 2]
    assert moved[0] == 0.0
    assert moved[1] > 0.0
    free = Simulation(scene, device=device)
    assert free.model.features.forces == ()
    assert free.readout.body_force.shape == (1, 0, 0)
    assert free.model.data.forces.shape == (0,)
    assert free._step.forces is None


@pytest.mark.quick
def test_a_checkpoint_goes_on_with_the_same_function_alone(tmp_path, device: str):
    builder = SceneBuilder()
    builder.add(sphere_body("B", (0.5, 0.0, 0.0)))
    scene = Scene.load(builder.save(tmp_path / "bead.usda"))
    how = {"worlds": 2, "device": device, "parameters": {"spring_stiffness": [[1.0], [3.0]]}}
    sim = Simulation(scene, forces=[spring(stiffness={"/World/B": 1.0})], **how)
    sim.step(30)
    kept = sim.save(tmp_path / "end.npz")
    sim.step(30)
    again = Simulation.restore(kept, device=device, forces=[spring])
    again.step(30)
    np.testing.assert_array_equal(again.state.position.numpy(), sim.state.position.numpy())
    with pytest.raises(InputError, match="was made with forces: spring; given: none"):
        Simulation.restore(kept, device=device)

    def other(body: ot.ForceInput, stiffness: float, centre: wp.vec3 = (0.0, 0.0, 0.0)):
        return -2.0 * stiffness * (body.position - centre)

    other.__name__ = "spring"
    with pytest.raises(InputError, match="force spring is another function"):
        Simulation.restore(kept, device=device, forces=[ot.force(stiffness="pN/µm", centre="µm")(other)])


def test_an_authored_force_is_the_same_as_a_users(tmp_path, device: str):
    """`ot:body:externalForce`, in newton, written and read back, and swept by its parameter."""
    builder = SceneBuilder(settings=Settings(brownian=False, time_step=1e-3))
    builder.add(dataclasses.replace(sphere_body("B"), forces={"external_force": (0.0, 0.25, 0.0)}))
    scene = Scene.load(builder.save(tmp_path / "pushed.usda"))
    assert scene.bodies[0].forces == {"external_force": (0.0, 0.25, 0.0)}
    swept = {"external_force": np.array([0.25, 0.5])[:, None, None] * [[[0.0, 1.0, 0.0]]]}
    sim = Simulation(scene, worlds=2, device=device, parameters=swept)
    assert sim.model.features.integrator == "eulerMaruyama"  # it depends on no place: one stage is exact
    sim.step(10)
    np.testing.assert_allclose(sim.state.position.numpy()[:, 0, 1], 0.01 / drag(1.0) * np.array([0.25, 0.5]), rtol=1e-5)
    about = describe(scene, device=device)
    assert about["forces"][0]["parameters"]["force"] == {
        "unit": "pN",
        "low": [0.0, 0.25, 0.0],
        "high": [0.0, 0.25, 0.0],
    }
    assert about["steady_loads"]["force"] == pytest.approx(0.25)


def test_a_steady_force_shortens_the_step_of_what_collides(device: str):
    """As weight does: no body may drift by a tenth of its radius in a step."""
    scene = Scene(bodies=colliding(2), settings=Settings(brownian=False))
    steps = [
        Simulation(scene, device=device, forces=[constant(push=(0.0, 0.0, f))]).time_step for f in (1e3, 2e3)
    ]  # fmt: skip
    assert steps[0] == pytest.approx(0.1 * drag(1.0) / 1e3, rel=1e-9)
    assert steps[1] == pytest.approx(0.5 * steps[0], rel=1e-9)


def test_a_stated_load_does_not_hide_a_torque(device: str):
    @ot.force(strength="pN·µm", slope=0.0, load=0.0)
    def motor(body: ot.ForceInput, strength: float) -> ot.Wrench:
        return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))

    model = model_with(Scene(bodies=(robot("R"),)), motor(strength=50.0), device)
    assert model.loads[0].torque == pytest.approx(50.0)
    assert model.scales.turning is not None


def test_an_oscillation_is_seen_whatever_its_frequency(device: str):
    for frequency in (4.0, 100.0):
        model = model_with(Scene(bodies=(sphere_body("B"),)), shaken(frequency=frequency), device)
        assert 0.9 * AMPLITUDE < model.loads[0].force <= AMPLITUDE * (1.0 + 1e-6)


@pytest.mark.quick
def test_forces_of_a_scene_that_state_nothing_count_for_the_budget(monkeypatch):
    """As ours would if it stated no bounds: 0.25 pN are measured."""
    row = FORCES["external"]
    unbounded = dataclasses.replace(row.parametric, load=None, slope=None)
    monkeypatch.setitem(FORCES, "external", dataclasses.replace(row, parametric=unbounded))
    bead = dataclasses.replace(sphere_body("B"), forces={"external_force": (0.0, 0.25, 0.0)})
    (load,) = resting_loads(Scene(bodies=(bead,)))
    assert load.force == pytest.approx(0.25)
