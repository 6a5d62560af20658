"""Pictures, estimates and delays: what chains get, and when; errors are as large as they are said to be."""

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.operators.perception.errors import Perception
from tests.operators.perception.stand import Stand, delivery, plans_of


@pytest.fixture(scope="module")
def parts():
    return delivery()


@pytest.fixture(scope="module")
def plans(parts):
    return plans_of(parts[0])


def test_chains_get_the_newest_state_that_is_old_enough(parts, plans, device):
    """A sphere is at x = t: its place in a chain says when the picture was taken, for delays and rates of all kinds."""
    asked = [(0, 1000.0), (7, 1000.0), (0, 120.0), (5, 120.0), (50, 120.0), (33, 30.0), (200, 60.0)]
    stand = Stand(parts, plans, [Perception(delay=1e-3 * d, frame_rate=r) for d, r in asked], device=device)
    stand.begin(0.0)
    place = np.zeros(stand.reference.sphere.numpy().shape)
    for tick in range(1, 301):
        place[..., 0] = tick
        stand.period(sphere=place)
        got = stand.chain.sphere.numpy()[:, 0, 0]
        times = stand.sensing.served.time.numpy()
        for world, (delay, rate) in enumerate(asked):
            taken = [math.floor(n * 1000.0 / rate) for n in range(-400, 400)]
            newest = max(t for t in taken if t + delay <= tick)
            assert got[world] == max(newest, 0), (tick, delay, rate)
            assert times[world] == newest / 1000.0, (tick, delay, rate)


def test_late_estimates_have_the_traps_of_their_picture_if_they_are_stamped(parts, plans, device):
    """Hands at 1 mm/s: traps go 1 µm in a period, so where they are says when."""
    asked = [Perception(delay=0.02, frame_rate=1000.0, stamped=stamped) for stamped in (True, False)]
    stand = Stand(parts, plans, asked, device=device)
    stand.begin(0.0)
    hand = np.zeros((2, 2, 3))
    for tick in range(1, 51):
        hand[..., 0] = 1e-6 * tick
        stand.period(hand)
    now = stand.reference.trap.numpy()[:, 0, 0]
    late = now - stand.chain.trap.numpy()[:, 0, 0]
    np.testing.assert_allclose(late, [1e-6 * 1000.0 * 20, 0.0], atol=1e-12)


def test_a_robot_is_turned_about_its_middle(parts, plans, device):
    """A tilt of 10° lifts a sphere 4.775 µm out by 0.83 µm, and a bias shifts all of them."""
    _, local = parts
    robot = np.array(local.bodies) == local.bodies[0]
    place = np.zeros((len(local.kinds), 3))
    place[robot, 1] = np.linspace(-4.775, 4.775, robot.sum())
    stand = Stand(
        parts, plans, [Perception(tilt_bias=10.0), Perception(depth_bias=0.3, lateral_bias=0.1)], device=device
    )
    stand.begin(place)
    got = stand.chain.sphere.numpy()
    angle = np.deg2rad(10.0)
    want = place[robot] @ np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(got[0, robot], want, atol=1e-12)
    assert got[0, robot, 2].max() == pytest.approx(0.829, abs=1e-3)
    np.testing.assert_allclose(got[1], place + np.array([0.1, 0.0, 0.3]), atol=1e-12)


@pytest.mark.thorough
def test_errors_have_their_deviations_and_forget_each_other_in_their_time(parts, plans, device):
    """Variance and correlation of one picture and the next over 4000 worlds of two robots; 5σ of their estimates."""
    worlds, rate, tau = 4000, 100.0, 0.02
    asked = Perception(
        frame_rate=rate, depth_error=0.2, lateral_error=0.1, tilt_error=3.0, yaw_error=5.0, correlation=tau
    )
    stand = Stand(parts, plans, [asked] * worlds, device=device)
    stand.begin(0.0)
    first = stand.sensing.data.error.numpy().reshape(2 * worlds, 5).copy()
    for _ in range(10):
        stand.period()
    second = stand.sensing.data.error.numpy().reshape(2 * worlds, 5)
    count = len(first)
    sigma = np.array([0.1, 0.1, 0.2, np.deg2rad(3.0), np.deg2rad(5.0)])
    for rows in (first, second):
        assert np.all(np.abs(np.mean(rows, axis=0)) < 5.0 * sigma / np.sqrt(count))
        assert np.all(np.abs(np.std(rows, axis=0) / sigma - 1.0) < 5.0 / np.sqrt(2 * count))
        apart = np.corrcoef(rows.T) - np.eye(5)
        assert np.all(np.abs(apart) < 5.0 / np.sqrt(count))
    rho = np.exp(-1.0 / (rate * tau))
    found = np.mean(first * second, axis=0) / sigma**2
    assert np.all(np.abs(found - rho) < 5.0 * np.sqrt((1.0 + rho**2) / count))


def test_the_same_operator_has_the_same_errors_whatever_else_there_is(parts, plans, device):
    """Twice the deviation is twice the error to the last bit, at any delay, in any world."""
    one, two = Perception(depth_error=0.1), Perception(depth_error=0.2, delay=0.1, eyes="twin")
    stand = Stand(parts, plans, [one, two, one], number=np.array([3, 3, 4]), device=device)
    stand.begin(0.0)
    for _ in range(100):
        stand.period()
    error = stand.sensing.data.error.numpy().reshape(3, -1, 5)[..., 2]
    np.testing.assert_array_equal(2.0 * error[0], error[1])
    assert np.all(error[0] != error[2])


@pytest.mark.thorough
def test_pictures_without_an_estimate_are_as_many_as_said(parts, plans, device):
    """Counts over 200 worlds of 300 pictures; 5σ of a binomial."""
    lost, worlds, periods = 0.3, 200, 300
    stand = Stand(parts, plans, [Perception(frame_rate=1000.0, lost=lost)] * worlds, device=device)
    stand.begin(0.0)
    before = stand.sensing.data.taken.numpy().sum()
    for _ in range(periods):
        stand.period()
    made, count = stand.sensing.data.taken.numpy().sum() - before, worlds * periods
    assert abs(made - (1.0 - lost) * count) < 5.0 * np.sqrt(lost * (1.0 - lost) * count)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"delay": -0.1}, "delay is -0.1; allowed: 0 to 1 s"),
        ({"delay": math.nan}, "delay"),
        ({"frame_rate": 0.0}, "frame_rate"),
        ({"depth_error": -1.0}, "depth_error"),
        ({"lost": 1.0}, "lost"),
        ({"eyes": "ears"}, "microscope, twin"),
    ],
)
def test_what_cannot_be_is_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        Perception(**wrong)


def test_more_pictures_than_periods_are_refused(parts, plans):
    with pytest.raises(InputError, match="frame rate is 2000"):
        Stand(parts, plans, [Perception(frame_rate=2000.0)])
