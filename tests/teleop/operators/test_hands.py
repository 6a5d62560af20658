"""Which hand moves what."""

from __future__ import annotations

import dataclasses
import json

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.config import HandConfig, HapticsConfig, two_hands
from otwarp.haptics.core.fields import to_dict
from otwarp.teleop.operators import changed, load_config, plan_hands, slowed
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
    # per simulated second: in slow motion the hand's clock sees less of it, and never more
    assert [plan.config.chain.trap_speed for plan in slowed((left, right), 0.25)] == [1.75, float("inf")]
    assert slowed((left, right), 2.0) == (left, right)


def test_a_configuration_file_changes_the_presets(tmp_path):
    file = tmp_path / "hands.json"
    changes = {"hands": [{"name": "right", "traps": [2], "chain": {"damping": 0.5}, "safety": {"clamp": 1.0}}]}
    file.write_text(json.dumps(changes))
    left, right = plan_hands(three_beads(), {"left": "mouse", "right": "mouse"}, config=load_config(file))
    assert left.config.traps == (0,) and right.config.traps == (2,)
    assert right.config.chain.damping == 0.5 and right.config.safety.clamp == 1.0
    # all else is the preset's
    assert right.config.chain == dataclasses.replace(left.config.chain, damping=0.5)
    assert left.config.chain.pose_prediction and left.config.chain.quantum > 0.0
    # of the mode that is asked for, too
    (paper,) = plan_hands(three_beads(), {"right": "mouse"}, config=load_config(file), mode="paper")
    assert paper.config.chain.mode == "paper" and paper.config.chain.damping == 0.5


def test_a_configuration_in_python_replaces_them():
    config = HapticsConfig(hands=(HandConfig(name="right", traps=(2,), force_gain=0.01), HandConfig(name="left")))
    left, right = plan_hands(three_beads(), {"left": "mouse", "right": "mouse"}, config=config)
    assert left.config.traps == (0,) and right.config.traps == (2,) and right.config.force_gain == 0.01


def test_what_is_written_out_is_read_back(tmp_path):
    preset = two_hands((), (), mode="paper")
    file = tmp_path / "all.json"
    file.write_text(json.dumps(to_dict(preset)))
    assert changed(two_hands((), ()), load_config(file)) == preset


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
        ('{"hands": [{"force_gain": 1.0}]}', "hands has one of name None; allowed: left, right"),
        ('{"hands": 3}', "hands is 3; allowed: a list of hands"),
        ('{"hands": [{"name": "left", "volume": 11}]}', "has the key 'volume'"),
        ('{"hands": [{"name": "left", "force_gain": "loud"}]}', "force_gain is 'loud'"),
    ):
        file.write_text(text)
        with pytest.raises(InputError) as refused:
            load_config(file)
        assert line in str(refused.value) and "\n" not in str(refused.value)
        assert str(refused.value).startswith(f"--config {file}: ")
    with pytest.raises(InputError, match="cannot be read"):
        load_config(tmp_path / "absent.json")
