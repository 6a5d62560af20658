"""Takes of a real servo in wall time, replayed: the same forces to the last bit."""

from __future__ import annotations

from dataclasses import replace

import pytest

from otwarp.haptics.config import CouplingConfig, LowPass
from otwarp.haptics.devices import KINDS, Kind
from otwarp.haptics.ring import ARMED, BACK, DISARMED, GAINS, LOST, MADE, STEPPED, actions_of, cycles_of
from otwarp.teleop.take_replay import replay_take
from tests.haptics.setups import hand_config
from tests.teleop.scenes import three_beads, trap
from tests.teleop.takes import LAWS, Session

SINE = "virtual:sine,amplitude=0.004,frequency=2,axis=x"
CIRCLE = "virtual:circle,radius=0.003,period=0.5"
PAPER = {"mode": "paper", "force_filter": LowPass(alpha=0.05, rate=120.0), "damping": 1.0, "passivity": None}
STABLE = {"quantum": 5.5e-5, "ramp_time": 0.05}
FULL = {
    **STABLE,
    "coupling": CouplingConfig(),
    "motion_filter": LowPass(alpha=0.1, rate=1000.0),
    "force_filter": LowPass(alpha=0.3, rate=1000.0),
    "pose_filter": LowPass(alpha=0.05, rate=1000.0),
    "pose_prediction": True,
    "damping": 0.5,
}


SCENE = replace(three_beads(), bodies=(), traps=(trap("left"), trap("right")))


def one(device=SINE, law="isotropic", **config):
    return Session(SCENE, {"right": (device, hand_config(**config))}, LAWS[law])


def seen(session, hand="right"):
    """All actions, flags and the largest force in what was drained."""
    cycles = cycles_of(session.drained[hand])
    actions = {action for cycle in cycles for action in actions_of(cycle.actions)}
    flags = 0
    for cycle in cycles:
        flags |= cycle.flags
    return actions, flags, max(max(map(abs, cycle.force)) for cycle in cycles)


def replayed(session, path, hand="right"):
    report = replay_take(path)
    assert report.complete
    (found,) = (h for h in report.hands if h.hand == hand)
    assert found.first == ""
    assert (found.mismatches, found.gaps, found.missing) == (0, 0, 0)
    assert found.cycles == len(cycles_of(session.drained[hand])) > 50
    assert report.equal
    return found


@pytest.mark.parametrize(
    ("law", "config"),
    [("isotropic", STABLE), ("split", FULL), ("table", STABLE), ("isotropic", PAPER)],
    ids=["stable", "full", "table", "paper"],
)
def test_a_session_replays_from_its_start(tmp_path, law, config):
    path = tmp_path / "take1.mcap"
    session = one(law=law, **config)
    session.record(path)
    with session:
        session.arm()
        session.run(0.1)
        session.servo.set_gains(0, 250.0, 0.2)
        session.run(0.1)
        session.servo.disarm()
        session.run(0.05)
    actions, _, force = seen(session)
    assert {ARMED, DISARMED, GAINS} <= actions
    assert force > 1e-3
    found = replayed(session, path)
    assert found.skipped == 0
    assert found.compared > 50


@pytest.mark.parametrize("config", [STABLE, FULL, PAPER], ids=["stable", "full", "paper"])
def test_a_recording_that_begins_in_mid_session_replays_from_there(tmp_path, config):
    path = tmp_path / "take1.mcap"
    with one(**config) as session:
        session.arm()
        session.servo.set_gains(0, 130.0, 0.11)
        session.run(0.15)
        session.record(path)
        session.run(0.15)
    actions, _, force = seen(session)
    assert MADE not in actions and GAINS not in actions
    assert force > 1e-3
    found = replayed(session, path)
    assert found.skipped == 0


def test_two_hands_a_stall_and_a_second_recording(tmp_path):
    paths = [tmp_path / "one.mcap", tmp_path / "two.mcap"]
    left = hand_config(name="left", **STABLE)
    right = hand_config(traps=(1,), name="right", absolute=True, **STABLE)
    session = Session(SCENE, {"left": (SINE, left), "right": (CIRCLE, right)}, LAWS["split"])
    with session:
        session.record(paths[0])
        session.arm(0)
        session.arm(1)
        session.publishing = False
        session.run(0.0, lambda: session.state(0) == session.state(1) == "disarmed")
        session.publishing = True
        session.servo.set_gains(1, motion_gain=300.0)
        session.arm(1)
        session.servo.record(False)
        session.fetch()
        session.take.close()
        first = dict(session.drained)
        session.drained = dict.fromkeys(first, b"")
        session.record(paths[1])
        session.run(0.1)
    for hand in ("left", "right"):
        assert replayed(session, paths[1], hand).skipped == 0
    session.drained = first
    for hand in ("left", "right"):
        assert replayed(session, paths[0], hand).skipped == 0


def test_a_device_that_is_lost_and_comes_back(tmp_path, monkeypatch):
    monkeypatch.setitem(KINDS, "flaky", Kind("tests.teleop.flaky:create", "required", "a file", True))
    from tests.teleop import flaky

    path, switch = tmp_path / "take1.mcap", tmp_path / "unplugged"
    hands = {"right": (f"{flaky.FLAKY}:{switch}", hand_config(**STABLE))}
    session = Session(SCENE, hands, LAWS["isotropic"], flaky.make)
    with session:
        session.record(path)
        session.arm()
        switch.touch()
        session.run(0.0, lambda: not session.servo.status().hands[0].present)
        session.servo.set_gains(0, force_gain=0.3)
        session.run(0.05)
        switch.unlink()
        session.run(0.0, lambda: session.servo.status().hands[0].present)
        session.arm()
        session.run(0.05)
    actions, flags, _ = seen(session)
    assert {ARMED, GAINS, MADE} <= actions
    assert flags & LOST and flags & BACK and flags & STEPPED
    found = replayed(session, path)
    assert found.compared < found.cycles
    assert found.skipped == 0
