"""Configuration: its ranges, its way through JSON, filters that know their rate, and the presets."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.chain.motion import VectorFilter
from otwarp.haptics.core.config import (
    PAIRINGS,
    ChainConfig,
    CouplingConfig,
    HandConfig,
    HapticsConfig,
    LowPass,
    PassivityConfig,
    SafetyConfig,
    two_hands,
)
from otwarp.haptics.core.fields import from_dict, to_dict

EXACT = 1e-12
"""Relative error of a few float64 operations."""


def test_time_constants_of_the_paper():
    """α = 0.05 is 19.5 samples: 19.5 ms at 1 kHz, 162 ms at 120 Hz."""
    assert LowPass(alpha=0.05, rate=1000.0).time_constant == pytest.approx(0.0195, rel=1e-3)
    assert LowPass(alpha=0.05, rate=120.0).time_constant == pytest.approx(0.1625, rel=1e-3)


@settings(deadline=None, derandomize=True)
@given(st.floats(1e-4, 0.5), st.floats(100.0, 1000.0), st.floats(100.0, 1000.0))
def test_filter_keeps_its_time_constant_at_another_rate(alpha, rate, other):
    there = LowPass(alpha=alpha, rate=rate).at(other)
    assert there.time_constant == pytest.approx(LowPass(alpha=alpha, rate=rate).time_constant, rel=1e-9)
    assert there.at(rate).alpha == pytest.approx(alpha, rel=1e-9)


def test_filter_decays_by_e_in_its_time_constant():
    low_pass = LowPass.of_time_constant(0.05, 1000.0)
    follower = VectorFilter(low_pass.alpha)
    for _ in range(50):
        x, y, z = follower.step(1.0, -2.0, 0.0)
    assert (x, y, z) == pytest.approx((1.0 - math.exp(-1.0), -2.0 + 2.0 * math.exp(-1.0), 0.0), rel=EXACT)
    assert LowPass(alpha=1.0, rate=1000.0).at(50.0).alpha == 1.0


def full() -> HapticsConfig:
    chain = ChainConfig(
        rate=2000.0,
        motion_filter=LowPass(alpha=0.05, rate=1000.0),
        force_filter=LowPass(alpha=0.3, rate=500.0),
        coupling=CouplingConfig(),
        passivity=None,
        damping=0.5,
    )
    left = HandConfig(name="left", traps=(3, 1), chain=chain, safety=SafetyConfig(dead_man=True))
    return HapticsConfig(hands=(left, HandConfig(traps=(0,), absolute=True)))


@pytest.mark.parametrize("config", [full(), two_hands((0, 1), (2,)), two_hands((0,), (1,), mode="paper")])
def test_json_and_back(config):
    assert from_dict(HapticsConfig, json.loads(json.dumps(to_dict(config), allow_nan=False))) == config


def test_defaults_fill_what_is_absent():
    assert from_dict(HandConfig, {"traps": [2]}) == HandConfig(traps=(2,))


@pytest.mark.parametrize(
    ("kind", "data", "says"),
    [
        (ChainConfig, {"rate": 5}, ("rate", "5", "100 to 20000 Hz")),
        (ChainConfig, {"rate": True}, ("rate", "True")),
        (ChainConfig, {"rate": math.nan}, ("rate", "nan")),
        (ChainConfig, {"rat": 1000.0}, ("'rat'", "rate")),
        (ChainConfig, {"mode": "fast"}, ("mode", "fast", "stable, paper")),
        (ChainConfig, {"force_filter": {"alpha": 2.0, "rate": 100.0}}, ("force_filter.alpha", "2.0", "above 0 to 1")),
        (ChainConfig, {"force_filter": {"alpha": 0.1}}, ("force_filter", "rate")),
        (ChainConfig, {"coupling": 3}, ("coupling", "3", "none")),
        (ChainConfig, {"messages_per_state": 1.5}, ("messages_per_state", "1.5")),
        (PassivityConfig, {"share": 0.0}, ("share", "0.0", "above 0 to 1")),
        (SafetyConfig, {"slew": 10.0}, ("slew", "10.0", "82.5")),
        (SafetyConfig, {"disarm_after": 0.01}, ("disarm_after", "0.01", "0.02")),
        (SafetyConfig, {"dead_man": 1}, ("dead_man", "1", "true or false")),
        (HandConfig, {"axis_map": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}, ("axis_map", "rotation")),
        (HandConfig, {"axis_map": [[1, 0], [0, 1]]}, ("axis_map", "three rows")),
        (HandConfig, {"traps": [1, 1]}, ("traps", "once")),
        (HandConfig, {"traps": [-1]}, ("traps", "-1")),
        (HandConfig, {"motion_gain": 0.0}, ("motion_gain", "above 0")),
        (HapticsConfig, {"hands": [{"name": "middle"}]}, ("hands[0].name", "middle", "left, right")),
        (HapticsConfig, {"hands": [{"traps": [1]}, {"traps": [2]}]}, ("hands", "right, right")),
        (HapticsConfig, {"hands": [{"name": "left", "traps": [1]}, {"traps": [1]}]}, ("trap 1", "two hands")),
        (HapticsConfig, [], ("HapticsConfig", "[]")),
    ],
)
def test_refuses_in_one_line(kind, data, says):
    with pytest.raises(InputError) as error:
        from_dict(kind, data)
    message = str(error.value)
    assert "\n" not in message
    for part in says:
        assert part in message


def test_pairings_are_each_others_mirror():
    """The older release gives the first trap to the other hand."""
    release, older = two_hands((0,), (1,)), two_hands((0,), (1,), pairing="older")
    assert [(h.name, h.traps) for h in release.hands] == [("left", (0,)), ("right", (1,))]
    assert [(h.name, h.traps) for h in older.hands] == [("left", (1,)), ("right", (0,))]
    assert PAIRINGS["release"]["left"].namespace == "/GeomagicLeft"
    with pytest.raises(InputError, match="pairing is 'x'"):
        two_hands((0,), (1,), pairing="x")
    with pytest.raises(InputError, match="mode is 'x'"):
        two_hands((0,), (1,), mode="x")


def test_importing_is_light():
    """The servo process must start fast: no NumPy, no Warp, no USD."""
    import subprocess
    import sys

    ask = (
        "import sys, otwarp.haptics.chain.chain, otwarp.haptics.check.zwidth;"
        "import otwarp.haptics.force.compiled;"
        "print([m for m in ('numpy', 'warp', 'pxr', 'scipy') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True).stdout.strip() == "[]"
