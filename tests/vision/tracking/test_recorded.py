"""A recorded run tracked through rendered frames: errors, files, and what is refused."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.record import record_run
from otwarp.scene import Scene
from otwarp.vision.rendering import Rendering
from otwarp.vision.tracking.recorded import RecordedBody, track_run
from otwarp.vision.tracking.rotations import exponential, product
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.source import HELD_OUT, _rolls, template_source
from tests.full_disk import largest_file

BEAD = "scenes/single_bead.usda"
QUICKLY = ["--size", "40", "--rings", "1", "--thickness", "0.5", "--device", "cpu"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "bead"
    record_run(Scene.load(BEAD, duration=0.2), folder, device="cpu")
    return folder


@pytest.mark.quick
def test_a_run_is_tracked(run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """By templates, late and with gaps: the track is nearer to the bead than its thermal motion."""
    import xarray

    file = tmp_path / "bead.nc"
    assert main(["vision", "track", str(run), "-o", str(file), "--delay", "0.02", "--drop", "0.2", *QUICKLY]) == 0
    told = capfd.readouterr().out
    assert "NIS per degree of freedom" in told
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bead.nc", "bead.png"]
    with xarray.open_dataset(file) as track:
        off = (track.seen_position - track.true_position).values
        assert 0.5 < np.isfinite(off[:, 0]).mean() < 1.0
        assert np.nanmax(np.abs(off)) < 0.05
        held = (track.position - track.true_position).values[3:]
        assert np.sqrt(np.nanmean(held**2)) < 0.12
        # a prediction every millisecond between frames of 60 Hz
        assert 12 * len(track.frame) < len(track.prediction) < 17 * len(track.frame)
        assert np.all(np.diff(track.predicted_time) > 0.0)
        eigenvalues = np.linalg.eigvalsh(track.predicted_covariance.values[:, :3, :3])
        assert eigenvalues.min() > 0.0


@pytest.mark.quick
def test_what_takes_long_before_the_first_frame_is_told(
    run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of pieces of 1,024 pixels the errors of templates take minutes."""
    monkeypatch.setattr("otwarp.cli.progress.LONG", 0.0)
    assert main(["vision", "track", str(run), "-o", str(tmp_path / "bead.nc"), "--frames", "2", *QUICKLY]) == 0
    told = capfd.readouterr().err
    assert "otwarp: tilt of the templates 1 of 1\notwarp: image of the templates' errors 1 of 32\n" in told
    assert f"otwarp: image of the templates' errors {HELD_OUT} of {HELD_OUT}\notwarp: frame 1 of 2\n" in told


@pytest.mark.validate
def test_what_templates_state_is_right_while_a_pair_lies_down(tmp_path: Path) -> None:
    """NEES in thirds of the run, and NIS: few source points err by ten times as much at 45° as while the pair lies."""
    record_run(Scene.load("scenes/strategy_a.usda"), tmp_path / "pair", device="cpu")
    recorded = RecordedBody.load(tmp_path / "pair", every=8)
    how = Rendering(rings=3, thickness=0.2)
    source = template_source(recorded, 224, rendering=how, device="cpu")
    steps = track_run(recorded, source, size=224, rate=0.0, rendering=how, device="cpu")
    nees = np.array([s.nees / s.freedom for s in steps])
    nis = np.array([s.nis / s.degrees for s in steps[1:]])
    # standard error √(2 / 5n), as if errors of neighbouring frames were not alike
    for squares in (nees, nis):
        assert abs(squares.mean() - 1.0) < 5.0 * np.sqrt(2.0 / (5.0 * len(squares)))
    assert all(1.0 / 3.0 < part.mean() < 3.0 for part in np.array_split(nees, 3))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> RecordedBody:
    """Frames of a robot that looks different when it turns about its axis, at rest."""
    folder = tmp_path_factory.mktemp("runs") / "robot"
    record_run(Scene.load("scenes/strategy_b.usda", duration=0.05), folder, device="cpu")
    return RecordedBody.load(folder)


def rolled(robot: RecordedBody, degrees: np.ndarray) -> RecordedBody:
    """The same with the robot turned about its axis, in one frame after the other by each of some angles."""
    axis, start = Shape.of(robot.scene, robot.body, np.zeros(3)).axis, robot.orientation[0, robot.index]
    turn = robot.orientation[[0] * len(degrees)].copy()
    turn[:, robot.index] = [product(start, exponential(np.radians(a) * axis)) for a in degrees]
    place = robot.position[[0] * len(degrees)]
    time = np.arange(len(degrees)) / 60.0
    return dataclasses.replace(robot, time=time, position=place, orientation=turn)


@pytest.mark.quick
def test_turns_about_the_axis_are_those_of_the_run(robot: RecordedBody) -> None:
    degrees = np.array([0.0, 3.0, -2.0, 40.0, 170.0])
    shape = Shape.of(robot.scene, robot.body, np.zeros(3))
    np.testing.assert_allclose(np.degrees(_rolls(rolled(robot, degrees), shape)), degrees, atol=1e-3)


def test_turns_about_the_axis_that_templates_do_not_know_count_as_errors(robot: RecordedBody) -> None:
    """3° show a robot 10 nm beside where it is: left out of the covariance, NEES of this robot was 31 for 0.9."""
    how, stated = Rendering(rings=1, thickness=0.5), []
    for degrees in (np.zeros(8), np.linspace(-4.0, 4.0, 8)):
        source = template_source(rolled(robot, degrees), 200, rendering=how, device="cpu")
        stated.append(np.sqrt(source.matcher.errors.variance(0.0, 0.0)[:2]))
    # the robot lies along y, and seems to move across it alone
    assert stated[1][0] > 0.005 > 3.0 * stated[0][0]
    assert stated[1][1] < 0.003


@pytest.mark.quick
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--body", "/World/none"], "body is /World/none; allowed: /World/bead"),
        (["--world", "3"], "world = 3; allowed: 0 … 0"),
        (["--camera", "side"], "--camera is side; allowed: /World/microscope"),
        (["--every", "1000"], "frames = 1 to track; allowed: 2 or more"),
        (["--net", "absent"], "absent"),
        (["--net", "absent", "--templates"], "--net and --templates are both given"),
        (["-o", "track.csv"], "--out is track.csv; allowed: a file that ends with .nc"),
    ],
)
def test_nonsense_is_refused(
    run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["vision", "track", str(run), *QUICKLY, *words]) == 2
    error = capfd.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.quick
@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_FSIZE")
def test_a_full_disk_is_said_and_leaves_nothing(run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """netCDF and HDF5 name no cause of a write that fails, so that the file is made in memory."""
    file = tmp_path / "bead.nc"
    with largest_file(8192):
        assert main(["vision", "track", str(run), "-o", str(file), "--frames", "3", *QUICKLY]) == 1
    assert capfd.readouterr().err.splitlines()[-1] == f"otwarp: {file}: File too large"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.quick
def test_a_run_without_frames_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["vision", "track", str(tmp_path)]) == 2
    assert "holds no run.nc; allowed: the folder of a recorded run" in capfd.readouterr().err
