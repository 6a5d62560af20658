"""What delay and errors do to a force, against closed forms: phase, largest stable stiffness, noise in a trap."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from otwarp.operators.people import arm_turn
from otwarp.operators.perception.errors import Perception
from tests.operators.perception.stand import PERIOD, POWER, Stand, delivery, plans_of

TABLE = {5: (40.0, 1341.0), 20: (10.0, 347.0), 50: (4.0, 153.0)}
"""Largest stable stiffness [N/m] at a delay [ms], of a bare device and of one that an arm holds: the linear model."""
HELD = {"bare": (0.15, 0.2, 1e-6), "arm": (0.554, 6.45, 135.0)}
"""Mass [kg], damping [N·s/m] and spring [N/m] of both."""
LOOP = 1.5e-3
"""Delay of the servo's loop itself [s]: a state is taken in a period after its hand, and its force is held for one."""


def largest_stable(mass, damping, spring, delay):
    """Stiffness K at which m s² + b s + k + K e^{−sT} has its first root on the imaginary axis."""

    def phase(w):
        return np.angle((spring - mass * w * w + 1j * damping * w) * np.exp(1j * w * delay))

    # −K has the phase ±π: the first frequency above that of the spring where the left side has it
    grid = np.linspace(np.sqrt(spring / mass) + 1e-6, np.pi / delay, 20_000)
    turned = np.unwrap([phase(w) for w in grid])
    at = int(np.argmax(turned >= np.pi))
    w = brentq(lambda x: np.interp(x, grid, turned) - np.pi, grid[at - 1], grid[at])
    return abs(spring - mass * w * w + 1j * damping * w)


@pytest.fixture(scope="module")
def parts():
    return delivery()


@pytest.mark.parametrize("delay", TABLE)
def test_the_linear_model_has_the_table(delay):
    for (mass, damping, spring), known in zip(HELD.values(), TABLE[delay], strict=True):
        assert largest_stable(mass, damping, spring, 1e-3 * delay) == pytest.approx(known, rel=0.03)


@pytest.mark.thorough
def test_a_delayed_spring_is_stable_up_to_the_linear_models_stiffness(parts, device):
    """A sphere that stands still, in the release's chain, which feels traps as they were; 7 % below and above.

    No passivity control, no filter. A hand that is let go a little from rest comes to rest below, and swings up above.
    """
    scene, local = parts
    cases = [(ms, who, share) for ms in (5, 20, 50) for who in HELD for share in (0.93, 1.07)]
    plans = plans_of(scene, mode="paper", passivity=None)
    asked = [Perception(delay=1e-3 * (ms - 1), frame_rate=1000.0) for ms, _, _ in cases]
    stand = Stand(parts, plans, asked, device=device)
    config = plans[0].config
    law = local.laws[config.traps[0]][local.kinds[0]].radial
    slope = POWER * law.stiffness * config.motion_gain  # pN per m of hand
    wanted = [share * largest_stable(*HELD[who], 1e-3 * (ms - 1) + LOOP) for ms, who, share in cases]
    stand.chain.force_gain.assign(np.repeat(np.array(wanted)[:, None] / slope, 2, axis=1))
    place = np.full((len(local.kinds), 3), 1e3)
    place[0] = scene.traps[config.traps[0]].position.at(0.0)
    stand.begin(place)
    mass, damping, spring = (np.array([HELD[who][n] for _, who, _ in cases]) for n in range(3))
    turn = arm_turn(mass, damping, spring, PERIOD)
    x, v = np.full(len(cases), 1e-6), np.zeros(len(cases))
    axis = np.array(config.axis_map)[0]
    hand, went = np.zeros((len(cases), 2, 3)), []
    stand.period(hand)  # takes hold of the trap, which is at the sphere
    for _ in range(6000):
        hand[:, 0] = x[:, None] * axis
        stand.period(hand)
        rest = stand.chain.force.numpy()[:, 0] @ axis / spring
        y = x - rest
        x, v = rest + turn[:, 0] * y + turn[:, 1] * v, turn[:, 2] * y + turn[:, 3] * v
        went.append(np.abs(x))
    late, later = np.max(went[2000:4000], axis=0), np.max(went[4000:6000], axis=0)
    for (ms, who, share), growth in zip(cases, later / late, strict=True):
        assert (growth > 1.02) == (share > 1.0) and (growth < 0.98) == (share < 1.0), (ms, who, share, growth)


@pytest.mark.parametrize("delay", [0.02, 0.1])
def test_a_delay_is_a_phase(parts, device, delay):
    """−360°·f·T between the release's chain and the same without delay, and no other size."""
    scene, local = parts
    plans = plans_of(scene, mode="paper", passivity=None)
    stand = Stand(parts, plans, [Perception(delay=delay, frame_rate=1000.0)], device=device)
    place = np.full((len(local.kinds), 3), 1e3)
    place[0] = np.add(scene.traps[plans[0].config.traps[0]].position.at(0.0), (0.3, 0.0, 0.0))
    stand.begin(place)
    axis = np.array(plans[0].config.axis_map)[0]
    waves, forces, frequencies = [], [], np.array([1.0, 5.0])
    for tick in range(1, 1301):
        turn = 2.0 * np.pi * frequencies * tick * PERIOD
        hand = np.zeros((1, 2, 3))
        hand[0, 0] = 1e-4 * np.sin(turn).sum() * axis  # 0.1 µm of the traps each, within the trap's linear part
        stand.period(hand)
        if tick > 300:
            waves.append(np.exp(-1j * turn))
            forces.append([chain.force.numpy()[0, 0] @ axis for chain in (stand.chain, stand.reference)])
    felt, perfect = np.array(forces).T @ np.array(waves)
    np.testing.assert_allclose(felt / perfect, np.exp(-2j * np.pi * frequencies * delay), atol=1e-9)


def at_traps(scene, local):
    """(S, 3) places of all spheres of a robot in the first trap of its hand [µm]."""
    return np.array([scene.traps[3 * (body != local.bodies[0])].position.at(0.0) for body in local.bodies])


@pytest.mark.thorough
def test_noise_in_a_linear_trap_is_stiffness_times_noise(parts, device):
    """Root mean square of a force's error is k·σ; k of all traps of a hand from two biases; 5σ of 3000 estimates."""
    scene, local = parts
    sigma, step = 0.02, 0.01
    every = Perception(frame_rate=1000.0)
    asked = [replace(every, depth_error=sigma), replace(every, lateral_error=sigma)]
    asked += [replace(every, depth_bias=step), replace(every, depth_bias=-step)]
    asked += [replace(every, lateral_bias=step), replace(every, lateral_bias=-step)]
    plans = plans_of(scene, passivity=None)
    stand = Stand(parts, plans, asked, device=device)
    stand.begin(at_traps(scene, local))
    count = 3000
    for _ in range(count):
        stand.period()
    force = stand.chain.force.numpy()
    slope = {"depth": force[2] - force[3], "lateral": force[4] - force[5]}
    slope = {name: np.linalg.norm(rows, axis=-1) / (2.0 * step) for name, rows in slope.items()}
    error = np.sqrt(stand.sums.error.numpy() / count)
    tolerance = 5.0 / np.sqrt(2.0 * count)
    np.testing.assert_allclose(error[0], slope["depth"] * sigma, rtol=tolerance)
    # x and y are wrong at once, and as stiff
    np.testing.assert_allclose(error[1], np.sqrt(2.0) * slope["lateral"] * sigma, rtol=tolerance)
    said = stand.fidelity()["force_rmse_pn"][0]
    assert said == pytest.approx(np.sqrt(np.mean(error[0] ** 2)) / plans[0].config.force_gain, rel=1e-12)


@pytest.mark.quick
def test_a_perfect_picture_every_period_gives_the_perfect_force(parts, device):
    scene, local = parts
    stand = Stand(parts, plans_of(scene, passivity=None), [Perception(frame_rate=1000.0)], device=device)
    place = at_traps(scene, local) + np.random.default_rng(3).normal(0.0, 0.2, (1, len(local.kinds), 3))
    stand.begin(place)
    for tick in range(200):
        stand.period(np.full((1, 2, 3), 1e-6 * tick), place + 1e-3 * tick)
    assert np.linalg.norm(stand.chain.force.numpy()) > 0.0
    assert stand.fidelity()["force_rmse"][0] == 0.0 and stand.fidelity()["force_r2"][0] == 1.0
