"""The command line without arguments, and when it is told to stop."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.cli.progress import said_if_long
from otwarp.record.recorder import Recorder

BEAD = str(Path(__file__).parents[2] / "scenes" / "single_bead.usda")


def test_without_arguments_it_prints_its_help(capfd: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    out, error = capfd.readouterr()
    assert error == ""
    assert out.startswith("Usage: otwarp ") and out.count("\n") > 10 and "validate" in out


def test_haptics_without_a_command_prints_its_help(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["haptics"]) == 0
    out, error = capfd.readouterr()
    assert error == ""
    assert out.startswith("Usage: otwarp haptics [OPTIONS] [COMMAND]") and "\n  check " in out and "\n  replay " in out
    assert main(["haptics", "chekc"]) == 2
    assert capfd.readouterr() == ("", "otwarp: No such command 'chekc'; did you mean check?\n")


@pytest.mark.parametrize(
    ("number", "word", "code"), [(signal.SIGINT, "interrupted", 130), (signal.SIGTERM, "terminated", 143)]
)
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_signal_finishes_the_files_and_is_one_line(
    number: signal.Signals,
    word: str,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    write, frames = Recorder.write, []

    def write_and_signal(self: Recorder, frame: object) -> None:
        write(self, frame)  # type: ignore[arg-type]
        frames.append(frame)
        if len(frames) == 3:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(Recorder, "write", write_and_signal)
    before = signal.getsignal(signal.SIGTERM)
    # a shell starts what runs in the background with interrupts ignored
    interrupts = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert main(["run", BEAD, "--out", str(tmp_path / "out"), "--device", "cpu"]) == code
    finally:
        signal.signal(signal.SIGINT, interrupts)
    assert signal.getsignal(signal.SIGTERM) == before
    told = [line for line in capfd.readouterr().err.splitlines() if "compil" not in line]
    kept = f"otwarp: {tmp_path / 'out'}: the run ended early, after 0.03279 of 1 s ({word}); its files are whole"
    assert told == [kept, f"otwarp: {word}"]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["status"], summary["frames"]) == (f"stopped: {word}", 3)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "figure.png",
        "run.nc",
        "run.usda",
        "summary.json",
        "trajectory.usdc",
    ]


def test_the_speed_of_a_resumed_run_leaves_out_what_came_before(monkeypatch: pytest.MonkeyPatch) -> None:
    from rich.progress import Progress

    from otwarp.cli.run import _progress_bar

    shown: list[str] = []
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(Progress, "update", lambda *_, **fields: shown.append(fields["speed"]))
    with _progress_bar(110.0) as progress:
        assert progress is not None
        progress(100.0, 0.0)
        progress(101.0, 2.0)
    assert shown == ["0.5× real time"]


def test_what_takes_long_is_said_on_stderr(capfd: pytest.CaptureFixture[str]) -> None:
    with said_if_long("tables are made", after=30.0):
        pass
    assert capfd.readouterr() == ("", "")
    said = ""
    with said_if_long("tables are made", after=0.0):
        while not said.endswith("\n"):
            time.sleep(0.01)
            said += capfd.readouterr().err
    assert said == "otwarp: tables are made\n" and capfd.readouterr() == ("", "")


STARTED = """
import signal, sys

def heard(*what, set=signal.signal):
    before = set(*what)
    print(flush=True)
    return before

signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal = heard
from otwarp.cli.start import start
sys.exit(start())
"""
"""The command as it begins, which says when it can hear."""

MOMENTS = [*(pytest.param(t, marks=pytest.mark.validate) for t in (0.0, 0.05, 0.2, 0.8, 3.0)), 0.1, 0.4, 1.6]
"""When the interrupt comes [s]."""


def interrupted(words: list[str], after: float, folder: Path) -> tuple[int, str]:
    """Exit code and errors of a command that is interrupted some seconds after it began."""
    command = [sys.executable, "-c", STARTED, *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": folder}
    with subprocess.Popen(command, **pipes) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(after)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate()
    return process.returncode, error


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("after", MOMENTS)
@pytest.mark.parametrize(
    "words",
    [
        ["run", BEAD, "--duration", "1000", "--out", "out"],
        pytest.param(["info", BEAD], marks=pytest.mark.validate),
        pytest.param(["validate", BEAD], marks=pytest.mark.validate),
        pytest.param(["teleop", BEAD, "--no-open", "--port", "8431"], marks=pytest.mark.validate),
        pytest.param(["preview", BEAD, "-o", "bead.png"], marks=pytest.mark.validate),
        pytest.param(["forces", "--radius", "1", "--curves"], marks=pytest.mark.validate),
        pytest.param(["bench", "speed", "--case", "bead"], marks=pytest.mark.validate),
    ],
    ids=lambda words: words[0] if isinstance(words, list) else None,
)
def test_an_interrupt_ends_a_command_whenever_it_comes(words: list[str], after: float, tmp_path: Path) -> None:
    code, error = interrupted(words, after, tmp_path)
    live = words[0] == "teleop" and code == 0  # the usual end of a session
    over = words[0] not in ("run", "teleop") and code == 0  # it was quicker
    assert live or over or (code == 130 and error.endswith("otwarp: interrupted\n")), error
    assert "Traceback" not in error
    left = {path.name for path in (tmp_path / "out").glob("*")}
    assert left in (set(), {"figure.png", "run.nc", "run.usda", "summary.json", "trajectory.usdc"})
    assert not list(tmp_path.glob(".*"))


ENDED = """
import atexit, os, signal, sys

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)

class Interrupting:
    def __init__(self, stream):
        self.stream = stream

    def __getattr__(self, name):
        return getattr(self.stream, name)

    def write(self, text):
        interrupt()
        return self.stream.write(text)

class Late:
    def __del__(self, interrupt=interrupt):
        interrupt()

signal.signal(signal.SIGINT, signal.default_int_handler)
moment = sys.argv.pop()
if moment == "behind all that is called at the end":
    atexit.register(interrupt)
from otwarp.cli.start import start
if moment == "while it prints":
    sys.stdout, sys.stderr = Interrupting(sys.stdout), Interrupting(sys.stderr)
code = start()
if moment == "behind the command":
    interrupt()
    raise AssertionError("the process goes on")
if moment == "while objects go":
    sys.late = Late()
sys.exit(code)
"""
"""The command with interrupts at a moment of its end; the last argument says which."""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    "moment", ["behind the command", "behind all that is called at the end", "while objects go", "while it prints"]
)
def test_an_interrupt_at_the_end_changes_nothing(moment: str) -> None:
    """But where it comes before the last line: that is then the only one, however many follow."""
    command = [sys.executable, "-c", ENDED, "scenes", "list", moment]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if moment == "while it prints":
        assert (ended.returncode, ended.stderr) == (130, "otwarp: interrupted\n")
    else:
        assert (ended.returncode, ended.stderr) == (0, "") and "single_bead" in ended.stdout
