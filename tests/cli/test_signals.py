"""The command line without arguments, and when it is told to stop."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import pytest

from otwarp.cli.main import main
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
    assert capfd.readouterr() == ("", "otwarp: No such command 'chekc'.\n")


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
    assert capfd.readouterr().err == f"otwarp: {word}\n"
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
