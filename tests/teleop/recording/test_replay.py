"""Recordings of a real servo in wall time, replayed: the same forces to the last bit."""

from __future__ import annotations

import dataclasses
import json
import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.haptics.core import ARMED, BACK, CYCLE, DISARMED, GAINS, LOST, MADE, STEPPED, actions_of, cycles_of
from otwarp.haptics.core.config import CouplingConfig, LowPass
from otwarp.haptics.devices import KINDS, Kind, create_device, parse_devices
from otwarp.haptics.devices.replay import ReplayDevice
from otwarp.haptics.recording import McapFile, pack_cycles, pack_scene, pack_text, unpack_cycles, unpack_scene
from otwarp.teleop.recording.replay import replay_recording
from tests.haptics.setups import hand_config
from tests.teleop.recording.recorded import LAWS, Session
from tests.teleop.scenes import three_beads, trap

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
    report = replay_recording(path)
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
        session.recording.close()
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
    monkeypatch.setitem(KINDS, "flaky", Kind("tests.teleop.recording.flaky:create", "required", "a file", True))
    from tests.teleop.recording import flaky

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


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """(file, its cycles) of a short session in which a force was felt, and its gains changed."""
    path = tmp_path_factory.mktemp("take") / "take1.mcap"
    session = one(**STABLE)
    session.record(path)
    with session:
        session.arm()
        session.servo.set_gains(0, 120.0, 0.09)
        session.run(0.15)
    assert replay_recording(path).equal
    return path, cycles_of(session.drained["right"])


def edited(path, where, edit):
    """A copy of a recording in which the messages of a topic are others of the same length."""
    data = bytearray(path.read_bytes())
    with McapFile(path) as file:
        for message in file.messages():
            if message.topic == where:
                old = bytes(message.data)
                new = edit(old)
                assert len(new) == len(old)
                at = data.index(old)
                data[at : at + len(old)] = new
    changed = path.with_name("edited.mcap")
    changed.write_bytes(data)
    return changed


def change_cycles(change):
    """Applies `change` to every cycle's list of fields."""

    def edit(message):
        hand, lost, records = unpack_cycles(message)
        out = []
        for values in CYCLE.iter_unpack(records):
            fields = list(values)
            change(fields)
            out.append(CYCLE.pack(*fields))
        return pack_cycles(hand, lost, b"".join(out))

    return edit


@pytest.mark.parametrize(("field", "name"), [(14, "force"), (17, "asked"), (20, "energy"), (22, "moved")])
def test_one_bit_of_one_cycle_is_seen(recorded, field, name):
    path, cycles = recorded
    tick = max(cycles, key=lambda cycle: abs(cycle.force[0])).tick

    def change(fields):
        if fields[0] == tick:
            fields[field] = math.nextafter(fields[field], math.inf)

    report = replay_recording(edited(path, "/otwarp/cycles/right", change_cycles(change)))
    (hand,) = report.hands
    assert hand.mismatches == 1
    assert not report.equal
    assert f"cycle {tick} at" in hand.first and f" s: {name};" in hand.first


def test_an_input_that_was_another_makes_other_forces(recorded):
    path, cycles = recorded
    tick = next(cycle.tick for cycle in cycles if abs(cycle.force[0]) > 1e-3)

    def change(fields):
        if fields[0] == tick:
            fields[3] += 1e-5

    (hand,) = replay_recording(edited(path, "/otwarp/cycles/right", change_cycles(change))).hands
    assert hand.mismatches > 1
    assert f"cycle {tick} at" in hand.first


def test_what_is_missing_is_skipped_and_said(recorded):
    path, cycles = recorded
    half = cycles[len(cycles) // 2]

    def later(fields):
        fields[0] += 5 * (fields[0] > half.tick)

    (hand,) = replay_recording(edited(path, "/otwarp/cycles/right", change_cycles(later))).hands
    assert (hand.gaps, hand.missing, hand.mismatches) == (1, 5, 0)
    assert hand.skipped == sum(cycle.tick > half.tick for cycle in cycles)
    assert hand.compared + hand.skipped == sum(cycle.flags & STEPPED > 0 for cycle in cycles)

    def another_beat(message):
        state = unpack_scene(message)
        return pack_scene(dataclasses.replace(state, beat=state.beat + 10**6 * (state.beat == half.beat)))

    (hand,) = replay_recording(edited(path, "/otwarp/scene", another_beat)).hands
    assert (hand.gaps, hand.mismatches) == (0, 0)
    assert hand.skipped == sum(cycle.beat >= half.beat for cycle in cycles)


def test_a_recording_cut_anywhere_is_replayed_up_to_there_or_refused(recorded):
    path, cycles = recorded
    data = path.read_bytes()
    cut = path.with_name("cut.mcap")
    counts = []
    for part in (0.0, 1e-5, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999):
        cut.write_bytes(data[: round(part * len(data))])
        try:
            report = replay_recording(cut)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert not report.complete
            assert report.hands[0].mismatches == 0
            counts.append(report.hands[0].cycles)
    assert counts == sorted(counts)
    assert counts[-1] == len(cycles)


@given(seed=st.integers(0, 2**32), flips=st.integers(1, 40), whole=st.booleans())
@settings(max_examples=60, deadline=None)
def test_no_bytes_do_more_than_raise_one_line(recorded, seed, flips, whole):
    path, _ = recorded
    rng, data = random.Random(seed), bytearray(path.read_bytes())
    span = len(data) if whole else 4000  # the head holds what the rest is read by
    for _ in range(flips):
        data[rng.randrange(span)] = rng.randrange(256)
    spoiled = path.with_name("spoiled.mcap")
    spoiled.write_bytes(data)
    try:
        replay_recording(spoiled)
    except InputError as error:
        assert "\n" not in str(error)
    device = ReplayDevice(spoiled)
    try:
        device.open()
    except InputError as error:
        assert "\n" not in str(error)


def foreign(path, topic="/chatter", kind="std_msgs/msg/String", data=None, compressed=False):
    """An MCAP file of another program."""
    folder = path.with_suffix("")
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(topic, kind, typestore=store)
        writer.write(connection, 1, data or pack_text("hello"))
    (folder / f"{folder.name}.mcap").rename(path)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda p: None, "cannot be read"),
        (lambda p: p.touch(), "cannot be read"),
        (lambda p: p.mkdir(), "cannot be read"),
        (lambda p: p.write_bytes(b"#ROSBAG V2.0\n"), "is no MCAP file"),
        (foreign, "is no recording of otwarp"),
        (lambda p: foreign(p, compressed=True), "is compressed .'zstd'."),
        (lambda p: foreign(p, "/otwarp/config"), "/otwarp/config is not JSON"),
        (lambda p: foreign(p, "/otwarp/config", data=pack_text("[" * 100_000)), "/otwarp/config is not JSON"),
        (lambda p: foreign(p, "/otwarp/config", data=pack_text("[1]")), "is no recording of otwarp"),
        (lambda p: foreign(p, "/otwarp/config", data=pack_text('{"format": 9}')), "format 9; allowed: 1"),
        (lambda p: foreign(p, "/otwarp/config", data=pack_text('{"format": 1}')), "haptics is None"),
    ],
)
def test_what_is_no_take_is_one_clear_line(tmp_path, capfd, make, says):
    path = tmp_path / "a.mcap"
    make(path)
    with pytest.raises(InputError, match=says) as error:
        replay_recording(path)
    assert "\n" not in str(error.value)
    assert main(["haptics", "replay", str(path)]) == 2
    assert capfd.readouterr().err.count("\n") == 1


def test_the_command_tells_and_exits_by_what_it_found(recorded, capfd):
    path, cycles = recorded
    assert main(["haptics", "replay", str(path)]) == 0
    out = capfd.readouterr().out
    assert f"right  {len(cycles)} cycles" in out and ", 0 differ" in out

    def change(fields):
        fields[14] += 1.0

    changed = edited(path, "/otwarp/cycles/right", change_cycles(change))
    assert main(["haptics", "replay", "--json", str(changed)]) == 1
    told = json.loads(capfd.readouterr().out)
    assert (told["equal"], told["complete"], told["hands"][0]["hand"]) == (False, True, "right")
    assert told["hands"][0]["mismatches"] > 50
    assert main(["haptics", "--help"]) == 0
    assert "replay" in capfd.readouterr().out


def test_a_recording_is_a_device(recorded):
    path, cycles = recorded
    (spec,) = parse_devices([f"replay:{path}"])
    device = create_device(spec)
    device.open()
    for cycle in cycles:
        sample = device.read(1e3 + (cycle.time - cycles[0].time))
        assert (sample.position, sample.buttons, sample.fresh) == (cycle.position, cycle.buttons, True)
    for text, name in ((f"replay:{path},hand=left", None), (f"replay:{path}", "left")):
        (spec,) = parse_devices([text], names=[name])
        with pytest.raises(InputError, match=r"holds no hand 'left'; allowed: hand=right"):
            create_device(spec).open()
    (spec,) = parse_devices([f"replay:{path},hand=right,loop=1"], names=["left"])
    looped = create_device(spec)
    looped.open()
    assert looped.read(0.0).position == looped.read(1e4).position == cycles[0].position
    for option in ("hand=third", "loop=2", "hand=left,hand=right"):
        (spec,) = parse_devices([f"replay:{path},{option}"])
        with pytest.raises(InputError, match=option.partition("=")[0]):
            create_device(spec)
