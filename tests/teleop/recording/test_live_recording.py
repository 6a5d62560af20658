"""A whole session, recorded as `otwarp teleop --record` does it, and replayed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from otwarp import teleop as c
from otwarp.errors import InputError
from otwarp.haptics.recording import McapFile, unpack_text
from otwarp.teleop.recording.replay import replay_recording
from otwarp.teleop.session import Session, SessionOptions
from tests.teleop.scenes import three_beads

HANDS = {
    "left": "virtual:circle,radius=0.003,period=0.4,plane=yz",
    "right": "virtual:sine,amplitude=0.005,frequency=3,axis=x",
}


class Script:
    """An sink that asks for things in order, one a frame, and waits where a step is a function until it says so."""

    interval = 0.0

    def __init__(self, *steps):
        self.steps, self.live, self.complaints = list(steps), None, []
        self.end = time.monotonic() + 300.0  # kernels may have to be compiled first

    def publish(self, live):
        self.live = live

    def commands(self):
        assert time.monotonic() < self.end, "did not happen"
        if not self.steps:
            return [c.Stop()]
        step = self.steps[0]
        if not callable(step):
            return [self.steps.pop(0)]
        answer = step(self.live) if self.live is not None else False
        if answer is True:
            self.steps.pop(0)
        return [answer] if isinstance(answer, c.Arm) else []

    def complain(self, line):
        self.complaints.append(line)

    def close(self):
        pass


def armed(live):
    """Both hands; arms those again that the watchdog of a busy machine has disarmed."""
    states = [hand.now.state if hand.now else "" for hand in live.hands]
    if any(state in ("disarmed", "fault") for state in states) and all(
        hand.now and hand.now.traps for hand in live.hands
    ):
        return c.Arm()
    return states == ["armed", "armed"]


def after(frames):
    """Waits for that many frames."""
    left = [frames]

    def over(live):
        left[0] -= 1
        return left[0] < 0

    return over


def texts(path, topic):
    with McapFile(path) as file:
        return [json.loads(unpack_text(m.data)) for m in file.messages([topic])]


@pytest.mark.thorough
def test_a_session_with_pauses_resets_and_gains_is_recorded_twice_and_replays(tmp_path):
    first, second = tmp_path / "one.mcap", tmp_path / "two.mcap"
    script = Script(
        *(armed, after(20), c.SetGains("left", 150.0, 0.2), c.SetPower(15.0), after(20)),
        *(c.Pause(True), after(30), c.Pause(False), armed, after(10)),
        *(c.Reset(), after(20), armed, after(10)),
        *(
            c.Record(False),
            after(5),
            c.Record(True, str(second)),
            after(30),
            c.SetGains("right", None, 0.01),
            after(10),
        ),
    )
    options = SessionOptions(devices=HANDS, record=str(first), arm=True, device="cpu")
    report = Session(three_beads(), options, sinks=[script], say=lambda line: None).run()
    assert script.complaints == []
    assert report["recording"] == str(second)
    # what the servo ran compiled, replays compute in Python
    assert report["law"] == "compiled" and "force law compiled" in report["text"]
    for path in (first, second):
        found = replay_recording(path)
        assert found.complete and found.law == "compiled"
        assert [(hand.first, hand.gaps, hand.skipped) for hand in found.hands] == [("", 0, 0)] * 2
        assert found.equal
        assert min(hand.compared for hand in found.hands) > 100
    told = [command["command"] for command in texts(first, "/otwarp/commands")]
    assert [name for name in told if name != "Arm"] == ["Record", "SetGains", "SetPower", "Pause", "Pause", "Reset"]
    assert "Arm" in told
    (about,) = texts(second, "/otwarp/config")
    assert about["devices"] == HANDS
    assert about["settings"]["device"] == "cpu"
    assert [hand["name"] for hand in about["haptics"]["hands"]] == ["left", "right"]


@pytest.mark.thorough
def test_a_session_without_hands_is_recorded(tmp_path):
    path = tmp_path / "one.mcap"
    script = Script(after(5), c.MoveTraps({0: (-8.0, 0.5, 5.0)}), after(5))
    Session(three_beads(), SessionOptions(record=str(path), device="cpu"), sinks=[script], say=lambda line: None).run()
    report = replay_recording(path)
    assert (report.complete, report.hands, report.equal) == (True, (), False)
    with McapFile(path) as file:
        assert sum(m.topic == "/tf" for m in file.messages()) > 5


@pytest.mark.thorough
def test_a_recording_without_a_name_is_named_by_the_time(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    script = Script(after(2), c.Record(True), after(5))
    Session(three_beads(), SessionOptions(device="cpu"), sinks=[script], say=lambda line: None).run()
    (file,) = tmp_path.iterdir()
    assert file.name.startswith("recording-2") and file.suffix == ".mcap"
    assert replay_recording(file).complete


@pytest.mark.thorough
def test_a_recording_that_cannot_be_is_told_and_the_session_goes_on(tmp_path):
    script = Script(after(2), c.Record(True, str(tmp_path / "a.bag")), after(2))
    Session(three_beads(), SessionOptions(device="cpu"), sinks=[script], say=lambda line: None).run()
    assert len(script.complaints) == 1
    assert "ends in .mcap" in script.complaints[0]
    with pytest.raises(InputError, match=r"ends in \.mcap"):
        Session(three_beads(), SessionOptions(record="a.bag", device="cpu"), say=lambda line: None)


@pytest.mark.thorough
def test_a_session_that_never_began_leaves_nothing_and_may_be_tried_again(tmp_path):
    path = tmp_path / "take1.mcap"
    # a device that is gone again once the session starts: the first look at it was in time
    file = tmp_path / "hand.csv"
    for _ in range(2):
        file.write_text("time,x,y,z\n0,0,0,0\n")
        options = SessionOptions(devices={"left": f"replay:{file}"}, record=str(path), device="cpu")
        session = Session(three_beads(), options, say=lambda line: None)
        file.unlink()
        with pytest.raises(InputError, match=r"hand\.csv: cannot be read"):
            session.run()
        assert list(tmp_path.iterdir()) == []
    Session(three_beads(), SessionOptions(record=str(path), duration=0.1, device="cpu"), say=lambda line: None).run()
    assert replay_recording(path).complete


def test_a_session_that_is_stopped_before_its_first_frame_reports_no_recording(tmp_path, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("otwarp.teleop.session.live.LiveLoop.start", stopped)
    options = SessionOptions(record=str(tmp_path / "take1.mcap"), device="cpu")
    report = Session(three_beads(), options, say=lambda line: None).run()
    assert report["recording"] is None
    assert "recorded" not in report["text"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
def test_the_snippet_in_the_documentation_runs_as_it_stands(tmp_path):
    root = Path(__file__).parents[3]
    text = (root / "docs" / "recordings.md").read_text(encoding="utf-8")
    (snippet,) = [part.partition("```")[0] for part in text.split("```python\n")[1:]]
    (tmp_path / "session.py").write_text(snippet)
    (tmp_path / "scenes").symlink_to(root / "scenes")
    run = [sys.executable, "session.py"]
    done = subprocess.run(
        run, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True, timeout=300.0
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("equal: ")
    assert replay_recording(tmp_path / "take1.mcap").hands[0].compared > 0
