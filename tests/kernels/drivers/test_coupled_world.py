"""How coupled bodies are stepped: order, time step, driver and integrator, and what coupling does not go with."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.kernels.core.features import MAX_WORLD_BODIES
from otwarp.laws import TrapLaw
from otwarp.scene import Scene, Settings
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from tests.reference import coupling as reference
from tests.reference.rotations import matrix
from tests.simulation.setups import COLD, STIFFNESS, VISCOSITY, bead_scene, harmonic, obstacle, sphere_body
from tests.simulation.test_coupling import RATE, TURN, coupled, mixed, own_mobilities, trapped_pair

LARGE = StepOptions(allow_large_step=True)

WIDE = TrapLaw(stiffness=STIFFNESS)
"""A spring without end."""


@pytest.mark.thorough
@pytest.mark.parametrize(("integrator", "order"), [("eulerMaruyama", 1), ("heun", 2)])
def test_order_of_the_drift(integrator, order, device):
    """Two beads let go near each other: halving the step divides the error by 2^order, pairs and forces varying."""
    ends = []
    for steps in (4, 8, 16, 256):
        time = 0.8 / RATE
        scene = trapped_pair(2.3, time_step=time / steps, integrator=integrator)
        scene = dataclasses.replace(
            scene,
            medium=dataclasses.replace(scene.medium, temperature=COLD),
            traps=tuple(dataclasses.replace(t, radial=WIDE) for t in scene.traps),
        )
        sim = Simulation(scene, device=device, allow_large_step=True)
        sim.set_state(position=[[0.2, 1.1, 0.1], [2.2, -0.8, 0.3]])
        sim.step(steps)
        ends.append(sim.state.position.numpy()[0].astype(float))
    errors = [np.abs(e - ends[-1]).max() for e in ends[:-1]]
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(2.0**order, rel=0.25)


@pytest.mark.thorough
def test_same_bits_however_launched(device):
    scene = mixed(1e-4)
    one, many = (Simulation(scene, worlds=5, seed=3, device=device, threads=t) for t in (1, 2))
    one.step(30)
    for count in (1, 9, 20):
        many.step(count)
    np.testing.assert_array_equal(one.state.position.numpy(), many.state.position.numpy())
    np.testing.assert_array_equal(one.state.orientation.numpy(), many.state.orientation.numpy())


def test_one_body_is_not_coupled(device):
    """Nothing to couple: the step is the one without."""
    scene = bead_scene()
    assert Model.build(coupled(scene), device=device).features == Model.build(scene, device=device).features


@pytest.mark.parametrize(
    ("wanted", "used"),
    [("heun", "heun"), ("eulerMaruyama", "eulerMaruyama"), ("leimkuhlerMatthews", "heun"), ("exponential", "heun")],
)
def test_integrators_of_coupled_bodies(wanted, used, device):
    about = describe(trapped_pair(3.0, integrator=wanted), device=device)
    assert (about["driver"], about["time_scales"]["integrator"]) == ("world", used)
    assert ("coupled" in about["integrator_reason"]) == (wanted != used)
    assert next(t for t in about["terms"] if t["term"] == "hydrodynamic coupling")["compiled"]


def test_step_follows_what_beads_do_together(device):
    """Along their line two beads relax by 1 + 3a/2r − a³/r³ faster. Nearer to each other a step may become unstable: at
    one place by 2, where they touch, if they collide, by 1 + 3/4 − 1/8."""
    alone = Model.build(dataclasses.replace(trapped_pair(3.0), settings=Settings()), device=device).scales
    together = Model.build(trapped_pair(3.0), device=device).scales
    assert alone.time_step / together.time_step == pytest.approx(1.0 + 0.5 - 1.0 / 27.0, rel=1e-3)
    assert alone.largest_stable / together.largest_stable == pytest.approx(1.0 + 0.5 - 1.0 / 27.0, rel=1e-3)
    scene = trapped_pair(3.0)
    bodies = tuple(
        dataclasses.replace(b, spheres=(dataclasses.replace(b.spheres[0], collides=True),)) for b in scene.bodies
    )
    colliding = dataclasses.replace(scene, bodies=bodies)
    for which, gain in ((scene, 2.0), (colliding, 1.625)):
        risky, safe = (
            dataclasses.replace(which.settings, time_step=alone.largest_stable / gain * f) for f in (1.01, 0.99)
        )
        with pytest.warns(UserWarning, match="becomes unstable where all trapped bodies"):
            Model.build(dataclasses.replace(which, settings=risky), device=device, options=LARGE)
        Model.build(dataclasses.replace(which, settings=safe), device=device, options=LARGE)
    with pytest.raises(InputError, match="is unstable"):
        Model.build(trapped_pair(3.0, time_step=1.01 * together.largest_stable), device=device)


def test_a_trap_that_holds_nothing_may_come_to_several_bodies_at_once(device):
    """Both beads in the empty trap relax by 2 faster where they share a place, and the chosen step is stable there."""
    scene = trapped_pair(3.0)
    empty = (harmonic("Empty", (0.0, 30.0, 0.0), cutoff=1.4),)
    model = Model.build(dataclasses.replace(scene, traps=empty), device=device)
    assert model.held == ((-1, -1),)
    powers = np.array([20.0])
    alone, together = (model.steepest.fastest(powers, anywhere=a)[0] for a in (False, True))
    assert alone == pytest.approx(RATE, rel=1e-6)
    assert together / alone == pytest.approx(2.0, rel=1e-6)
    bodies = (scene.bodies[0], sphere_body("Bead1", (3.0, 0.0, 0.0), trapped=False))
    one = Model.build(dataclasses.replace(scene, bodies=bodies, traps=empty), device=device)
    assert one.steepest.fastest(powers, anywhere=True) == one.steepest.fastest(powers)


@pytest.mark.thorough
def test_powers_that_meeting_beads_could_not_carry_are_warned_of(device):
    """Control.set looks where the beads start for a refusal, and where they could meet for a warning."""
    step = 0.9 * Model.build(trapped_pair(3.0), device=device).scales.largest_stable
    sim = Simulation(trapped_pair(3.0, time_step=0.5 * step), device=device, allow_large_step=True)
    # at the start a gain of 1.46, at one place of 2: a factor of 2/1.46 in power lies between
    with pytest.warns(UserWarning) as said:
        sim.control.set(trap_power=[40.0, 40.0])
    (meeting,) = [str(w.message) for w in said if "becomes unstable where all trapped bodies" in str(w.message)]
    least = float(meeting.split("always stable: below ")[1].split(" mW")[0])
    assert least == pytest.approx(40.0 * (1.0 + 0.5 - 1.0 / 27.0) / (0.9 * 2.0), rel=1e-3)
    with pytest.warns(UserWarning) as said:
        sim.control.set(trap_power=[0.99 * least, 0.99 * least])
    assert not [w for w in said if "becomes unstable" in str(w.message)]
    with pytest.raises(InputError, match="is unstable"):
        sim.control.set(trap_power=[46.0, 46.0])


def test_gain_of_a_robot_is_that_of_its_matrix(device):
    """The fastest rate of a trapped robot and a trapped bead from the eigenvalues of M K, by the twin."""
    scene = mixed(1e-4)
    bodies = (scene.bodies[0], sphere_body("Bead", (2.3, 0.4, 1.2), radius=0.7), scene.bodies[2])
    traps = (*scene.traps, harmonic("Second", (2.3, 0.4, 1.2), cutoff=0.3))
    scene = dataclasses.replace(scene, bodies=bodies, traps=traps)
    model = Model.build(scene, device=device)
    turn = [matrix(np.array(TURN)), np.eye(3), np.eye(3)]
    whole = reference.whole_mobility(model.start_position(), turn, own_mobilities(scene)) / VISCOSITY
    arm = turn[0] @ (np.array(scene.bodies[0].spheres[model.held[0][1]].offset) - model.reference[0])
    lever = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
    stiffness = np.zeros((18, 18))
    stiffness[:6, :6] = STIFFNESS * lever.T @ lever
    stiffness[6:9, 6:9] = STIFFNESS * np.eye(3)
    apart = np.kron(np.eye(3), np.ones((6, 6))) * whole
    gain, bare = (np.linalg.eigvals(m @ stiffness).real.max() for m in (whole, apart))
    uncoupled = Model.build(dataclasses.replace(scene, settings=Settings(gravity=True)), device=device)
    powers = np.array([20.0, 20.0])
    found = model.relaxation.fastest(powers)[0] / uncoupled.relaxation.fastest(powers)[0]
    assert found == pytest.approx(gain / bare, rel=1e-6)
    assert (
        1.0 + 1e-3
        < found
        < model.relaxation.fastest(powers, anywhere=True)[0] / uncoupled.relaxation.fastest(powers)[0]
    )


def many(count: int) -> Scene:
    return coupled(Scene(bodies=tuple(sphere_body(f"B{i}", (3.0 * i, 0, 0), trapped=False) for i in range(count))))


def test_what_coupling_does_not_go_with(device):
    """One line with root, prim, attribute, value and what is allowed."""
    floor = dataclasses.replace(obstacle("Floor", "plane", (0.0, 0.0, -5.0)), hydrodynamic=True)
    Model.build(many(MAX_WORLD_BODIES), device=device)
    for scene, allowed in (
        (many(MAX_WORLD_BODIES + 1), f"a scene of {MAX_WORLD_BODIES + 1} bodies; up to {MAX_WORLD_BODIES} can be"),
        (dataclasses.replace(many(2), obstacles=(floor,)), "beside /World/Floor, whose ot:obstacle:hydrodynamic is"),
    ):
        with pytest.raises(InputError) as error:
            Model.build(scene, device=device)
        assert str(error.value).startswith("/World: /World: ot:scene:hydrodynamicCoupling = true: must be false")
        assert allowed in str(error.value)
        assert "\n" not in str(error.value)
