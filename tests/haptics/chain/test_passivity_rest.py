"""A hand that rests: its debts are forgiven, its reserve fills up, and no late cycle takes its force for ever."""

from __future__ import annotations

import math
from itertools import cycle

import pytest

from otwarp.haptics.chain.passivity import MEMORY, REFILL, Passivity
from otwarp.haptics.core import ZERO, DeviceSample, SceneFrame, SphereFrame, TrapFrame
from tests.haptics.chain.adversary import DEFAULT, PER_METRE, PERIOD, spring_chain

RESERVE = DEFAULT.reserve

WORDS = (6, 11, 8, 9, 7, 11, 9, 8)
"""Periods between two words of a device that says 116 a second, with the jitter of a driver."""

RAMP = 0.5
"""Seconds from armed to full force, as by default."""

BACK = 2.0 * MEMORY + RAMP
"""Seconds in which a force is back, as docs/haptics.md says."""

LATE = 3.0
"""When something is late [s]."""

KEPT = 0.8
"""Part of the force that is back at least: what a hand may have hidden while nobody heard of it is charged."""


def resting(late: float, who: str, pressed: bool) -> list[float]:
    """Size of the force on a hand that rests, each period [N]; something comes `late` once [s].

    Args:
        late: How late.
        who: `servo` or `device`.
        pressed: Whether the hand has pressed the spring of 240 N/m; else it is 2 mm away when it is armed.
    """
    chain, words, beat = spring_chain(240.0, DEFAULT, ramp=RAMP), cycle(WORDS), 0
    chain.arm()
    sphere = SphereFrame(ZERO if pressed else (-2e-3 * PER_METRE, 0.0, 0.0), 0)
    found, n, word, x = [], 0, 0, 0.0
    while n < round((LATE + BACK + MEMORY) / PERIOD):
        if fresh := n >= word:
            x, word = 0.02 * min(1.0, n * PERIOD) if pressed else 0.0, n + next(words)
            if who == "device" and word * PERIOD >= LATE:
                word, who = n + round(late / PERIOD), ""
        beat += 1
        scene = SceneFrame(beat, n * PERIOD, (sphere,), (TrapFrame(0, ZERO, 1.0),))
        now = chain.step(DeviceSample(n * PERIOD, (x, 0.0, 0.0), 0, fresh), scene)
        step = 1
        if who == "servo" and n * PERIOD >= LATE:
            step, who = round(late / PERIOD), ""
        found += step * [math.hypot(*now.force)]
        n += step
    return found


@pytest.mark.parametrize("who", ["servo", "device"])
@pytest.mark.parametrize("late", [0.015, 0.03, 0.095])
@pytest.mark.parametrize("pressed", [False, True])
def test_a_hand_at_rest_has_its_force_back_after_a_late_cycle(late, who, pressed):
    """What fell in a silence of the device was charged with 0.5 m/s for as long as it lasted: a debt for ever."""
    found = resting(late, who, pressed)
    first, back = round(LATE / PERIOD), round((LATE + BACK) / PERIOD)
    usual = min(found[first - 500 : first])
    assert usual > 0.01
    assert min(found[first:back]) < 0.8 * usual  # it was late
    assert min(found[back:]) >= KEPT * usual


def debtor() -> Passivity:
    """A hand that was yanked along a force for 100 ms, and owes 50 mJ."""
    passivity = Passivity(DEFAULT, PERIOD)
    passivity.observe(0.0, 0.0, 0.0, PERIOD)
    passivity.send((1.0, 0.0, 0.0))
    passivity.observe(0.05, 0.0, 0.0, 0.1)
    passivity.send(ZERO)
    return passivity


def test_a_debt_ends_when_the_hand_has_rested():
    passivity = debtor()
    assert passivity.energy == pytest.approx(-0.05, rel=1e-4)
    for n in range(round(2.0 * MEMORY / PERIOD)):
        passivity.observe(0.05 + 1e-4 * math.sin(2.0 * math.pi * 6.0 * n * PERIOD), 0.0, 0.0, PERIOD)  # tremor
    fresh = Passivity(DEFAULT, PERIOD)
    assert passivity.account == fresh.account == (0.0, -RESERVE, RESERVE, PERIOD)


def test_a_debt_does_not_end_while_the_hand_moves():
    """Neither in a block in which it moved, nor by a vibration."""
    passivity = debtor()
    for n in range(round(10.0 / PERIOD)):
        passivity.observe(0.05 + 1e-4 * math.sin(2.0 * math.pi * 30.0 * n * PERIOD), 0.0, 0.0, PERIOD)
    assert passivity.energy == pytest.approx(-0.05, rel=1e-4)


def test_the_reserve_fills_up_while_the_hand_rests():
    passivity = Passivity(DEFAULT, PERIOD)
    passivity.energy = -0.9 * RESERVE
    for _ in range(round(3.1 * MEMORY / PERIOD)):
        passivity.observe(0.0, 0.0, 0.0, PERIOD)
    assert passivity.energy == pytest.approx(-0.9 * RESERVE + 3.0 * MEMORY * REFILL, rel=1e-3)
    for _ in range(round(3.0 * MEMORY / PERIOD)):
        passivity.observe(0.0, 0.0, 0.0, PERIOD)
    assert passivity.energy == 0.0


def test_an_encoder_that_flickers_rests_and_what_is_in_store_is_kept():
    passivity = Passivity(DEFAULT, PERIOD, quantum=55e-6)
    passivity.energy = 0.1
    for n in range(round(2.0 * MEMORY / PERIOD)):
        passivity.observe(55e-6 * (n % 2), 0.0, 0.0, PERIOD)
    assert passivity.energy == 0.1
    assert passivity.account[1:3] == (-RESERVE, RESERVE)


def test_whoever_takes_the_reserve_and_rests_gets_what_fills_up_and_no_more():
    """The worst for a hand that rests: 10 µW."""
    passivity, x, taken, time = Passivity(DEFAULT, PERIOD), 0.0, 0.0, 0.0
    for n in range(round(15.5 * MEMORY / PERIOD)):
        force = passivity.bound((1.0, 0.0, 0.0))
        passivity.send(force)
        # 2 mm along the force in 0.1 s, and rest
        n %= round(MEMORY / PERIOD)
        step = 2e-5 * (1.0 - math.cos(2.0 * math.pi * n / 100)) if n < 100 else 0.0
        x, taken, time = x + step, taken + force[0] * step, time + PERIOD
        passivity.observe(x, 0.0, 0.0, PERIOD)
        assert taken <= RESERVE + REFILL * time
        assert passivity.energy >= -RESERVE
    assert taken > 0.9 * (RESERVE + 15.0 * REFILL * MEMORY)
