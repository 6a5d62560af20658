"""Hands of simulated operators alone: what they plan, when what is seen and felt comes to bear."""

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.operators.kernels.types import NOTHING, RESPONDS, YIELDS
from otwarp.operators.population import load_population
from otwarp.operators.task import SPACING
from tests.operators.work import PERFECT, HandsAlone, loop_of, operators


def wanted_path(loop, seconds):
    """(n, 3) way of the left hand at the end of each period, at the author's pace [m]."""
    task = loop.people.task
    path = task.path.numpy()[0]
    times = np.arange(1, round(seconds * 1000) + 1) * 1e-3
    return np.stack([np.interp(times, np.arange(len(path)) * SPACING, column) for column in path.T], axis=1)


def test_a_perfect_operator_follows_the_path(device):
    """Within 0.5 µm of traps that go 300 µm, what submovements of half a second smooth away, and on time at its end."""
    loop = loop_of(operators(1, **PERFECT, clearance=-100.0), device=device)
    hands, went = HandsAlone(loop), []
    for _ in range(140):
        went.append(hands.step(100)[0])
    went = np.array(went)
    path = wanted_path(loop, 14.0)[99::100]
    assert np.max(np.linalg.norm(went[:, 0] - path, axis=1)) * loop.task.motion_gain < 0.5
    np.testing.assert_allclose(went[-1, 0], path[-1], atol=1e-12)
    np.testing.assert_allclose(went[:, 0], went[:, 1], atol=1e-15)  # both hands lead the same way


def test_noise_is_what_the_population_says(device):
    """Standard deviation of submovements about what was meant, over their length: 5σ of 200 operators' first ones."""
    noise = 0.04
    loop = loop_of(operators(200, motor_noise=noise, hand_lag=0.0, noise_correlation=0.0), device=device)
    HandsAlone(loop).step(1200)
    meant, made = (getattr(loop.people.mind, name).numpy() for name in ("meant", "made"))
    length = np.linalg.norm(meant, axis=-1)
    moved = length > 0.0
    share = (made - meant)[moved] / length[moved][:, None]
    count = share.size
    assert abs(np.std(share) / noise - 1.0) < 5.0 / np.sqrt(2 * count)
    assert abs(np.mean(share)) < 5.0 * noise / np.sqrt(count)


@pytest.mark.parametrize(("delay", "expected"), [(0.099, 399), (0.100, 599)])
def test_an_error_is_answered_after_exactly_the_visual_delay(device, delay, expected):
    """Corrections fall on periods 199, 399, 599: an error from period 300 on is 99 periods old in the second."""
    values = operators(1, pace=1e-9, motor_noise=0.0, interval=0.2, visual_delay=delay)
    loop = loop_of(values, device=device)
    hands = HandsAlone(loop)
    hands.step(300)
    sent = []
    for _ in range(300, 700):
        hands.step(1, error=(1e-3, 0.0, 0.0))
        sent.append(bool(np.any(loop.people.mind.sent.numpy())))
    assert 300 + sent.index(True) == expected


def test_a_correction_takes_back_its_part_and_counts_what_is_under_way(device):
    """A steady error e that no motion undoes: the first correction is −G·e, the next, which has not seen it, less."""
    values = operators(1, pace=1e-9, motor_noise=0.0, interval=0.2, visual_delay=0.15, duration=0.5, crossover=4.0)
    loop = loop_of(values, device=device)
    hands = HandsAlone(loop)
    hands.step(600, error=(1e-3, 0.0, 0.0))
    sent = loop.people.mind.sent.numpy()[0, 0, :3, 0]
    gain = 1.0 - np.exp(-4.0 * 0.2)
    x = (0.2 - 0.15) / 0.5  # of the first correction, as the second has seen it
    unseen = 1.0 - (10 * x**3 - 15 * x**4 + 6 * x**5)
    second = -gain * (1e-3 + unseen * -gain * 1e-3)
    np.testing.assert_allclose(sent[:2], [-gain * 1e-3, second], rtol=1e-12)


def test_errors_below_the_threshold_are_left(device):
    values = operators(2, pace=1e-9, motor_noise=0.0, visual_threshold=np.array([0.2, 0.4]))
    loop = loop_of(values, device=device)
    HandsAlone(loop).step(900, error=(0.3 / loop.task.motion_gain, 0.0, 0.0))
    moved = np.abs(loop.people.mind.sent.numpy()).max(axis=(1, 2, 3)) > 0.0
    assert moved.tolist() == [True, False]


def test_force_moves_the_arm_by_its_compliance(device):
    values = operators(3, pace=1e-9, visual_threshold=1e6, stiffness=135.0)
    loop = loop_of(values, feels=np.array([NOTHING, YIELDS, RESPONDS]), device=device)
    hand = HandsAlone(loop).step(4000, force=(0.0, 0.27, 0.0))
    np.testing.assert_allclose(hand[:, :, 1], [[0.0] * 2, [0.002] * 2, [0.002] * 2], atol=1e-9)
    np.testing.assert_allclose(loop.people.accounts()["work"], [0.0, 2 * 0.27 * 0.002, 2 * 0.27 * 0.002], rtol=1e-6)


def test_slowing_begins_after_exactly_the_response_delay_and_only_in_who_responds(device):
    """A force of 1.5 onsets halves the speed; its first period is number 500."""
    values = operators(3, motor_noise=0.0, response_onset=0.4, response_delay=np.array([0.08, 0.08, 0.081]))
    loop = loop_of(values, feels=np.array([YIELDS, RESPONDS, RESPONDS]), device=device)
    hands = HandsAlone(loop)
    hands.step(500)
    clocks = [loop.people.mind.clock.numpy().copy()]
    for n in range(100):
        hands.step(1, force=(0.6, 0.0, 0.0) if n == 0 else None)
        clocks.append(loop.people.mind.clock.numpy().copy())
    rate = np.diff(np.array(clocks), axis=0) / 1e-3
    np.testing.assert_allclose(rate[:, 0], 1.0, atol=1e-9)
    for n, delay in ((1, 80), (2, 81)):
        np.testing.assert_allclose(rate[:delay, n], 1.0, atol=1e-9)
        np.testing.assert_allclose(rate[delay:, n], 0.5, atol=1e-9)


def test_changes_of_force_below_the_difference_threshold_are_not_felt(device):
    values = operators(1, force_difference=0.07)
    loop = loop_of(values, feels=RESPONDS, device=device)
    hands = HandsAlone(loop)
    noticed = []
    for force in (1.0, 1.06, 1.08, 1.02, 1.0):
        hands.step(1, force=(force, 0.0, 0.0))
        noticed.append(float(loop.people.mind.noticed.numpy()[0]))
    assert noticed == [1.0, 1.0, 1.08, 1.08, 1.0]


def test_what_lags_behind_is_waited_for(device):
    values = operators(2, motor_noise=0.0, lag_threshold=1.0)
    loop = loop_of(values, device=device)
    loop.people.sight.lag.assign(np.array([0.9, 2.1]))
    HandsAlone(loop).step(3000)
    progress = loop.people.mind.progress.numpy()
    assert progress[0] > 2.0 and progress[1] < 0.5


def test_moving_obstacles_are_waited_for_by_who_keeps_a_gap(device):
    """On the author's path a cube comes near after some 5 s; nobody waits for pillars and walls, which stand still."""
    values = operators(2, **PERFECT)
    values[:, load_population().names.index("clearance")] = [1.0, -100.0]
    loop = loop_of(values, device=device)
    HandsAlone(loop).step(9000)
    waited = loop.people.accounts()["waited"]
    assert 100 < waited[0] < 5000 and waited[1] == 0


@pytest.mark.quick
def test_more_submovements_than_there_is_room_for_are_refused():
    with pytest.raises(InputError, match="submovements"):
        loop_of(operators(1, interval=0.1))
