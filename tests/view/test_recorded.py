"""Runs read from disk: the numbers that were written, and one line for a file that is not whole or not ours."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.cli.main import EXIT_BAD_INPUT, main
from otwarp.errors import InputError
from otwarp.record.monitor import Monitor
from otwarp.record.netcdf import NetcdfRecording
from otwarp.simulation.frame import SHAPES
from otwarp.view import RecordedRun
from tests.view.runs import PEAK, PEAK_AT, RATE, SCENE, STEP, frames, recorded

SINGLE = 6.1e-8
"""Relative rounding of single precision, in which frames are stored and drawn."""


def test_a_moment_has_the_numbers_that_were_recorded(run: Path):
    found = RecordedRun(run)
    wanted = frames(ot.Scene.load(SCENE), 120)
    assert found.time == pytest.approx([f.time for f in wanted], abs=1e-12)
    for n in (0, 1, PEAK_AT, 119):
        frame = found.frame(n)
        assert frame.time == found.time[n]
        for name in set(SHAPES) - {"escape_time"}:
            np.testing.assert_allclose(getattr(frame, name), getattr(wanted[n], name)[0], rtol=SINGLE, atol=1e-12)
    many = found.moments(slice(70, 80))
    assert many.contact_load[7, -1] == pytest.approx(PEAK) and many.contact_load.sum() == pytest.approx(PEAK)
    assert many.position.shape == (10, 3, 3) and np.all(many.came_in == 0.0)
    assert dict(found.about)["frames"] == f"120, {RATE:g} per second"
    assert found.held.tolist() == [0, 0, 0, 1, 1, 1]
    found.close()


@pytest.mark.parametrize("name", ["", "run.nc", "run.usda"])
def test_a_run_is_found_by_its_folder_and_its_files(run: Path, name: str):
    found = RecordedRun(run / name)
    assert len(found.time) == 120 and found.title == run.name
    found.close()


@pytest.fixture
def copy(run: Path, tmp_path: Path) -> Path:
    """A copy of a run whose scene lies elsewhere, to be spoilt."""
    folder = tmp_path / "copy"
    shutil.copytree(run, folder)
    stage = folder / "run.usda"
    text = stage.read_text().replace("teleop_small.usda@", "teleop_small.usda@")
    start = text.rindex("@", 0, text.index("teleop_small.usda@")) + 1
    stage.write_text(text[:start] + str(SCENE) + text[text.index("teleop_small.usda@") + len("teleop_small.usda") :])
    return folder


@pytest.mark.parametrize("share", [0.999, 0.6, 0.02])
def test_a_file_that_was_cut_off_is_refused(copy: Path, share: float, capsys: pytest.CaptureFixture[str]):
    file = copy / "run.nc"
    os.truncate(file, int(share * file.stat().st_size))
    assert main(["view", str(copy), "--no-open", "--port", "0"]) == EXIT_BAD_INPUT
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and "cut off" in said.err and str(file) in said.err and said.out == ""


def test_a_file_of_whole_frames_that_lacks_some_is_refused(copy: Path):
    file = copy / "run.nc"
    size = file.stat().st_size
    short = recorded(copy.parent / "short", count=118) / "run.nc"
    assert size > short.stat().st_size
    os.truncate(file, short.stat().st_size)
    with pytest.raises(InputError, match="cut off"):
        RecordedRun(copy)


def test_a_run_without_frames_is_refused(copy: Path):
    scene = ot.Scene.load(SCENE)
    options = {"worlds": 1, "total_worlds": 1, "seed": 0, "time_step": STEP, "frames_per_second": RATE}
    NetcdfRecording(copy / "run.nc", scene, Monitor(scene, [(-1, -1)] * 6, 1), **options).close()
    with pytest.raises(InputError, match="frames = 0; allowed: 1 or more"):
        RecordedRun(copy)


def test_a_file_of_another_version_is_refused(copy: Path, capsys: pytest.CaptureFixture[str]):
    file = copy / "run.nc"
    file.write_bytes(file.read_bytes().replace(b"contact_load", b"contact_lo__"))
    assert main(["view", str(copy), "--no-open", "--port", "0"]) == EXIT_BAD_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"written by otwarp {ot.__version__}, another version" in said
    assert "it has no contact_load" in said


def test_a_scene_that_was_edited_since_is_refused(copy: Path, tmp_path: Path):
    text = SCENE.read_text()
    assert 'def Sphere "cell"' in text
    scene = tmp_path / "edited.usda"
    scene.write_text(
        text.replace('def Sphere "cell"', 'def Sphere "another"').replace("/World/cell>", "/World/another>")
    )
    stage = copy / "run.usda"
    stage.write_text(stage.read_text().replace(str(SCENE), str(scene)))
    with pytest.raises(InputError, match=r"other bodies than run\.nc"):
        RecordedRun(copy)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda folder: (folder / "run.nc").unlink(), "holds no run.nc"),
        (lambda folder: (folder / "run.usda").unlink(), "is not beside run.nc"),
        (lambda folder: (folder / "run.nc").write_bytes(b"something else"), "no netCDF-3 file"),
        (lambda folder: (folder / "run.nc").write_bytes(b""), "no netCDF-3 file"),
    ],
)
def test_what_is_no_run_is_refused(copy: Path, spoil, why: str):
    spoil(copy)
    with pytest.raises(InputError, match=why):
        RecordedRun(copy)


def test_worlds_and_paths_that_are_not_there_are_refused(run: Path, tmp_path: Path):
    with pytest.raises(InputError, match="world = 1; allowed: 0 … 0"):
        RecordedRun(run, world=1)
    with pytest.raises(InputError, match="no such file or folder"):
        RecordedRun(tmp_path / "nothing")
    assert main(["view", str(run), str(run), str(run)]) == EXIT_BAD_INPUT
