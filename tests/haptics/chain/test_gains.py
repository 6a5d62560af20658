"""Gains that change while a hand is at work: smooth, passive, kept by chains that are made later."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.core import DeviceSample
from otwarp.haptics.core.config import LowPass
from tests.haptics.chain.test_passivity import EPSILON
from tests.haptics.chain.test_safety import ROUNDING
from tests.haptics.setups import PERIOD, drive, hand_config, largest_step, make_chain, random_motion, scene_at, size

PAPER = {"mode": "paper", "force_filter": LowPass(alpha=0.5, rate=1000.0), "passivity": None}


def held(t):
    return (0.004, 0.0, 0.0)


def start(chain: Chain):
    """A sphere at the origin, a hand that carried its trap 0.4 µm off it, armed and ramped in."""
    chain.arm()
    drive(chain, lambda t: (min(4e-6 * t / PERIOD, 0.004), 0.0, 0.0), 1500)


def test_the_force_goes_to_the_new_gain_within_the_slew_limit_and_the_trap_stays():
    chain = make_chain(hand_config(slew=100.0, force_gain=0.05))
    start(chain)
    before = drive(chain, held, 1, start=1500)[-1]
    chain.set_gains(motion_gain=1000.0, force_gain=0.25)
    after = drive(chain, held, 100, start=1501)
    assert size(after[-1].force) == pytest.approx(5.0 * size(before.force), rel=1e-9)
    assert largest_step(after, before.force) == pytest.approx(100.0 * PERIOD, rel=1e-6)  # the limit is what shapes it
    assert largest_step(after, before.force) <= 100.0 * PERIOD * (1.0 + ROUNDING)
    assert {now.traps for now in after} == {before.traps}
    chain.set_gains()
    assert drive(chain, held, 100, start=1601)[-1].force == pytest.approx(before.force, rel=1e-9)


@pytest.mark.parametrize("mode", ["stable", "paper"])
def test_gains_are_what_a_chain_configured_with_them_has(mode):
    changes = PAPER if mode == "paper" else {}
    one = make_chain(hand_config(**changes))
    other = make_chain(hand_config(force_gain=0.11, motion_gain=70.0, **changes))
    one.set_gains(70.0, 0.11)
    for chain in (one, other):
        chain.arm()
    hand = random_motion(random.Random(1), 0.01)
    runs = [drive(chain, hand, 500, scene=lambda n, t: scene_at(n, t, (0.3, 0.0, 0.0))) for chain in (one, other)]
    assert runs[0] == runs[1]
    assert max(size(now.force) for now in runs[0]) > 0.0


def test_paper_mode_takes_a_gain_with_the_next_message_and_keeps_it_when_it_takes_hold_anew():
    chain = make_chain(hand_config(**PAPER, force_gain=0.05))

    def seen(n, t):
        return scene_at(n, t, (0.3, 0.0, 0.0))

    chain.arm()
    drive(chain, held, 100, scene=seen)
    full = size(chain.asked)
    chain.set_gains(None, 0.1)
    drive(chain, held, 1, start=100, scene=lambda n, t: seen(99, t))
    assert size(chain.asked) == full  # no message yet
    drive(chain, held, 100, start=101, scene=seen)
    assert size(chain.asked) == pytest.approx(2.0 * full, rel=1e-6)
    drive(chain, held, 100, start=201, scene=lambda n, t: scene_at(n, t - 10.0, (0.3, 0.0, 0.0)))  # time began anew
    assert size(chain.asked) == pytest.approx(2.0 * full, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_passive_and_slew_limited_while_gains_jump_every_few_periods(seed):
    rng = random.Random(seed)
    slew = 100.0
    chain = make_chain(hand_config(ramp_time=0.1, slew=slew))
    hand = random_motion(rng, 0.1)
    chain.arm()
    energy, least, run = 0.0, 0.0, []
    force, place = (0.0, 0.0, 0.0), hand(0.0)
    for n in range(4000):
        if rng.random() < 0.05:
            chain.set_gains(rng.choice([None, 30.0, 300.0]), rng.choice([None, 10 ** rng.uniform(-3, 0.5)]))
        before, place = place, hand(n * PERIOD)
        energy -= sum(f * (a - b) for f, a, b in zip(force, place, before, strict=True))
        least = min(least, energy)
        now = chain.step(DeviceSample(n * PERIOD, place), scene_at(n // 8, n * PERIOD))
        run.append(now)
        force = now.force
    assert least >= -EPSILON
    assert max(size(now.force) for now in run) > 0.1  # something was rendered
    assert largest_step(run) <= slew * PERIOD * (1.0 + ROUNDING)
    fastest = max(math.dist(a.traps[0][1], b.traps[0][1]) for a, b in itertools.pairwise(run) if a.traps and b.traps)
    quickest = max(math.dist(hand(n * PERIOD), hand(n * PERIOD + PERIOD)) for n in range(4000))
    assert fastest <= 300.0 * quickest * (1.0 + 1e-9)  # no trap goes farther than its hand, times the largest gain


@pytest.mark.parametrize(
    ("gains", "says"),
    [
        ((0.0, None), "hand.motion_gain is 0.0; allowed: above 0"),
        ((math.nan, None), "hand.motion_gain is nan"),
        ((None, -1.0), "hand.force_gain is -1.0; allowed: 0 to"),
        ((50.0, math.inf), "hand.force_gain is inf"),
    ],
)
def test_gains_out_of_range_change_nothing(gains, says):
    chain, same = make_chain(hand_config()), make_chain(hand_config())
    with pytest.raises(InputError, match=says):
        chain.set_gains(*gains)
    for one in (chain, same):
        one.arm()
    hand = random_motion(random.Random(2), 0.05)
    assert drive(chain, hand, 100) == drive(same, hand, 100)
