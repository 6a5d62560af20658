"""A run whose process is killed: what is left must open, up to the last frame."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pxr import Usd

from otwarp.record.read import read_run
from tests.record.small_run import load
from tests.record.test_usd import check

_WRITER = """
import sys, time
from itertools import count
from pathlib import Path

folder, pause, frames = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
ticks = count()
time.perf_counter = lambda: 1e-3 * next(ticks)

from otwarp.record.recorder import Recorder
from tests.record.small_run import HELD, RATE, frame, load

scene = load(folder / "scene")
out = Recorder(scene, folder / "run", frames_per_second=RATE, held=HELD, time_step=1e-3, forces=True)
for index in range(frames):
    out.write(frame(scene, index))
    print(index, flush=True)
    for _ in range(pause):
        next(ticks)
time.sleep(600.0)
"""
"""Its clock is a virtual one: a millisecond passes with each look at it, so a flush takes one, whatever the machine."""

ENDLESS = 100_000
"""Frames of a writer that is killed while it writes."""

LAG = 4.0
"""Frames by which the USD may be behind when frames come as fast as they can: flushing takes a quarter of the time."""


def killed_run(folder: Path, frames: int, delay: float, pause: int = 0, most: int = ENDLESS) -> int:
    """Kill a writer of `most` frames, `pause` ms of its clock apart, `delay` s after frame `frames`; last reported."""
    command = [sys.executable, "-c", _WRITER, str(folder), str(pause), str(most)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as writer:
        assert writer.stdout is not None
        last = int(writer.stdout.readline())
        while last + 1 < frames:
            last = int(writer.stdout.readline())
        time.sleep(delay)
        writer.kill()
        rest = writer.stdout.read().split("\n")[:-1]
    return int(rest[-1]) if rest else last


# the moments spread over the cycle of a clip: its middle, its change, and within a write
@pytest.mark.parametrize(("frames", "delay"), [(20, 0.0), (65, 0.0007), (96, 0.0023)])
def test_files_of_a_killed_run_open_up_to_its_last_frames(tmp_path: Path, frames: int, delay: float) -> None:
    last = killed_run(tmp_path, frames, delay)
    with xr.open_dataset(tmp_path / "run" / "run.nc") as data:
        assert data.sizes["frame"] >= last + 1
        np.testing.assert_allclose(data["time"], np.arange(data.sizes["frame"]) / 60.0)
        assert np.isfinite(data["position"]).all()
        # frame k drifts by −10·k/60 µm along y: the last record is whole, not merely there
        fall = data["position"][:, 0, 2, 1] - data["position"][0, 0, 2, 1]
        np.testing.assert_allclose(fall, -10.0 * data["time"], atol=1e-5)
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    end = stage.GetEndTimeCode()
    assert last - end <= LAG
    scene = load(tmp_path / "scene")
    for code in (0.0, 0.5 * end, end):
        check(stage, scene, code)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["status"] == "running"


def test_when_frames_come_at_an_ordinary_pace_each_is_in_the_usd_at_once(tmp_path: Path) -> None:
    last = killed_run(tmp_path, 36, 0.0, pause=40, most=36)
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    assert stage.GetEndTimeCode() == last == 35
    assert len(read_run(tmp_path / "run" / "run.nc").time) == stage.GetEndTimeCode() + 1
    check(stage, load(tmp_path / "scene"), float(last))
