"""What a servo does not forget, and whom it does not believe."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.haptics.chain.rendering import Rendering
from otwarp.haptics.core import DeviceInfo, DeviceSample
from tests.haptics.servo.rig import Rig, Traced
from tests.haptics.setups import hand_config, make_chain, scene_at
from tests.haptics.spring import SpringChain

INFO = DeviceInfo(name="touch", kind="virtual", force=3.3, continuous_force=0.88)


class Saying(Traced):
    """A device whose buttons are no bits for a while."""

    nonsense: int | None = None

    def read(self, time):
        sample = super().read(time)
        return sample if self.nonsense is None else replace(sample, buttons=self.nonsense)


@pytest.mark.parametrize("nonsense", [-1, 2**63, 2**200])
def test_buttons_that_are_no_bits_lose_that_device_alone(nonsense):
    left, right = Saying(), Traced()
    rig = Rig([left, right])
    seen = {}

    def look() -> None:
        seen["status"] = [hand.status for hand in rig.hands]
        seen["last"] = left.written[-1][1], right.written[-1][1]

    def talk() -> None:
        left.nonsense = nonsense

    rig.run((0.05, rig.arm(0)), (0.06, rig.arm(1)), (0.3, talk), (0.35, look), (0.4, rig.stop))
    first, second = seen["status"]
    assert not first.present and "buttons are" in first.message and second.present
    assert seen["last"][0] == 0.0 and seen["last"][1] != 0.0


def test_a_new_chain_has_the_heat_of_the_motors_that_it_drives():
    rendering = Rendering(lambda info: make_chain(hand_config(ramp_time=0.0)))
    rendering.make(INFO)
    rendering.chain.heat = 0.5
    rendering.drop()
    rendering.make(INFO)
    assert rendering.chain.heat == 0.5
    # as in a fault, which armed hands leave with a chain of their own
    rendering.step(DeviceSample(0.0, (float("nan"), 0.0, 0.0)), scene_at(1, 0.0))
    rendering.arm()
    assert rendering.chain.heat == pytest.approx(0.5, rel=1e-3)
    again = Rendering(lambda info: make_chain(hand_config(ramp_time=0.0)))
    rendering.drop()
    again.restore(rendering.state(scene_at(1, 0.0)))
    assert again.chain is None and again.heat == rendering.heat


def test_a_new_chain_owes_what_the_last_one_owed():
    """Whoever disarms, faults or unplugs gets no new reserve."""
    rendering = Rendering(lambda info: make_chain(hand_config(ramp_time=0.0)))
    rendering.make(INFO)
    passivity = rendering.chain.passivity
    passivity.observe(0.0, 0.0, 0.0, 1e-3)
    passivity.send((1.0, 0.0, 0.0))
    passivity.observe(0.01, 0.0, 0.0, 0.05)
    rendering.disarm()
    rendering.arm()
    assert rendering.chain.account[0] == pytest.approx(-0.01, rel=1e-3)
    owed = rendering.chain.account
    for _ in range(3):
        rendering.make(INFO)
        assert rendering.chain.account == owed
    again = Rendering(lambda info: make_chain(hand_config(ramp_time=0.0)))
    rendering.drop()
    again.restore(json.loads(json.dumps(rendering.state(scene_at(1, 0.0)))))
    again.arm()
    assert again.chain.account == owed


class Asking(SpringChain):
    """A chain that asks for whatever it is told to."""

    asks = (0.0, 0.0, 0.0)

    def step(self, sample, scene):
        return replace(super().step(sample, scene), force=self.asks)


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.floats(1e-3, 100.0))
def test_no_force_leaves_above_the_limit_of_the_device_whatever_a_chain_asks(asks, limit):
    rendering = Rendering(Asking)
    rendering.make(replace(INFO, force=limit))
    rendering.chain.asks = asks
    state = rendering.step(DeviceSample(0.0, (0.0, 0.0, 0.0)), scene_at(1, 0.0))
    # None: the chain is dropped, and the device is told zero
    assert state is None or math.hypot(*state.force) <= limit * (1.0 + 1e-9)
    assert state is not None or rendering.chain is None
