"""What is said of a run that is found in a folder: whole, cut off, ended early, or about to be replaced."""

from __future__ import annotations

import json
import logging
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from netCDF4 import Dataset

from otwarp.cli.main import main
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.record.folder import check_run, earlier_run, early_end
from otwarp.record.recorder import Recorder
from otwarp.scene import Scene
from tests.record.small_run import HELD, RATE, frame


@pytest.fixture
def run(scene: Scene, tmp_path: Path) -> Path:
    """40 frames of two worlds, interrupted."""
    options = {"frames_per_second": RATE, "held": HELD, "time_step": 1e-3, "seed": 7, "figure": False}
    with Recorder(scene, tmp_path / "run", **options) as out:
        for index in range(40):
            out.write(frame(scene, index, worlds=2))
        out.stop("interrupted")
    return tmp_path / "run"


def test_a_run_that_ended_early_says_how_far_it_came(run: Path, scene: Scene) -> None:
    asked = f"{scene.settings.duration:.4g} s"
    assert early_end(run) == f"{run}: the run ended early, after 0.65 of {asked} (interrupted)"
    with pytest.warns(PlausibilityWarning, match="ended early"):
        check_run(run / "run.nc")
    about = json.loads((run / "summary.json").read_text())
    (run / "summary.json").write_text(json.dumps(about | {"status": "running", "duration_s": 0.1}))
    assert early_end(run) == f"{run}: the run was killed, or still goes on: it has at least 0.65 of {asked}"
    (run / "summary.json").write_text(json.dumps(about | {"status": "finished"}))
    assert early_end(run) == ""
    check_run(run / "run.nc")


def test_an_earlier_run_is_named_where_another_takes_its_place(
    run: Path, scene: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    assert earlier_run(run) == "small, 2 worlds, 0.65 s" and earlier_run(run.parent) == ""
    options = {"frames_per_second": RATE, "held": HELD, "time_step": 1e-3, "figure": False}
    with caplog.at_level(logging.INFO, logger="otwarp"), Recorder(scene, run, **options) as out:
        out.write(frame(scene, 0, worlds=1))
    assert caplog.messages == [f"{run}: replaces an earlier run (small, 2 worlds, 0.65 s)"]
    (run / "summary.json").unlink()
    assert earlier_run(run) == "without a summary"
    shutil.rmtree(run)


def zeros(file: Path) -> None:
    """The last third of the frames as a disk leaves them that lost them."""
    with Dataset(file, "a") as data:
        data["time"][27:] = 0.0


def nans(file: Path) -> None:
    with Dataset(file, "a") as data:
        data["time"][27:] = np.nan


@pytest.mark.parametrize("spoil", [lambda file: os.truncate(file, file.stat().st_size // 2), zeros, nans])
def test_numbers_that_were_cut_off_are_refused_alike(
    run: Path, spoil, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil(run / "run.nc")
    with pytest.raises(InputError, match=r"run\.nc: was cut off.*allowed: a whole copy"):
        check_run(run / "run.nc")
    for words in (["analyse", str(run)], ["view", str(run), "--no-open", "--port", "0"],
                  ["vision", "render", str(run), "-o", str(tmp_path / "s.png")],
                  ["vision", "track", str(run), "-o", str(tmp_path / "t.nc")]):  # fmt: skip
        assert main(words) == 2, words
        said = capsys.readouterr().err
        assert "was cut off" in said and said.count("\n") == 1, (words, said)
