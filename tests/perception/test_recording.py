"""A closed loop that is recorded: its images give the same estimates and states again, bit for bit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.haptics.core import cycles_of
from otwarp.haptics.recording import (
    CAMERA,
    CONFIG,
    CYCLES,
    PERCEPTION,
    McapFile,
    pack_image,
    unpack_cycles,
    unpack_image,
    unpack_text,
)
from otwarp.perception.assemble import SeeingOptions
from otwarp.perception.recorded import look_from_dict, look_to_dict
from otwarp.perception.replay import replay_perception
from otwarp.scene import Scene, SceneBuilder
from otwarp.teleop import Record
from otwarp.teleop.recording.replay import replay_recording
from otwarp.teleop.session import open_recording
from tests.perception.scenes import PIECE, QUICKLY, TOP, Lab, seen_bead

SEEING = SeeingOptions(rendering=QUICKLY, piece=PIECE, device="cpu")


@pytest.fixture(scope="module")
def bead_file(tmp_path_factory) -> Path:
    """The scene of the bead on disk."""
    builder, scene = SceneBuilder(settings=seen_bead().settings), seen_bead()
    for part in (*scene.bodies, *scene.traps, TOP):
        builder.add(part)
    return builder.save(tmp_path_factory.mktemp("scene") / "bead.usda")


def recorded(file: Path, take: Path, *, late: int = 0, reset: bool = False) -> None:
    """A short session, recorded from its start or some turns later."""
    lab = Lab(scene=Scene.load(file), seeing=SEEING)
    lab.stage.loop._make_recording = lambda name, loop: open_recording(name, loop)
    lab.run(late)
    lab.stage.loop.do(Record(True, str(take)))
    lab.run(20)
    if reset:
        lab.stage.loop._reset()
        lab.run(12)
    lab.close()


@pytest.fixture(scope="module")
def take(bead_file, tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("take") / "take.mcap"
    recorded(bead_file, file, reset=True)
    return file


@pytest.mark.quick
def test_images_give_the_same_estimates_and_states(take):
    report = replay_perception(take)
    assert report is not None and report.equal, report
    assert (report.turns, report.states) == (32, 32) and report.estimates > 20
    assert report.verdict.startswith(f"images: {report.estimates} pieces looked at again, 0 estimates differ")


def test_looks_of_older_recordings_can_be_read(take):
    """They do not say whether an estimator failed."""
    with McapFile(take) as file:
        turns = [json.loads(unpack_text(m.data)) for m in file.messages((PERCEPTION,))]
    told = next(turn["looks"][0] for turn in turns if turn["looks"])
    images = [np.zeros((one["height"], one["width"]), dtype=np.uint8) for one in told["bodies"]]
    assert [one.pop("failed") for one in told["bodies"]] == [False]
    again = look_to_dict(look_from_dict(told, images))
    assert [one.pop("failed") for one in again["bodies"]] == [False] and again == told


@pytest.mark.parametrize("late", [0, 6])
def test_what_was_felt_of_the_images_is_felt_again(bead_file, tmp_path, late):
    """The chains of the hand, run on the recorded states: the same force every millisecond, to the last bit."""
    recorded(bead_file, tmp_path / "felt.mcap", late=late)
    report = replay_recording(tmp_path / "felt.mcap")
    (hand,) = report.hands
    assert report.complete and report.equal and hand.first == ""
    assert (hand.mismatches, hand.gaps, hand.missing, hand.skipped) == (0, 0, 0, 0) and hand.compared > 100
    with McapFile(tmp_path / "felt.mcap") as file:
        cycles = [c for m in file.messages((CYCLES + "right",)) for c in cycles_of(unpack_cycles(m.data)[2])]
    assert max(max(map(abs, cycle.force)) for cycle in cycles) > 1e-4


def test_a_recording_that_began_later_compares_estimates_alone(bead_file, tmp_path):
    recorded(bead_file, tmp_path / "late.mcap", late=6)
    report = replay_perception(tmp_path / "late.mcap")
    assert report is not None and report.equal and report.states == 0 and report.estimates > 10
    assert "trackers had begun before the recording did" in report.verdict


def test_another_image_gives_another_estimate(take, tmp_path):
    """A pixel of one image is changed in the file: its estimate differs, and so do the states that follow."""
    with McapFile(take) as file:
        images = [bytes(m.data) for m in file.messages() if m.topic.startswith(CAMERA)]
    data = take.read_bytes()
    at = data.find(images[8])
    assert at > 0
    changed = bytearray(data)
    rows, wide, high = unpack_image(images[8])
    middle = at + len(images[8]) - len(rows) + (high // 2) * wide + wide // 2
    changed[middle] ^= 0x40
    (tmp_path / "changed.mcap").write_bytes(without_checksums(bytes(changed)))
    report = replay_perception(tmp_path / "changed.mcap")
    assert report is not None and not report.equal
    assert report.different == 1 and report.astray > 0 and "the estimate" in report.first


def without_checksums(data: bytes) -> bytes:
    """An MCAP file whose chunks say that they have none: 8 bytes of magic, then records of operation and length."""
    out, at = bytearray(data), 8
    while at + 9 <= len(out) and out[at] != 2:
        size = int.from_bytes(out[at + 1 : at + 9], "little")
        if out[at] == 6:  # a chunk: two times and a size before the checksum
            out[at + 9 + 24 : at + 9 + 28] = bytes(4)
        at += 9 + size
    return bytes(out)


def test_images_are_those_of_ros(take):
    """Any reader of MCAP has them, the highest row first."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    with McapFile(take) as file:
        kinds = {m.topic: (m.kind, bytes(m.data)) for m in file.messages() if m.topic.startswith(CAMERA)}
    ((topic, (kind, data)),) = kinds.items()
    image = store.deserialize_cdr(data, kind)
    assert topic == "/camera/World/bead_right" and (image.width, image.height, image.encoding) == (
        PIECE,
        PIECE,
        "mono8",
    )
    rows, wide, high = unpack_image(data)
    assert (wide, high) == (PIECE, PIECE) and np.array_equal(image.data, np.frombuffer(rows, dtype=np.uint8))
    for size in ((3, 2), (0, 0), (5, 7)):
        packed = pack_image(bytes(range(size[0] * size[1])), *size, 7_000_000_009, "camera")
        assert unpack_image(packed) == (bytes(range(size[0] * size[1])), *size)
        again = store.deserialize_cdr(packed, kind)
        assert (again.header.stamp.sec, again.header.stamp.nanosec, again.width) == (7, 9, size[0])
    deep = np.array([[1, 2, 4095], [256, 5, 6]], dtype="<u2")
    packed = pack_image(deep.tobytes(), 3, 2, 7_000_000_009, "camera")
    again = store.deserialize_cdr(packed, kind)
    assert (again.encoding, again.step) == ("mono16", 6) and unpack_image(packed) == (deep.tobytes(), 3, 2)
    with pytest.raises(InputError, match="cannot be read"):
        unpack_image(data[:-5])


def test_turns_are_as_their_schema_says(take):
    schema = pytest.importorskip("jsonschema", reason="of the extra dev")
    with McapFile(take) as file:
        told = {m.topic: unpack_text(m.data) for m in file.messages((CONFIG, PERCEPTION, "/otwarp/schemas"))}
    rules = json.loads(told["/otwarp/schemas"])
    for topic in (CONFIG, PERCEPTION):
        schema.validate(json.loads(told[topic]), rules[topic], schema.Draft202012Validator)


def test_the_command_says_what_came_of_it(take, bead_file, capfd):
    assert main(["haptics", "replay", str(take)]) == 0
    out = capfd.readouterr().out
    assert "0 estimates differ; 32 states, 0 differ" in out and "equal: all forces of" in out
    moved = bead_file.read_text(encoding="utf-8")
    try:
        bead_file.write_text(moved.replace("0.00089", "0.00099"), encoding="utf-8")
        with pytest.raises(InputError, match="has changed since"):
            replay_perception(take)
    finally:
        bead_file.write_text(moved, encoding="utf-8")
