"""Recordings of sessions that were killed, that were cut, or in which nothing happened: what is said of them."""

from __future__ import annotations

import json
import shutil

import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.haptics.core import cycles_of
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.recording import CYCLES_TYPE, MAGIC, McapFile, part_of
from otwarp.teleop.recording import file as take_file
from otwarp.teleop.recording.replay import HandReplay, ReplayReport, replay_recording
from tests.teleop.recording.test_replay import STABLE, one
from tests.teleop.recording.test_writer import begin, cycles, frame


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(file, its cycles) of a session in which every message is a chunk, so that it may be cut anywhere."""
    path = tmp_path_factory.mktemp("take") / "s3.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(take_file, "FLUSH_EVERY", -1.0)
        session = one(**STABLE)
        session.record(path)
        with session:
            session.arm()
            session.run(0.4)
    return path, cycles_of(session.drained["right"])


@pytest.fixture
def cut(whole, tmp_path):
    """The beginning of it, to within a message behind half of its cycles."""
    with McapFile(whole[0]) as file:
        batches = [bytes(message.data) for message in file.messages() if message.kind == CYCLES_TYPE]
    data = whole[0].read_bytes()
    path = tmp_path / "trunc.mcap"
    path.write_bytes(data[: data.index(batches[len(batches) // 2]) + 7])
    return path


@pytest.fixture
def killed(cut):
    """What a session that was killed leaves of s3.mcap, in a folder of its own."""
    part = part_of(cut.with_name("s3.mcap"))
    part.mkdir()
    shutil.copy(cut, part / f"{part.name}.mcap")
    return part


def opened(text):
    (spec,) = parse_devices([text])
    device = create_device(spec)
    device.open()
    return device


def test_a_cut_take_says_prominently_how_much_of_it_there_is(whole, cut, capfd):
    report = replay_recording(cut)
    assert not report.complete
    assert report.equal
    with McapFile(cut) as file:
        times = [message.time for message in file.messages()]
    assert report.seconds == pytest.approx(1e-9 * (max(times) - min(times)))
    assert 0.0 < report.seconds < replay_recording(whole[0]).seconds
    assert main(["haptics", "replay", str(cut)]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert lines[1] == f"cut short: {report.seconds:.1f} s of it could be read"
    assert lines[-1] == f"equal: all forces of {report.hands[0].compared} cycles, bit for bit"
    assert main(["haptics", "replay", "--json", str(cut)]) == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["complete"], told["equal"], told["seconds"]) == (False, True, report.seconds)
    assert main(["haptics", "replay", str(whole[0])]) == 0
    assert "cut short" not in capfd.readouterr().out


def test_a_cut_take_and_a_killed_sessions_folder_are_devices(whole, cut, killed):
    recorded = whole[1]
    for file in (cut, killed, killed / f"{killed.name}.mcap"):
        device = opened(f"replay:{file}")
        assert device.read(0.0).position == recorded[0].position
        late = device.read(recorded[-1].time - recorded[0].time)
        assert not late.fresh  # it ended long before
        assert late.position in [cycle.position for cycle in recorded]


def test_the_folder_of_a_killed_session_is_replayed_by_its_name(cut, killed, capfd):
    assert main(["haptics", "replay", f"{killed}/"]) == 0
    out = capfd.readouterr().out
    assert out.startswith(f"{killed}: ")
    assert "cut short: " in out
    assert replay_recording(killed).hands == replay_recording(cut).hands


def test_a_take_that_is_not_there_names_what_its_killed_session_left(killed, capfd):
    absent = killed.with_name("s3.mcap")
    assert main(["haptics", "replay", str(absent)]) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert f"{killed} exists" in err
    with pytest.raises(InputError, match=r"s3\.mcap: cannot be read .*s3\.mcap\.part exists"):
        opened(f"replay:{absent}")
    with pytest.raises(InputError, match=r"other\.mcap: cannot be read \(No such file or directory\)$"):
        replay_recording(killed.with_name("other.mcap"))


def test_a_folder_without_a_take_is_one_clear_line(tmp_path):
    part = tmp_path / "s3.mcap.part"
    part.mkdir()
    for read in (replay_recording, lambda path: opened(f"replay:{path}")):
        with pytest.raises(InputError, match=r"s3\.mcap\.part: cannot be read \(No such file or directory\)$"):
            read(part)
    (part / "s3.mcap.part.mcap").touch()
    with pytest.raises(InputError, match=r"s3\.mcap\.part: cannot be read \(it is empty\)$"):
        replay_recording(part)


def test_a_file_with_only_the_magic_is_no_recording(tmp_path, capfd):
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + b"\x01\x02")
    with pytest.raises(InputError, match=r"a\.mcap: is no \w+ of otwarp") as error:
        opened(f"replay:{path}")
    assert "\n" not in str(error.value)
    assert main(["haptics", "replay", str(path)]) == 2
    assert "of otwarp, or too little of one" in capfd.readouterr().err


def test_a_take_without_cycles_says_why_it_is_not_equal(tmp_path, capfd):
    path = tmp_path / "a.mcap"
    with begin(path) as recording:
        recording.frame(frame(1))
    assert main(["haptics", "replay", str(path)]) == 1
    assert capfd.readouterr().out.endswith("\nnothing to compare: it has no cycles of any hand\n")
    assert main(["haptics", "replay", "--json", str(path)]) == 1
    told = json.loads(capfd.readouterr().out)
    assert told["verdict"] == "nothing to compare: it has no cycles of any hand"
    assert (told["equal"], told["complete"]) == (False, True)
    away = tmp_path / "away.mcap"
    with begin(away) as recording:
        recording.cycles("left", cycles(1, 3))
    found = replay_recording(away)
    assert found.hands[0].cycles == 3 and found.hands[0].compared == 0


def test_every_verdict_has_its_reason():
    def verdict(*counts):
        hands = tuple(HandReplay("left", *three, "", 0, 0, 0) for three in counts)
        return ReplayReport("a.mcap", True, 1.0, "0", 1, hands).verdict

    assert verdict() == "nothing to compare: no hand had a device"
    assert verdict((9, 0, 0)) == "nothing to compare: no cycle could be run again"
    assert verdict((9, 8, 0), (9, 0, 0)) == "equal: all forces of 8 cycles, bit for bit"
    assert verdict((9, 8, 1), (9, 9, 2)) == "not equal: 3 cycles differ"
