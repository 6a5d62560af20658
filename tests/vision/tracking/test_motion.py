"""The exact step of linear motion, and motion near a pose against the simulation itself."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm, solve_continuous_lyapunov

from otwarp.scene import Scene
from otwarp.simulation import Simulation
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.motion import transition
from otwarp.vision.tracking.rotations import difference, exponential, jacobian, product

RATE = np.array([[-300.0, 20.0, 0.0], [-5.0, -40.0, 0.0], [0.0, 0.0, 0.0]])
"""Fast, slow and no relaxation [1/s]."""

DIFFUSION = np.array([[0.2, 0.05, 0.0], [0.05, 0.1, 0.0], [0.0, 0.0, 0.01]])


@pytest.mark.quick
@pytest.mark.parametrize("time", [0.0, 1e-6, 1e-3, 0.02, 1.0])
def test_a_step_is_exact(time: float) -> None:
    step = transition(RATE, DIFFUSION, time)
    integral = lambda f: quad_vec(f, 0.0, time, epsrel=1e-11)[0] if time else np.zeros((3, 3))  # noqa: E731
    expected = (
        (step.decay, expm(RATE * time)),
        (step.drift, integral(lambda s: expm(RATE * s))),
        (step.ramp, integral(lambda s: s * expm(RATE * (time - s)))),
        (step.noise, integral(lambda s: 2.0 * expm(RATE * s) @ DIFFUSION @ expm(RATE.T * s))),
    )
    for found, right in expected:
        np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-13 * max(1.0, np.abs(right).max()))


@pytest.mark.quick
def test_long_steps_reach_equilibrium_and_two_halves_are_a_whole() -> None:
    part = RATE[:2, :2]
    still = solve_continuous_lyapunov(part, -2.0 * DIFFUSION[:2, :2])
    np.testing.assert_allclose(transition(part, DIFFUSION[:2, :2], 10.0).noise, still, rtol=1e-10)
    half, whole = transition(RATE, DIFFUSION, 0.01), transition(RATE, DIFFUSION, 0.02)
    np.testing.assert_allclose(half.decay @ half.noise @ half.decay.T + half.noise, whole.noise, rtol=1e-10)


@pytest.mark.quick
def test_rotation_vectors() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        first, small = rng.standard_normal(3), 1e-6 * rng.standard_normal(3)
        there = product(exponential(jacobian(first) @ small), exponential(first))
        np.testing.assert_allclose(difference(exponential(first + small), there), 0.0, atol=1e-11)


@pytest.mark.parametrize("name", [pytest.param("single_bead", marks=pytest.mark.quick), "strategy_a", "strategy_b"])
def test_motion_without_noise_is_that_of_the_simulation(name: str) -> None:
    """Led on by its expansions alone, over 0.2 s in which traps move."""
    from otwarp.vision.tracking.belief import Belief, advance

    scene = Scene.load(f"scenes/{name}.usda")
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, brownian=False))
    body = MobileBody(scene, scene.bodies[0].name)
    sim = Simulation(scene, device="cpu", precision="float64" if name != "single_bead" else "float32")
    place, turn = body.start
    start = place + np.array([0.05, -0.03, 0.04])
    sim.set_state(position=start[None])
    commands = Commands.of_scene(scene)
    belief, time = Belief(start, turn, 1e-6 * np.eye(6)), 0.0
    for _ in range(10):
        sim.run(0.02)
        belief = advance(belief, body, commands, time, sim.time)
        time = sim.time
        # curvature of the traps' force over the 0.1 µm within which it is a spring
        assert np.abs(sim.state.position.numpy()[0, 0] - belief.position).max() < 2e-3
        if body.rigid:
            assert np.abs(difference(sim.state.orientation.numpy()[0, 0], belief.orientation)).max() < 2e-3


@pytest.mark.parametrize(("away", "on_its_way"), [(0.6, 0.06), (0.78, 0.06), (1.0, 0.06), (1.2, 0.4)])
def test_a_bead_on_the_falling_side_of_its_trap_falls_in(away: float, on_its_way: float) -> None:
    """There displacements grow without end in the expansion, and in truth only until it is through."""
    from otwarp.vision.tracking.belief import Belief, advance
    from tests.perception.scenes import seen_bead

    scene = seen_bead()
    body = MobileBody(scene, scene.bodies[0].name)
    commands = Commands.of_scene(scene)
    start = commands.values[0][:3] + np.array([away, 0.0, 0.0])
    still = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, brownian=False))
    sim = Simulation(still, device="cpu", precision="float64")
    sim.set_state(position=start[None])
    first = Belief(start, body.start[1], 1e-6 * np.eye(6))
    # it goes 0.5 µm in a millisecond; from near the end of the trap's reach its way is known less well
    for until, within in (
        (0.001, on_its_way),
        (0.002, on_its_way),
        (0.004, on_its_way),
        (0.02, 1e-4),
        (0.2, 1e-6),
        (2.0, 1e-6),
    ):
        sim.run(until - sim.time)
        found = advance(first, body, commands, 0.0, sim.time)
        assert np.abs(sim.state.position.numpy()[0, 0] - found.position).max() < within
        assert np.all(np.isfinite(found.covariance)) and np.diag(found.covariance)[:3].max() < 0.3**2


def test_commands_jump_and_move() -> None:
    commands = Commands(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0, 5.0], [1.0, 0.0, 0.0, 5.0]]))
    np.testing.assert_allclose(commands.at(0.25), [0.25, 0.0, 0.0, 5.0])
    commands.set(0.5, position=np.array([[9.0, 0.0, 0.0]]), power=np.array([2.0]))
    np.testing.assert_allclose(commands.before(0.5), [0.5, 0.0, 0.0, 5.0])
    np.testing.assert_allclose(commands.at(0.5), [9.0, 0.0, 0.0, 2.0])
    np.testing.assert_allclose(commands.at(7.0), [9.0, 0.0, 0.0, 2.0])
    assert commands.corners(0.0, 1.0) == [0.5]
