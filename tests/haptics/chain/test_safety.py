"""Safety: arming, ramp, slew limit, clamp, guard, watchdog, and that nothing that comes in gets past them."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.haptics.chain.safety import Safety
from otwarp.haptics.core import DeviceSample, SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import SafetyConfig
from tests.haptics.setups import PERIOD, drive, hand_config, largest_step, make_chain, scene_at, size

ROUNDING = 1e-12
"""Of a difference of two forces, relative."""

HAND = (0.005, 0.0, 0.0)
"""Half a micrometre from the sphere: 0.3 N."""


def pull(t: float):
    """To `HAND` within 50 ms, and there it stays."""
    return (min(HAND[0], 0.1 * t), 0.0, 0.0)


def armed_and_pulling(**changes):
    """A chain that has rendered its steady force for a while, and the run so far."""
    chain = make_chain(hand_config(ramp_time=0.1, **changes))
    chain.arm()
    run = drive(chain, pull, 300)
    assert run[-1].state == "armed" and size(run[-1].force) == pytest.approx(0.3, rel=1e-3)
    return chain, run


def test_nothing_before_arming():
    chain = make_chain(hand_config())
    run = drive(chain, pull, 200)
    assert {now.state for now in run} == {"disarmed"} and {now.force for now in run} == {(0.0, 0.0, 0.0)}
    assert run[-1].traps[0][1][0] == pytest.approx(0.5)  # an input device needs no arming


def test_ramp_is_linear():
    chain = make_chain(hand_config(ramp_time=0.2, passivity=None))
    drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 50)
    chain.arm()
    run = drive(chain, lambda t: (0.005, 0.0, 0.0), 250, start=50)
    full = size(run[-1].force)
    assert size(run[99].force) == pytest.approx(0.5 * full, rel=1e-6)
    assert [now.state for now in run].index("armed") == pytest.approx(199, abs=1)
    assert largest_step(run) == pytest.approx(full * PERIOD / 0.2, rel=1e-6)


@pytest.mark.parametrize("what", ["killed", "simulation NaN", "device NaN", "time NaN", "silent device"])
def test_what_dies_lets_go(what):
    """Falls from 20 ms after the last fresh state, monotonously; zero and disarmed by 100 ms; never a jump."""
    chain, run = armed_and_pulling()
    last = run[-1].force
    slew = chain.config.safety.slew
    nan = math.nan
    out = []
    # the last fresh state came at n = 299
    for n in range(300, 420):
        t, place, scene, fresh = n * PERIOD, HAND, scene_at(n, n * PERIOD), True
        if what == "killed":
            scene = scene_at(299, 0.299)
        elif what == "simulation NaN":
            scene = scene_at(n, t, (nan, 0.0, 0.0))
        elif what == "device NaN":
            place = (nan, 0.0, 0.0)
        elif what == "time NaN":
            t = nan
        else:
            fresh = False
        # this hand pulls further away meanwhile, which must not raise the force
        if what == "killed":
            place = (HAND[0] + 0.001 * min(1.0, (n - 299) / 50), 0.0, 0.0)
        out.append(chain.step(DeviceSample(t, place, 0, fresh), scene))
    sizes = [size(now.force) for now in out]
    age = [(n - 299) * 1e-3 for n in range(300, 420)]
    assert all(math.isfinite(s) for s in sizes)
    assert largest_step(out, last) <= slew * PERIOD * (1.0 + ROUNDING)
    falls = [s for s, a in zip(sizes, age, strict=True) if a >= 0.0195]
    assert falls[0] < max(size(last), sizes[18]) and all(b < a or b == 0.0 for a, b in pairwise(falls))
    assert all(s == 0.0 for s, a in zip(sizes, age, strict=True) if a >= 0.0995)
    if what in ("killed", "silent device"):
        assert all(s >= 0.999 * size(last) for s, a in zip(sizes, age, strict=True) if a < 0.0195)
        assert out[-1].state == "disarmed"
        silent = "simulation" if what == "killed" else "device"
        assert chain.complaint == f"nothing new from the {silent} for 0.1 s"
    else:
        assert out[-1].state == "fault" and chain.complaint
        # it decays from where it was, over the same 80 ms, rather than being dropped
        assert sizes[0] > 0.95 * size(last) and 0.4 * size(last) < sizes[39] < 0.6 * size(last)
    assert not chain.safety.wanted
    # what comes back does not push before it is armed again
    back = drive(chain, lambda t: HAND, 50, start=420)
    assert {now.force for now in back} == {(0.0, 0.0, 0.0)}
    chain.arm()
    assert drive(chain, lambda t: (HAND[0] + 0.02 * (t - 0.47), 0, 0), 200, start=470)[-1].state == "armed"


@pytest.mark.parametrize("every", [5, 15, 40, 90, 150])
def test_arming_again_and_again_keeps_no_force_on(every):
    """Who arms says nothing of the simulation: with a state that is 20 ms old the force falls, and stays away."""
    chain, _ = armed_and_pulling()
    out = []
    for n in range(300, 900):
        if n % every == 0:
            chain.arm()
        out.append(chain.step(DeviceSample(n * PERIOD, HAND), scene_at(299, 0.299)))
    sizes = [size(now.force) for now in out]
    assert all(b <= a for a, b in pairwise(sizes[20:]))
    assert {now.force for now in out[100:]} == {(0.0, 0.0, 0.0)} and not chain.safety.wanted
    assert {now.state for now in out[100:]} == {"disarmed"}
    # with fresh states it is armed as before
    chain.arm()
    assert drive(chain, lambda t: HAND, 200, start=900)[-1].state == "armed"


def test_a_late_state_ramps_in_again():
    chain, run = armed_and_pulling()
    stalled = drive(chain, lambda t: HAND, 50, start=300, scene=lambda n, t: scene_at(299, 0.299))
    assert stalled[-1].state == "decaying" and chain.complaint == ""
    again = drive(chain, lambda t: HAND, 150, start=350)
    assert again[0].state == "ramping" and again[-1].state == "armed"
    assert size(again[-1].force) == pytest.approx(size(run[-1].force), rel=1e-6)
    assert largest_step(again, stalled[-1].force) < 0.01


def test_dead_man_released_and_held_again():
    chain = make_chain(hand_config(dead_man=True, ramp_time=0.1))
    chain.arm()
    held = drive(chain, pull, 300, buttons=lambda n: 1)
    free = drive(chain, pull, 150, start=300)
    again = drive(chain, pull, 300, start=450, buttons=lambda n: 1)
    assert held[-1].state == "armed" and free[-1].state == "decaying" and free[-1].force == (0.0, 0.0, 0.0)
    assert again[-1].state == "armed" and size(again[-1].force) > 0.0


def test_disarm_falls_and_stays():
    chain, run = armed_and_pulling()
    chain.disarm()
    out = drive(chain, pull, 100, start=300)
    assert out[0].state == "decaying" and out[-1].state == "disarmed" and out[-1].force == (0.0, 0.0, 0.0)
    assert largest_step(out, run[-1].force) < 0.01


def test_motors_are_held_to_what_they_bear_for_ever():
    """A steady 3 N: full at first, and in the end the continuous force."""
    config = SafetyConfig(ramp_time=0.0, thermal_time=1.0)
    safety = Safety(config, 1000.0)
    safety.arm()
    sizes = [size(safety.step((3.0, 0.0, 0.0), elapsed=PERIOD, age=0.0, allowed=True)) for _ in range(8000)]
    assert sizes[20] == 3.0
    assert sizes[-1] == pytest.approx(0.88, rel=1e-3)
    assert max(abs(b - a) for a, b in pairwise(sizes[10:])) < 0.05
    calm = Safety(config, 1000.0)
    calm.arm()
    steady = [calm.step((0.6, 0.0, 0.0), elapsed=PERIOD, age=0.0, allowed=True)[0] for _ in range(5000)]
    assert min(steady[10:]) == 0.6


anything = st.floats(allow_nan=True, allow_infinity=True)
vector = st.tuples(anything, anything, anything)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(
            vector,
            anything,
            st.integers(0, 3),
            st.booleans(),
            vector,
            vector,
            anything,
            st.integers(0, 3),
            st.booleans(),
        ),
        min_size=1,
        max_size=25,
    ),
    st.booleans(),
)
def test_no_input_gets_past(steps, paper):
    """Any position, time, sphere, trap, power; a sane start, and sane steps between: finite, clamped, slew limited."""
    changes = {"mode": "paper", "passivity": None} if paper else {}
    chain = make_chain(hand_config(ramp_time=0.01, **changes))
    chain.arm()
    drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 60)
    clamp, slew = chain.config.safety.clamp, chain.config.safety.slew
    before, n = chain.safety.force, 60
    for position, time, buttons, fresh, sphere, trap, power, kind, arm in steps:
        n += 1
        if arm:
            chain.arm()
        sane = DeviceSample(n * PERIOD, (0.005, 0.0, 0.0))
        sample = sane if kind == 1 else DeviceSample(time if kind == 2 else n * PERIOD, position, buttons, fresh)
        scene = SceneFrame(n, n * PERIOD, (SphereFrame(sphere, 0),), (TrapFrame(0, trap, power),))
        now = chain.step(sample, scene_at(n, n * PERIOD) if kind == 0 else scene)
        assert size(now.force) <= clamp
        assert math.dist(now.force, before) <= slew * PERIOD * (1.0 + ROUNDING) + 1e-15
        assert all(map(math.isfinite, (*now.position, now.time, now.energy)))
        assert all(math.isfinite(x) for _, place in now.traps for x in place)
        before = now.force


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(
            st.one_of(vector, st.tuples(*[st.floats(-20.0, 20.0)] * 3)),
            st.sampled_from([0.0, 2e-4, PERIOD, 5e-3, 1.0]),
            st.sampled_from([0.0, 0.0, 0.0, 0.03, 0.2]),
            st.booleans(),
            st.booleans(),
        ),
        min_size=1,
        max_size=40,
    )
)
def test_no_force_gets_past(steps):
    """Safety alone, asked for anything, at once: the ramp is off, and most of what is asked is a jump."""
    config = SafetyConfig(ramp_time=0.0)
    safety = Safety(config, 1000.0)
    safety.arm()
    before = safety.force
    for force, elapsed, age, allowed, arm in steps:
        if arm:
            safety.arm()
        now = safety.step(force, elapsed=elapsed, age=age, allowed=allowed)
        assert size(now) <= config.clamp
        assert math.dist(now, before) <= config.slew * min(elapsed, PERIOD) * (1.0 + ROUNDING) + 1e-15
        before = now


def test_slew_limit_is_reached_and_not_passed():
    """3 N at 1000 N/s take three periods; so does the way back when they are no longer asked for."""
    safety = Safety(SafetyConfig(ramp_time=0.0), 1000.0)
    safety.arm()
    wanted = [(3.0, 0.0, 0.0)] * 4 + [(-3.0, 0.0, 0.0)] * 7
    sizes = [safety.step(force, elapsed=PERIOD, age=0.0, allowed=True)[0] for force in wanted]
    assert sizes == pytest.approx([1.0, 2.0, 3.0, 3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0, -3.0], abs=1e-12)


def test_a_force_that_falls_does_not_follow_a_hand_that_pulls():
    """After 20 ms without a state, asked for ten times the force: it falls all the same."""
    safety = Safety(SafetyConfig(ramp_time=0.0), 1000.0)
    safety.arm()
    for _ in range(10):
        before = safety.step((0.3, 0.0, 0.0), elapsed=PERIOD, age=0.0, allowed=True)[0]
    for n in range(20, 100):
        now = safety.step((3.0, 0.0, 0.0), elapsed=PERIOD, age=n * PERIOD, allowed=True)[0]
        assert now < before or now == 0.0
        before = now
    assert before == 0.0


def test_what_passivity_takes_away_goes_at_once_and_comes_back_by_the_slew_limit():
    left = [math.inf]
    safety = Safety(
        SafetyConfig(ramp_time=0.0), 1000.0, lambda force, falling: force if force[0] <= left[0] else (left[0], 0, 0)
    )
    safety.arm()
    sizes = []
    for n in range(8):
        left[0] = 0.1 if n == 4 else math.inf
        sizes.append(safety.step((3.0, 0.0, 0.0), elapsed=PERIOD, age=0.0, allowed=True)[0])
    assert sizes == pytest.approx([1.0, 2.0, 3.0, 3.0, 0.1, 1.1, 2.1, 3.0])
