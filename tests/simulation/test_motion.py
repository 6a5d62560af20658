"""Runs without noise that have a closed answer: falling, drifting, being dragged, commands and escapes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Flow, Medium, Scene, Settings
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from tests.simulation.setups import (
    POWER,
    STIFFNESS,
    VISCOSITY,
    drag,
    five_sphere_mobility,
    harmonic,
    line,
    robot,
    sphere_body,
)

FLOAT32 = 2e-5
"""Relative error of a displacement added up over some thousand steps in float32."""

QUIET = Settings(brownian=False, gravity=True, time_step=1e-3)
FLOW = {"prim": "/World/F", "speed": 25.0, "half_height": 8.0, "shear_rate": 3.0}


def drifting(kind: str, device: str, *, density: float = 1190e-12) -> Simulation:
    """A bead at z = 4 and a five-sphere robot at z = 2, free, in a flow."""
    bodies = (
        sphere_body("Bead", (0.0, 0.0, 4.0), density=density),
        dataclasses.replace(robot("Robot", (0.0, 30.0, 2.0)), density=density),
    )
    scene = Scene(bodies=bodies, settings=QUIET, flow=Flow(kind=kind, **FLOW))
    return Simulation(scene, device=device)


def test_terminal_velocity_and_uniform_flow(device):
    """u = U x̂ − (ρ − ρ_m) V g / 6πηa ẑ."""
    density = 2500e-12
    sim = drifting("uniform", device, density=density)
    start, q = sim.state.position.numpy().astype(float)[0], sim.state.orientation.numpy()[0]
    sim.step(400)
    velocity = (sim.state.position.numpy()[0] - start) / sim.time
    sink = (density - Medium().density) * 4 / 3 * np.pi * STANDARD_GRAVITY / drag(1.0)
    np.testing.assert_allclose(velocity[0], [FLOW["speed"], 0.0, -sink], rtol=1e-4, atol=1e-4)
    # the robot is heavier and larger: it moves by its own mobility, and does not turn (its centroid lies on
    # the vertical through its centre of diffusion)
    load = float(sim.model.data.body.weight.numpy()[1])
    mobility = mobilities(sim.scene)[1].mobility / VISCOSITY
    expected = [FLOW["speed"], 0.0, 0.0] - load * mobility[:3, 2]
    assert sink < -expected[2]
    coupling = load * np.abs(mobility[3:, 2]).max() * sim.time
    np.testing.assert_allclose(velocity[1], expected, rtol=1e-3, atol=1e-3 + 50 * coupling)
    turned = 2 * np.arccos(min(1.0, abs(float(sim.state.orientation.numpy()[0][1] @ q[1]))))
    assert turned == pytest.approx(coupling, abs=1e-3)


def test_poiseuille_flow_carries_and_turns(device):
    """A sphere moves with the mean of the flow over its surface, by Faxén's law; a robot turns about the vorticity."""
    sim = drifting("poiseuille", device, density=Medium().density)
    sim.step(100)
    bead, body = sim.state.position.numpy()[0]
    profile = FLOW["speed"] * (1 - (4.0 / FLOW["half_height"]) ** 2 - (1.0 / FLOW["half_height"]) ** 2 / 3)
    np.testing.assert_allclose(bead, [profile * sim.time, 0.0, 4.0], rtol=FLOAT32, atol=1e-6)
    x, y, z, w = sim.state.orientation.numpy()[0][1].astype(float)
    # half the curl, −U z/h² ŷ, turns the body; its long axis along x nearly resists
    assert y < -1e-4
    assert max(abs(x), abs(z)) < 1e-6
    assert w > 0.99
    slowest = FLOW["speed"] * (1 - (4.5 / FLOW["half_height"]) ** 2)
    assert slowest * sim.time < body[0] < FLOW["speed"] * sim.time


SPEED = 30.0
"""Of the dragging trap [µm/s]: the bead lags γv/k = 25 nm, at twice the power half of that."""
LIMIT = np.array([1000.0, 100.0])
"""Speed limit of the other trap in two worlds [µm/s]: the lag would be 0.84 µm, beyond its reach, and 0.08 µm."""
REACH = 0.5
JUMP, HEIGHT = 0.1, 12.0
"""When the other trap is told to jump [s], and how far [µm]."""
STEP = 2e-4


@pytest.fixture(scope="module")
def operated(device) -> Simulation:
    """Bead A dragged by an animated trap of growing power; bead B in a trap with a speed limit that runs away."""
    drag_path = line((0.0, (0, 0, 0)), (1.0, (SPEED, 0, 0)))
    run_path = line((0.0, (0, 20, 0)), (JUMP, (0, 20, 0)), (JUMP + STEP, (0, 20, HEIGHT)), (1.0, (0, 20, HEIGHT)))
    traps = (
        harmonic("Drag", drag_path, power=line((0.0, 20.0), (0.5, 40.0)), cutoff=2.0, hand="left"),
        harmonic("Run", run_path, cutoff=REACH, speed_limit=LIMIT[0], hand="right"),
    )
    bodies = (sphere_body("A"), sphere_body("B", (0.0, 20.0, 0.0)))
    scene = Scene(bodies=bodies, traps=traps, settings=Settings(brownian=False, time_step=STEP))
    limits = np.stack([np.full(2, np.inf), LIMIT], axis=1)
    return Simulation(scene, worlds=2, device=device, parameters={"trap_speed_limit": limits})


@pytest.mark.thorough
def test_traps_are_followed_limited_and_lost(operated):
    """One run, sampled at every step of the flight: foci, lag, readout, and the step of the escape."""
    sim = operated
    assert sim.model.features.driver == "world"
    # the same in float64 by Heun's scheme: a bead, and a focus that moves no faster than its limit
    x, focus, escaped = np.zeros(2), np.zeros(2), np.full(2, -1)
    h = STIFFNESS * STEP / drag(1.0)
    foci = []
    for i in range(1100):
        wanted = HEIGHT if (i + 1) * STEP >= JUMP + 0.5 * STEP else 0.0
        later = np.minimum(wanted, focus + LIMIT * STEP)
        drift = np.where(np.abs(focus - x) < REACH, h * (focus - x), 0.0)
        ahead = later - (x + drift)
        x += 0.5 * (drift + np.where(np.abs(ahead) < REACH, h * ahead, 0.0))
        focus = later
        escaped = np.where((escaped < 0) & (np.abs(x - focus) > REACH), i + 1, escaped)
        foci.append(focus.copy())
    sim.step(500)
    np.testing.assert_array_equal(sim.readout.escape_step.numpy(), -1)
    for i in range(501, 1101):
        sim.step()
        if i % 50 == 1:
            height = sim.state.trap_position.numpy()[:, 1, 2]
            np.testing.assert_allclose(height, foci[i - 1], atol=1e-4)  # sixty additions of float32 near 12
    np.testing.assert_array_equal(height[0], np.float32(HEIGHT))
    bead = sim.state.position.numpy()[:, 1, 2]
    np.testing.assert_allclose(bead, x, atol=1e-4)
    got = sim.readout.escape_step.numpy()
    assert escaped[0] > 500
    assert got[0, 1] == escaped[0]
    assert got[1, 1] == escaped[1] == -1
    np.testing.assert_array_equal(got[:, 0], -1)


@pytest.mark.thorough
def test_dragged_bead_lags(operated):
    """Steady lag γv/k behind the moving trap, and the readout of that trap."""
    sim = operated
    for time in (0.3, 0.45, 0.8):
        sim.run(max(0.0, time - sim.time))
        power = np.interp(sim.time, [0, 0.5], [20, 40])
        k = STIFFNESS * power / POWER
        lag = drag(1.0) * SPEED / k
        x = sim.state.position.numpy()[:, 0, 0].astype(float)
        # tolerance: coordinates of 24 µm are spaced by 2e-6 and the power grows during a relaxation time
        np.testing.assert_allclose(SPEED * sim.time - x, lag, atol=0.01 * lag)
        readout = sim.readout
        np.testing.assert_allclose(readout.trap_power.numpy()[:, 0], power, rtol=1e-6)
        focus = readout.trap_position.numpy()[:, 0, 0].astype(float)
        distance = readout.trap_distance.numpy()[:, 0]
        np.testing.assert_allclose(distance, focus - x, atol=1e-5)
        np.testing.assert_allclose(readout.trap_force.numpy()[:, 0, 0], k * (focus - x), atol=1e-3)
        np.testing.assert_array_equal(readout.hand_force.numpy()[:, 0], readout.trap_force.numpy()[:, 0])
        np.testing.assert_array_equal(readout.hand_force.numpy()[:, 1], readout.trap_force.numpy()[:, 1])
        total = readout.sphere_force.numpy().sum(axis=1) - readout.trap_force.numpy().sum(axis=1)
        np.testing.assert_allclose(total, 0.0, atol=1e-5)


@pytest.mark.thorough
def test_focus_never_exceeds_its_limit(operated):
    """Commanded by hand instead of by key frames: every step moves the focus by limit × dt, the last by the rest."""
    sim = operated
    sim.control.follow.assign(np.zeros(2, dtype=np.int32))
    goal = np.zeros((1, 2, 3), dtype=np.float32)
    goal[0, 1] = (7.0, 20.0, 12.5)
    sim.control.trap_position.assign(goal)
    before = sim.state.trap_position.numpy()[:, 1].astype(float)
    lengths = []
    for _ in range(40):
        sim.step()
        now = sim.state.trap_position.numpy()[:, 1].astype(float)
        lengths.append(np.linalg.norm(now - before, axis=1))
        before = now
    lengths = np.array(lengths)
    assert np.all(lengths <= LIMIT * STEP + 4e-6)  # spacing of coordinates of 20 µm
    np.testing.assert_allclose(lengths[:30], np.broadcast_to(LIMIT * STEP, (30, 2)), atol=4e-6)
    np.testing.assert_array_equal(before[0], goal[0, 1])
    np.testing.assert_array_equal(lengths[-1, 0], 0.0)


def test_a_sphere_without_drag_in_a_body_with_a_given_mobility(device):
    """Bodies after it read their own couplings: in a uniform flow all drift with it."""
    given = tuple(np.array(five_sphere_mobility().mobility).ravel())
    first = dataclasses.replace(robot("A"), mobility=given)
    dry = dataclasses.replace(first.spheres[1], drag=False)
    first = dataclasses.replace(first, spheres=(first.spheres[0], dry, *first.spheres[2:]))
    settings = dataclasses.replace(QUIET, gravity=False)
    scene = Scene(bodies=(first, robot("B", (0, 30.0, 0))), settings=settings, flow=Flow(kind="uniform", **FLOW))
    sim = Simulation(scene, device=device)
    data = sim.model.data.body
    assert data.drag_sphere.shape == data.flow_coupling.shape == (9,)
    start, q = sim.state.position.numpy().copy(), sim.state.orientation.numpy().copy()
    sim.step(100)
    moved = (sim.state.position.numpy() - start)[0] / sim.time
    np.testing.assert_allclose(moved, [[FLOW["speed"], 0, 0]] * 2, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(sim.state.orientation.numpy(), q, atol=1e-5)
