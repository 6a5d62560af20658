"""Limit cycles are told from what noise, drift and ringing do to a hand that should rest."""

import numpy as np
import pytest

from otwarp.operators.perception.cycles import LEAST, limit_cycles, slowest

RATE, SECONDS = 200.0, 4.0
TIME = np.arange(round(RATE * SECONDS)) / RATE
AXIS = np.array([0.6, 0.0, -0.8])


def along(way):
    """(n, 3) places about a rest that is not at 0."""
    return 0.01 + np.asarray(way)[:, None] * AXIS


@pytest.mark.parametrize("frequency", [1.0, 1.3, 2.7, 11.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_an_oscillation_that_goes_on_is_one(frequency, noise):
    """At the slowest that is told and up to a tenth of the rate; with noise of a third of its amplitude, too."""
    assert slowest(SECONDS) == 1.0
    amplitude, rng = 50e-6, np.random.default_rng(4)
    way = amplitude * (np.sin(2.0 * np.pi * frequency * TIME + 0.4) + noise * rng.standard_normal(len(TIME)))
    found, size = limit_cycles(along(way), RATE)
    assert found == pytest.approx(frequency, rel=0.03)
    assert size == pytest.approx(amplitude * np.sqrt(1.0 + 2.0 * noise**2), rel=0.1)


def test_one_that_grows_is_one_and_one_that_decays_is_none():
    wave = 50e-6 * np.sin(2.0 * np.pi * 3.0 * TIME)
    grows, _ = limit_cycles(along(wave * np.exp(0.5 * TIME)), RATE)
    decays, size = limit_cycles(along(wave * np.exp(-0.5 * TIME)), RATE)
    assert grows == pytest.approx(3.0, rel=0.03) and np.isnan(decays) and size == 0.0


def test_what_is_too_small_slow_or_broken_is_none():
    ways = [0.9 * LEAST * np.sin(2.0 * np.pi * 3.0 * TIME), 1e-4 * np.sin(2.0 * np.pi * 0.6 * TIME), 1e-4 * TIME,
            np.zeros(len(TIME)), np.where(TIME > 3.0, np.nan, 1e-4 * np.sin(2.0 * np.pi * 3.0 * TIME))]  # fmt: skip
    found, size = limit_cycles(np.array([along(way) for way in ways]), RATE)
    assert np.all(np.isnan(found)) and not np.any(size)


def driven(count, mass=0.554, damping=6.45, spring=135.0):
    """(count, n) an arm at a device in white noise; its frequency is 2.5 Hz, its Q 1.3."""
    rng, step = np.random.default_rng(9), 1.0 / RATE / 10.0
    x, v, out = np.zeros(count), np.zeros(count), []
    for n in range(10 * (len(TIME) + 200)):
        v += step / mass * (-damping * v - spring * x) + 3e-3 * np.sqrt(step) * rng.standard_normal(count)
        x += step * v
        if n % 10 == 0 and n >= 2000:
            out.append(x.copy())
    return np.array(out).T


def test_noise_is_none():
    """Of an arm that noise drives; of white noise; of errors that are forgotten in half a second: 300 of each."""
    rng = np.random.default_rng(6)
    slow, kept = np.zeros((300, len(TIME))), np.exp(-1.0 / (0.5 * RATE))
    slow[:, 0] = rng.standard_normal(300)
    for n in range(1, len(TIME)):
        slow[:, n] = kept * slow[:, n - 1] + np.sqrt(1.0 - kept**2) * rng.standard_normal(300)
    for ways in (driven(300), rng.standard_normal((300, len(TIME))), slow):
        found, _ = limit_cycles(np.array([along(1e-4 * way / way.std()) for way in ways]), RATE)
        assert not np.isfinite(found).any()


@pytest.mark.parametrize("share", [0.93, 1.07])
def test_a_delayed_spring_that_saturates_has_one_above_its_stable_stiffness(share):
    """An arm that is pushed by a force of its place 50 ms ago: 153 N/m is stable in the linear model, at 3.9 Hz.

    Above, the swing grows up to where the force is bounded, as in a trap, and goes on; below, it dies away.
    """
    mass, damping, spring, delay = 0.554, 6.45, 135.0, 0.05
    w = 2.0 * np.pi * np.linspace(1.0, 9.0, 40_001)
    # m s² + b s + k + K e^{−sT} = 0 on the imaginary axis: −K has the phase ±π
    turned = (spring - mass * w * w + 1j * damping * w) * np.exp(1j * w * delay)
    at = int(np.flatnonzero(np.diff(np.sign(turned.imag)) * (turned.real[:-1] < 0.0))[0])
    stiffness, bound = -share * turned.real[at], 0.02
    step, back = 1e-3, round(1e3 * delay)
    x, v, out = [1e-4] * (back + 1), 0.0, []
    for n in range(24_000):
        force = -float(np.clip(stiffness * x[-1 - back], -bound, bound))
        v += step / mass * (force - damping * v - spring * x[-1])
        x.append(x[-1] + step * v)
        if n >= 20_000 and n % 5 == 0:
            out.append(x[-1])
    found, _ = limit_cycles(along(out), RATE)
    if share < 1.0:
        assert np.isnan(found)
    else:
        assert found == pytest.approx(w[at] / (2.0 * np.pi), rel=0.05)
