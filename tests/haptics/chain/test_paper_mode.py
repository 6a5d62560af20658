"""The release's chain: its law, its filters per message, its numbers."""

from __future__ import annotations

import math
from array import array
from dataclasses import replace

import pytest

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.chain.motion import Motion, VectorFilter
from otwarp.haptics.chain.paper_mode import RELEASE_LAW, PaperForce, curve_of
from otwarp.haptics.core import DeviceSample, SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import IDENTITY, PAPER_CHAIN, RELEASE_ALPHA, HandConfig, LowPass, SafetyConfig
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import ForceGrid, IsotropicLaw, SplitLaw, TableLaw

PRINTED = 5e-4
"""Half of the last digit of 1.312 N."""


@pytest.mark.parametrize(
    ("distance", "raw"), [(0.02, 240.0), (0.04, 480.0), (0.085, 671.4), (0.09, 429.5), (0.095, 224.8), (0.1, 0.0)]
)
def test_law_of_the_release(distance, raw):
    """Samples of paper.md; 0.05 for the last digit they are given to."""
    assert curve_of(RELEASE_LAW)(distance) == pytest.approx(raw, abs=0.06)


def test_ninety_nine_messages_at_a_twentieth():
    """12000·0.05·(1 − 0.95^99)·0.0022 = 1.312 N, drawn towards the robot: the gain is the release's 0.0022."""
    node = PaperForce()
    node.trap_message((0.0, 0.0, 0.0), 0.0)
    for n in range(99):
        force = node.robot_message((0.0, 0.05, 0.0), n / 60.0)
    assert force == pytest.approx((0.0, 1.312, 0.0), abs=PRINTED)
    # the paper's other gain gives another number
    other = PaperForce(gain=0.0030)
    other.trap_message((0.0, 0.0, 0.0), 0.0)
    for _ in range(99):
        force = other.robot_message((0.0, 0.05, 0.0), 0.0)
    assert force[1] == pytest.approx(1.789, abs=PRINTED)


def test_filter_runs_on_both_messages_and_not_before_both():
    node = PaperForce()
    for n in range(5):
        assert node.trap_message((0.0, 0.0, 0.0), n) == (0.0, 0.0, 0.0)
    first = node.robot_message((0.05, 0.0, 0.0), 5.0)[0]
    assert first == pytest.approx(0.05 * 600.0 * 0.0022)
    assert node.trap_message((0.0, 0.0, 0.0), 6.0)[0] == pytest.approx(first * (1.0 + 0.95))


def test_it_holds_its_force_at_zero_distance():
    node = PaperForce()
    node.trap_message((0.0, 0.0, 0.0), 0.0)
    held = node.robot_message((0.05, 0.0, 0.0), 0.0)
    assert node.robot_message((0.0, 0.0, 0.0), 1.0) == held


def test_distance_damping_pulls_less_when_the_distance_grows():
    """F = f(d) − D·Δd/Δt; as released it feeds motion away from the robot."""
    node = PaperForce(gain=1.0, alpha=1.0, distance_damping=100.0)
    node.trap_message((0.0, 0.0, 0.0), 0.0)
    node.robot_message((0.04, 0.0, 0.0), 0.0)
    assert node.robot_message((0.05, 0.0, 0.0), 0.01)[0] == pytest.approx(600.0 - 100.0)


def test_it_clamps_nothing():
    node = PaperForce(alpha=1.0, gain=0.0030)
    node.trap_message((0.0, 0.0, 0.0), 0.0)
    assert node.robot_message((0.07999, 0.0, 0.0), 0.0)[0] == pytest.approx(2.88, abs=1e-3)


def test_twist_is_smoothed_per_message():
    twist = VectorFilter(RELEASE_ALPHA)
    for _ in range(20):
        smoothed = twist.step(100.0, 0.0, -50.0)
    assert smoothed == pytest.approx((100.0 * (1.0 - 0.95**20), 0.0, -50.0 * (1.0 - 0.95**20)))


def test_motion_of_the_chain_is_the_integral_of_the_smoothed_twist():
    """The release smooths velocities and its simulator adds them up; we smooth the place: the same, from rest."""
    motion, twist, place, before = Motion(paper_chain().config), VectorFilter(RELEASE_ALPHA), 0.0, 0.0
    motion.step(0.0, 0.0, 0.0, True)
    for n in range(1, 400):
        x = 0.01 * math.sin(0.02 * n)
        place += twist.step((x - before) * 1000.0, 0.0, 0.0)[0] * 1e-3
        before = x
        motion.step(x, 0.0, 0.0, True)
        assert motion.commanded[0] == pytest.approx(place, abs=1e-15)


def paper_chain(**changes) -> Chain:
    config = HandConfig(
        traps=(4,),
        motion_gain=1.0,
        force_gain=0.0022,
        axis_map=IDENTITY,
        chain=PAPER_CHAIN,
        safety=SafetyConfig(ramp_time=0.0, **changes),
    )
    return Chain(config, local_model(config, {4: (IsotropicLaw(RELEASE_LAW),)}))


def state(beat: int, distance: float = 0.05) -> SceneFrame:
    """A robot at `distance`, another one farther away."""
    spheres = (SphereFrame((9.0, 0.0, 0.0), 1), SphereFrame((0.0, distance, 0.0), 0))
    return SceneFrame(beat, beat / 60.0, spheres, (TrapFrame(4, (0.0, 0.0, 0.0), 1.0),))


def test_chain_in_paper_mode_is_the_node():
    """Fed by 60 states a second it filters 120 times a second, and holds in between, bit for bit."""
    chain, node = paper_chain(), PaperForce()
    chain.arm()
    for n in range(1000):
        beat = n * 60 // 1000
        if beat != (n - 1) * 60 // 1000 or n == 0:
            node.trap_message((0.0, 0.0, 0.0), n * 1e-3)
            node.robot_message((0.0, 0.05, 0.0), n * 1e-3)
        now = chain.step(DeviceSample(n * 1e-3, (0.0, 0.0, 0.0)), state(beat))
        assert chain.asked == node.force
    # 60 states are 119 filtered messages: the very first finds no robot
    assert now.force[1] == pytest.approx(1.32 * (1.0 - 0.95**119), rel=1e-9)


def test_safety_ends_the_release_chain_too():
    chain = paper_chain(clamp=0.5, continuous_force=0.5)
    chain.arm()
    for n in range(1000):
        now = chain.step(DeviceSample(n * 1e-3, (0.0, 0.0, 0.0)), state(n * 60 // 1000))
    assert math.dist(now.force, (0.0, 0.0, 0.0)) == pytest.approx(0.5) and chain.asked[1] > 1.3
    for n in range(1000, 1110):
        now = chain.step(DeviceSample(n * 1e-3, (0.0, 0.0, 0.0)), state(59))
    assert now.force == (0.0, 0.0, 0.0) and now.state == "disarmed"


def test_device_node_damps_when_a_force_arrives():
    """1 N·s/m on the hand's velocity, sampled and held."""
    chain = paper_chain()
    chain.arm()
    for n in range(60):
        chain.step(DeviceSample(n * 1e-3, (0.1e-3 * n, 0.0, 0.0)), state(n // 17))
    assert chain.asked[0] == pytest.approx(-0.1)


def test_a_law_of_two_curves_and_kinds_is_the_radial_one_of_the_robots_kind():
    config = HandConfig(traps=(4,), force_gain=0.0022, axis_map=IDENTITY, chain=PAPER_CHAIN)
    half = replace(RELEASE_LAW, stiffness=0.5 * RELEASE_LAW.stiffness)
    laws = (SplitLaw(half, RELEASE_LAW), SplitLaw(RELEASE_LAW, half))
    # the robot is the nearest sphere, the second one; in `kinds` it is of the first kind
    chain = Chain(config, local_model(config, {4: laws}, (1, 0)))
    for n in range(1000):
        chain.step(DeviceSample(n * 1e-3, (0.0, 0.0, 0.0)), state(n * 60 // 1000))
    assert chain.asked[1] == pytest.approx(0.5 * 1.32 * (1.0 - 0.95**119), rel=1e-9)


def test_refuses_a_table():
    config = HandConfig(traps=(0,), chain=PAPER_CHAIN)
    grid = ForceGrid(1.0, 1.0, 1.0, 3, array("f", [0.0] * 27))
    with pytest.raises(InputError, match="allowed: a first trap with a force curve"):
        Chain(config, local_model(config, {0: (TableLaw((grid,), 1, False, 1.0),)}))
    assert PAPER_CHAIN.motion_filter == LowPass(alpha=0.05, rate=1000.0)
