"""The file of a recording: what is in it, as others read it, and what happens when it cannot be written."""

from __future__ import annotations

import importlib.util
import json
import math
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from otwarp import teleop as c
from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE, ServoFrame
from otwarp.haptics.core.config import HapticsConfig, LowPass
from otwarp.haptics.core.fields import from_dict
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw
from otwarp.haptics.recording import McapFile, part_of
from otwarp.haptics.servo.link import Cycles, Start
from otwarp.simulation.frame import SHAPES
from otwarp.teleop import HandFrame
from otwarp.teleop import recording as writer_module
from otwarp.teleop.recording import FRAMES, RecordingWriter
from otwarp.teleop.recording.file import laws_from_dict, laws_to_dict
from otwarp.teleop.recording.replay import replay_recording
from tests.haptics.core.test_ring import record
from tests.haptics.setups import RADIAL, hand_config
from tests.teleop.recording.recorded import LAWS, live_frame, scene_now
from tests.teleop.scenes import three_beads

CONFIG = HapticsConfig(hands=(hand_config(name="left", force_filter=LowPass(alpha=0.05, rate=120.0)),))
SCENE = three_beads()
START = Start(1, 1, json.dumps({"gains": [None, None], "device": None, "chain": None}))
EVENTUALLY = 60.0


def begin(path, laws=None, **changes) -> RecordingWriter:
    about = {"config": CONFIG, "devices": {"left": "virtual:hold"}, "kinds": (), "scene": SCENE, "clock": lambda: 5.0}
    return RecordingWriter(path, laws=laws or {0: (LAWS["table"],)}, **about | changes)


def frame(beat: int, **changes):
    """A frame of the scene."""
    live = live_frame(beat, 5.0 + 0.01 * beat)
    count = {"body": 3, "trap": 3}
    arrays = {
        name: np.random.default_rng(beat).normal(size=(1, count[axis], *((width,) if width else ())))
        for name, (axis, width) in SHAPES.items()
    }
    hand = ServoFrame(beat, 5.0, (0.01, 0.02, 0.03), (0.5, -0.25, 0.125), (), "armed", 0.1)
    about = {"name": "left", "device": "virtual:hold", "traps": (0,), "motion_gain": 1.0, "force_gain": 1.0}
    hands = (HandFrame(**about, clamp=3.3, now=hand), HandFrame(**about | {"name": "right"}, clamp=3.3))
    return replace(live, frame=replace(live.frame, **arrays), hands=hands, **changes)


def cycles(first: int, count: int) -> Cycles:
    """Of a device that is away; every other field says where it is."""
    records = [list(record(n)) for n in range(first, first + count)]
    for values in records:
        values[7] = values[9] = 0
    return Cycles(b"".join(CYCLE.pack(*values) for values in records), 0, START)


def messages(path):
    """(topic → list of (time, message)) as rosbags reads the file with the definitions that are in it."""
    found: dict[str, list] = {}
    with Reader(path) as reader:
        store = get_typestore(Stores.EMPTY)
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        for connection, at, data in reader.messages():
            found.setdefault(connection.topic, []).append((at, store.deserialize_cdr(data, connection.msgtype)))
    return found


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Frames of a short session, and what a reader finds of it: topic → (time, message) in order."""
    path = tmp_path_factory.mktemp("recorded") / "take1.mcap"
    frames = [frame(n, warnings=("trap 1: lost",) if n in (2, 3) else ()) for n in range(1, 5)]
    with begin(path, settings={"seed": 4}) as recording:
        for live in frames:
            recording.frame(live, scene_now(live.beat))
            recording.frame(live, scene_now(live.beat))  # a state is written once
        recording.cycles("left", cycles(1, 3))
        recording.cycles("left", replace(cycles(4, 2), scenes=(scene_now(4), scene_now(9))))
        recording.command(c.MoveTraps({1: (1.0, 2.0, 3.0)}), 5.5)
        recording.command(c.SetGains("left", None, 0.3), 5.6)
        assert recording.file == path and not path.exists()
        while not part_of(path).is_dir():
            time.sleep(0.005)
    assert not part_of(path).exists()
    assert (recording.complaint, recording.dropped) == ("", 0)
    return frames, messages(path)


def test_the_configuration_is_in_the_file_for_anybody_with_a_reader(recorded):
    _, told = recorded
    (_, text), *_ = told["/otwarp/config"]
    about = json.loads(text.data)
    assert from_dict(HapticsConfig, about["haptics"]) == CONFIG
    assert about["haptics"]["hands"][0]["chain"]["force_filter"] == {"alpha": 0.05, "rate": 120.0}
    assert (about["devices"], about["settings"], about["kinds"]) == ({"left": "virtual:hold"}, {"seed": 4}, [])
    assert about["scene"]["bodies"] == [body.name for body in SCENE.bodies]
    assert len(about["scene"]["digest"]) == 64
    assert laws_from_dict(about) == {0: (LAWS["table"],)}


def test_poses_and_forces_are_in_the_file_with_their_frames(recorded):
    frames, told = recorded
    about = json.loads(told["/otwarp/config"][0][1].data)
    at, tf = told["/tf"][2]
    assert at == about["clock"]["epoch"] + round((frames[1].wall - 5.0) * 1e9)
    assert [t.child_frame_id for t in tf.transforms][:2] == ["World/bead_left", "World/bead_right"]
    head, place = tf.transforms[1].header, tf.transforms[1].transform.translation
    assert (head.frame_id, head.stamp.sec * 10**9 + head.stamp.nanosec) == ("world", at)
    assert [place.x, place.y, place.z] == (1e-6 * frames[1].frame.position[0, 1]).tolist()
    place = tf.transforms[3].transform.translation
    assert [place.x, place.y, place.z] == (1e-6 * frames[1].frame.trap_position[0, 0]).tolist()
    turn = tf.transforms[1].transform.rotation
    assert [turn.x, turn.y, turn.z, turn.w] == frames[1].frame.orientation[0, 1].tolist()

    pose, force = told["/hand/left/pose"][0][1], told["/hand/left/force"][0][1]
    assert (pose.pose.position.x, pose.header.frame_id) == (0.01, "left_device")
    assert (force.wrench.force.x, force.wrench.force.y, force.wrench.torque.z) == (0.5, -0.25, 0.0)
    assert "/hand/right/pose" not in told  # nothing was heard of it


def test_arrays_and_texts_are_in_the_file(recorded):
    frames, told = recorded
    array = told["/trap/force"][4][1]
    assert [(d.label, d.size, d.stride) for d in array.layout.dim] == [("trap", 3, 9), ("axis", 3, 3)]
    assert array.data.tolist() == frames[2].frame.trap_force[0].ravel().tolist()
    for topic, name in (("/trap/distance", "trap_distance"), ("/body/contact_load", "contact_load")):
        assert told[topic][6][1].data.tolist() == getattr(frames[3].frame, name)[0].tolist()
    assert [text.data for _, text in told["/warnings"]] == ["trap 1: lost"]
    assert [json.loads(text.data)["command"] for _, text in told["/otwarp/commands"]] == ["MoveTraps", "SetGains"]
    assert json.loads(told["/otwarp/commands"][0][1].data)["positions"] == {"1": [1.0, 2.0, 3.0]}
    assert json.loads(told["/otwarp/pace"][0][1].data)["simulated"] == frames[0].frame.time
    assert json.loads(told["/otwarp/end"][0][1].data) == {"dropped": 0, "lost": {"left": 0}}


def test_states_and_cycles_are_in_the_file_bit_for_bit(recorded):
    _, told = recorded
    states = [state for _, state in told["/otwarp/scene"]]
    assert [state.beat for state in states] == [1, 2, 3, 4, 9]
    now = scene_now(9)
    assert states[-1].sphere_position.tolist() == [x for sphere in now.spheres for x in sphere.position]
    assert (states[-1].time, states[-1].trap_power.tolist()) == (now.time, [20.0, 20.0])
    batches = [batch for _, batch in told["/otwarp/cycles/left"]]
    assert [[cycle.tick for cycle in batch.cycles] for batch in batches] == [[1, 2, 3], [4, 5]]
    one = batches[1].cycles[1]
    place, moved = one.position, one.moved
    head = one.tick, one.time, one.sample_time, place.x, place.y, place.z, one.buttons, one.flags, one.beat
    assert (*head, one.actions) == (*record(5)[:7], 0, 8, 0)
    assert (one.energy, one.state, moved.x, moved.y, moved.z) == record(5)[20:]


def test_the_scanner_sees_what_the_index_says(tmp_path):
    path = tmp_path / "take1.mcap"
    with begin(path) as recording:
        for n in range(1, 600):
            recording.frame(frame(n), scene_now(n))
            while recording._waiting.qsize() > FRAMES // 2:  # a busy machine would drop frames
                time.sleep(0.001)
    told = messages(path)
    with McapFile(path) as file:
        found = [(m.topic, m.time) for m in file.messages()]
        assert file.complete
    assert path.stat().st_size > 2**20  # more than one chunk
    assert len(told["/tf"]) == 599
    assert sorted(found) == sorted((topic, at) for topic, rows in told.items() for at, _ in rows)


@pytest.mark.parametrize("law", LAWS)
def test_laws_come_back_as_they_were_and_each_once(law):
    laws = {0: (LAWS[law], LAWS["isotropic"]), 3: (LAWS[law],)}
    told = json.loads(json.dumps(laws_to_dict(laws)))
    assert laws_from_dict(told) == laws
    assert len(told["laws"]) == len({LAWS[law], LAWS["isotropic"]} if law != "table" else "12")
    back = laws_from_dict(told)
    assert back[0][0] is back[3][0]
    spheres = [(0.3, 0.1, -0.2)]
    assert back[3][0].pull(0.1, 0.0, 0.0, spheres) == LAWS[law].pull(0.1, 0.0, 0.0, spheres)


@pytest.mark.parametrize(
    "bad",
    [None, {}, {"laws": [{}], "traps": {}}, {"laws": [], "traps": {"0": [0]}}, {"laws": [{"kind": "x"}], "traps": {}}],
)
def test_laws_that_are_none_are_refused(bad):
    with pytest.raises(InputError, match="force laws: cannot be read"):
        laws_from_dict(bad)
    with pytest.raises(InputError, match="force law is Odd"):
        laws_to_dict({0: (type("Odd", (), {})(),)})


def test_a_place_where_no_take_can_be_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    (tmp_path / "there.mcap").touch()
    (tmp_path / "killed.mcap.part").mkdir()
    bad = ["there.mcap", "killed.mcap", "take.bag", "nowhere/take.mcap"]
    says = [
        "there.mcap exists",
        "killed.mcap.part exists",
        "ends in .mcap",
        "nowhere/take.mcap, which cannot be written",
    ]
    bad += ["x" * 300 + ".mcap", "/proc/x.mcap"]  # /proc says that it may be written
    says += ["File name too long", "/proc/x.mcap, which cannot be written"]
    for name, line in zip(bad, says, strict=True):
        with pytest.raises(InputError, match=line) as error:
            begin(tmp_path / name)
        assert "\n" not in str(error.value)
    with begin(tmp_path / "a.mcap") as recording, pytest.raises(InputError, match="hand is 'right'; allowed: left"):
        recording.cycles("right", cycles(1, 1))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"install otwarp\[teleop\]"):
        begin(tmp_path / "b.mcap")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mcap", "killed.mcap.part", "there.mcap"]


def test_a_disk_that_stops_ends_the_recording_and_not_the_session(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    recording = begin(tmp_path / "a.mcap")
    recording.frame(frame(1))
    monkeypatch.setattr(writer_module.RecordingFile, "scene", full)
    monkeypatch.setattr(writer_module, "_frame", full)
    end = time.monotonic() + EVENTUALLY
    n = 1
    while not recording.complaint:
        n += 1
        recording.frame(frame(n), scene_now(n))
        time.sleep(0.002)
        assert time.monotonic() < end
    for n in range(5000):
        recording.command(c.Stop(), 5.0 + n)  # still blocks nobody
    with pytest.raises(OSError, match="No space left"):
        recording.close()
    recording.close()
    assert not recording.file.exists()
    assert part_of(recording.file).is_dir()


def test_a_take_that_nobody_wants_is_not_left_even_if_the_disk_stops(tmp_path, monkeypatch):
    with begin(tmp_path / "a.mcap") as recording:
        recording.frame(frame(1))
        recording.discard()
    assert list(tmp_path.iterdir()) == []

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer_module.RecordingFile, "text", full)
    with begin(tmp_path / "b.mcap") as recording:
        recording.discard()
    assert "No space left" in recording.complaint
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_slow_loses_frames_first_and_says_so(tmp_path, monkeypatch):
    go = []

    def slow(*_):
        while not go:
            time.sleep(0.002)

    monkeypatch.setattr(writer_module, "_frame", slow)
    recording = begin(tmp_path / "a.mcap")
    for _ in range(1, FRAMES + 500):
        recording.frame(frame(1))
    recording.cycles("left", cycles(1, 3))
    assert 400 <= recording.dropped <= 500
    assert f"{recording.dropped} messages dropped" in recording.complaint
    go.append(1)
    recording.close()
    told = messages(tmp_path / "a.mcap")
    assert [cycle.tick for cycle in told["/otwarp/cycles/left"][0][1].cycles] == [1, 2, 3]
    assert json.loads(told["/otwarp/end"][0][1].data)["dropped"] == recording.dropped


def test_lost_cycles_are_told(tmp_path):
    with begin(tmp_path / "a.mcap") as recording:
        recording.cycles("left", replace(cycles(1, 1), lost=17))
        assert "17 cycles of hand left were lost" in recording.complaint
    assert json.loads(messages(tmp_path / "a.mcap")["/otwarp/end"][0][1].data)["lost"] == {"left": 17}


KILLED = """
import os, sys, time
from tests.teleop.recording.test_writer import begin, cycles, frame, scene_now
recording = begin(sys.argv[1])
for n in range(1, 700):
    recording.frame(frame(n), scene_now(n))
    recording.cycles("left", cycles(n, 1))
    time.sleep(0.001)
while not recording._waiting.empty():
    time.sleep(0.01)
os._exit(9)
"""


def test_a_killed_session_leaves_what_it_had_written_readable(tmp_path):
    path, root = tmp_path / "a.mcap", Path(__file__).parents[3]
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=root, timeout=300.0)
    assert done.returncode == 9
    assert not path.exists()
    left = part_of(path) / f"{part_of(path).name}.mcap"
    with McapFile(left) as file:
        found = [m.topic for m in file.messages()]
        assert not file.complete
    # whole chunks of a second, or of 1 MiB
    assert found.count("/tf") > 100
    assert "/otwarp/end" not in found
    shutil.copy(left, tmp_path / "b.mcap")
    report = replay_recording(tmp_path / "b.mcap")
    assert not report.complete
    assert report.hands[0].cycles == found.count("/otwarp/cycles/left")


def test_an_isotropic_law_is_not_taken_for_another():
    laws = {0: (IsotropicLaw(RADIAL), SplitLaw(RADIAL, RADIAL), IsotropicLaw(replace(RADIAL, cutoff=math.inf)))}
    assert laws_from_dict(json.loads(json.dumps(laws_to_dict(laws)))) == laws


@pytest.mark.parametrize("bodies", [0, 1, 3])
def test_frames_of_any_size_are_what_rosbags_writes(tmp_path, bodies):
    scene = replace(SCENE, bodies=SCENE.bodies[:bodies])
    live = frame(1)
    cut = {n: getattr(live.frame, n)[:, :bodies] for n, (axis, _) in SHAPES.items() if axis == "body"}
    with begin(tmp_path / "a.mcap", scene=scene) as recording:
        recording.frame(replace(live, frame=replace(live.frame, **cut)))
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(tmp_path / "a.mcap") as reader:
        for connection, _, data in reader.messages():
            if not connection.topic.startswith("/otwarp"):
                message = store.deserialize_cdr(data, connection.msgtype)
                assert bytes(store.serialize_cdr(message, connection.msgtype)) == data, connection.topic
    told = messages(tmp_path / "a.mcap")
    assert len(told["/tf"][0][1].transforms) == bodies + 3
    assert len(told["/body/contact_load"][0][1].data) == bodies
