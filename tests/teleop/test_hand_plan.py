"""Which hand moves what."""

from __future__ import annotations

import dataclasses
import json

import pytest

from otwarp.errors import InputError
from otwarp.haptics.config import HandConfig, HapticsConfig, to_dict
from otwarp.teleop.hand_plan import load_config, plan_hands
from tests.teleop.scenes import three_beads, trap


def test_traps_come_from_the_scene_and_gains_from_the_user():
    left, right = plan_hands(three_beads(), {"right": "mouse", "left": "spacemouse"}, motion_gain=50.0)
    assert (left.name, left.device, left.config.traps) == ("left", "spacemouse", (0,))
    assert (right.name, right.device, right.config.traps) == ("right", "mouse", (1,))
    assert left.config.motion_gain == right.config.motion_gain == 50.0


def test_the_older_pairing_swaps_the_hands_and_paper_mode_is_the_release():
    left, right = plan_hands(three_beads(), {"left": "mouse", "right": "mouse"}, pairing="older", mode="paper")
    assert (left.config.traps, right.config.traps) == ((1,), (0,))
    assert left.config.chain.mode == "paper" and left.config.chain.passivity is None


def test_a_hand_is_no_faster_than_its_traps():
    scene = dataclasses.replace(three_beads(), traps=(trap("left", speed_limit=7.0), trap("right"), trap("none")))
    left, right = plan_hands(scene, {"left": "mouse", "right": "mouse"}, rate=500.0)
    assert left.config.chain.trap_speed == 7.0 and right.config.chain.trap_speed == float("inf")
    assert left.config.chain.rate == 500.0


def test_a_configuration_file_goes_through(tmp_path):
    config = HapticsConfig(hands=(HandConfig(name="right", traps=(2,), force_gain=0.01), HandConfig(name="left")))
    file = tmp_path / "hands.json"
    file.write_text(json.dumps(to_dict(config)))
    left, right = plan_hands(three_beads(), {"left": "mouse", "right": "mouse"}, config=load_config(file))
    assert left.config.traps == (0,) and right.config.traps == (2,) and right.config.force_gain == 0.01


@pytest.mark.parametrize(
    ("devices", "changes", "line"),
    [
        ({"middle": "mouse"}, {}, "hand is 'middle'; allowed: left, right"),
        ({"left": "mouse"}, {"motion_gain": -1.0}, "hand.motion_gain is -1.0; allowed: above 0"),
        ({"left": "mouse"}, {"mode": "loud"}, "chain.mode is 'loud'; allowed: stable, paper"),
        ({"left": "mouse"}, {"pairing": "odd"}, "pairing is 'odd'; allowed: release, older"),
        ({"left": "mouse"}, {"config": HapticsConfig(hands=(HandConfig(name="right"),))}, "--left is 'mouse'; allowed"),
        (
            {"left": "mouse"},
            {"config": HapticsConfig(hands=(HandConfig(name="left", traps=(5,)),))},
            "hand.traps has 5; allowed: traps of /World, 0 to 2",
        ),
        (
            {"left": "mouse", "right": "mouse"},
            {"config": HapticsConfig(hands=(HandConfig(name="left", traps=(1,)), HandConfig(name="right")))},
            "haptics.hands has trap 1 in two hands",
        ),
    ],
)
def test_what_cannot_be_is_refused(devices, changes, line):
    with pytest.raises(InputError) as refused:
        plan_hands(three_beads(), devices, **changes)
    assert line in str(refused.value) and "\n" not in str(refused.value)


def test_a_hand_without_a_trap_is_refused():
    scene = dataclasses.replace(three_beads(), traps=(trap("right"),))
    with pytest.raises(InputError, match="no trap has ot:trap:hand = 'left'"):
        plan_hands(scene, {"left": "mouse"})


def test_a_bad_file_is_one_line(tmp_path):
    file = tmp_path / "hands.json"
    for text, line in (
        ("{", "is not JSON"),
        ("[]", "allowed: keys and values"),
        ('{"hands": [{"name": "left", "volume": 11}]}', "has the key 'volume'"),
        ('{"hands": [{"name": "left", "force_gain": "loud"}]}', "force_gain is 'loud'"),
    ):
        file.write_text(text)
        with pytest.raises(InputError) as refused:
            load_config(file)
        assert line in str(refused.value) and "\n" not in str(refused.value)
    with pytest.raises(InputError, match="cannot be read"):
        load_config(tmp_path / "absent.json")
