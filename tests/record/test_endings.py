"""Runs that end badly: before the first frame is whole, on a full disk, in a folder that goes away, or at SIGTERM."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from pxr import Usd

from otwarp.errors import InputError
from otwarp.record.monitor import Monitor
from otwarp.record.netcdf import NetcdfRecording
from otwarp.record.read import read_run
from otwarp.record.recorder import Recorder
from otwarp.record.run import frame_steps, record_run
from otwarp.scene import Scene
from otwarp.scene.recording.usd import UsdRecording
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.record.small_run import HELD, RATE, frame

ROOT = Path(__file__).parents[2]
BEAD = ROOT / "scenes" / "single_bead.usda"


def recorder(scene: Scene, folder: Path, **options: object) -> Recorder:
    return Recorder(scene, folder, **{"frames_per_second": RATE, "held": HELD, "time_step": 1e-3, **options})


@pytest.mark.parametrize("where", [(NetcdfRecording, "_declare"), (UsdRecording, "begin"), (UsdRecording, "write")])
def test_an_interrupt_within_the_first_frame_leaves_no_trace(
    where: tuple[type, str], scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(*where, interrupt)
    with pytest.raises(KeyboardInterrupt), recorder(scene, tmp_path / "deep" / "run") as out:
        out.write(frame(scene, 0))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scene"]
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "notes.txt").write_text("mine")
    with pytest.raises(KeyboardInterrupt), recorder(scene, kept) as out:
        out.write(frame(scene, 0))
    assert [p.name for p in kept.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "where",
    [
        (NetcdfRecording, "write"),
        (UsdRecording, "write"),
        (Monitor, "update"),
        (NetcdfRecording, "close"),
        (UsdRecording, "close"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_files_of_a_run_that_is_stopped_end_with_the_same_frame(
    where: tuple[type, str], number: signal.Signals, scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However the signal falls: behind one of the writers of a frame, or while the files are finished."""
    function = getattr(*where)

    def then_signal(self: object, *arguments: object) -> None:
        function(self, *arguments)
        if len(written) == 3:
            os.kill(os.getpid(), number)

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(*where, then_signal)
    before, written = signal.signal(number, stop), []
    try:
        with pytest.raises(KeyboardInterrupt), recorder(scene, tmp_path / "run", figure=False) as out:
            for index in range(4):
                written.append(index)
                out.write(frame(scene, index))
                if where[1] == "close" and index == 2:
                    break
        assert signal.getsignal(number) is stop
    finally:
        signal.signal(number, before)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["frames"] == 3
    assert len(read_run(tmp_path / "run" / "run.nc").time) == 3
    assert Usd.Stage.Open(str(tmp_path / "run" / "run.usda")).GetEndTimeCode() == 2.0
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == [
        "run.nc",
        "run.usda",
        "summary.json",
        "trajectory.usdc",
    ]


def test_other_threads_record_without_handlers(scene: Scene, tmp_path: Path) -> None:
    """Only the main thread may set them."""
    with ThreadPoolExecutor(1) as pool, recorder(scene, tmp_path / "run", figure=False) as out:
        pool.submit(out.write, frame(scene, 0)).result()
    assert len(read_run(tmp_path / "run" / "run.nc").time) == 1


_FULL = """
import resource, sys
from pathlib import Path
from otwarp.record.recorder import Recorder
from tests.record.small_run import HELD, RATE, frame, load

sys.dont_write_bytecode = True  # see tests/full_disk.py
folder = Path(sys.argv[1])
scene = load(folder / "scene")
with Recorder(scene, folder / "run", frames_per_second=RATE, held=HELD, time_step=1e-3, usd_world=None) as out:
    for index in range(100):
        if index == 3:
            size = (folder / "run" / "run.nc").stat().st_size
            resource.setrlimit(resource.RLIMIT_FSIZE, (size + 900, size + 900))
        out.write(frame(scene, index, worlds=8))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_FSIZE")
def test_a_full_disk_is_an_os_error_and_the_frames_before_it_stay(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", _FULL, str(tmp_path)], cwd=ROOT, capture_output=True, text=True)
    # the library would crash with a segmentation fault (code -11) if the file were touched again
    assert done.returncode == 1
    assert "OSError: " in done.stderr.splitlines()[-1] and "run.nc: could not be written" in done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"].startswith("stopped: ") and summary["frames"] == 3
    assert len(read_run(tmp_path / "run" / "run.nc").time) == 3


@pytest.mark.parametrize("options", [{}, {"usd_world": None}])
def test_a_folder_that_goes_away_is_an_os_error(scene: Scene, tmp_path: Path, options: dict, capfd) -> None:
    with pytest.raises(OSError, match="run"), recorder(scene, tmp_path / "run", **options) as out:
        out.write(frame(scene, 0))
        shutil.rmtree(tmp_path / "run")
        for index in range(1, 40):
            out.write(frame(scene, index))
    assert capfd.readouterr() == ("", "")
    assert not (tmp_path / "run").exists()


def test_one_frame_is_drawn_without_a_warning(scene: Scene, tmp_path: Path) -> None:
    # warnings are errors in the tests
    with recorder(scene, tmp_path / "run", usd_world=None) as out:
        out.write(frame(scene, 0))
    assert (tmp_path / "run" / "figure.png").is_file()


@pytest.mark.parametrize("name", [".", "absent/end.npz", "out/run.nc", "/proc/end.npz"])
def test_a_checkpoint_that_cannot_be_written_is_refused_before_the_run(
    name: str, device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = Scene.load(BEAD, duration=0.05)
    with pytest.raises(InputError, match=r"checkpoint is .*(cannot be written|a file of the run)"):
        record_run(scene, "out", device=device, checkpoint=name)
    assert not (tmp_path / "out").exists()


def test_a_run_is_resumed_from_its_own_folder_and_not_beyond_its_end(device: str, tmp_path: Path) -> None:
    end, seen = tmp_path / "run" / "end.npz", []
    record_run(
        Scene.load(BEAD, duration=0.05),
        tmp_path / "run",
        device=device,
        checkpoint=end,
        options=StepOptions(time_step=0.001),
    )
    with pytest.raises(InputError, match=r"complete: it stands at 0\.05 s and the duration is 0\.05 s"):
        record_run(Scene.load(BEAD, duration=0.05), tmp_path / "more", device=device, resume=end)
    assert not (tmp_path / "more").exists()
    record_run(
        Scene.load(BEAD, duration=0.1),
        tmp_path / "more",
        device=device,
        resume=end,
        progress=lambda simulated, wall: seen.append((simulated, wall)),
    )
    # the first call says where the run starts, so that its speed can be told
    assert seen[0] == (pytest.approx(0.05), 0.0)
    assert seen[-1][0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("duration", "options", "words"),
    [
        (
            1.0,
            {"frames_per_second": 0.1},
            "duration is 1 s; allowed: at least one frame, 10 s at 0.1 frames per second",
        ),
        (
            1e300,
            {"options": StepOptions(time_step=1e-3)},
            "1e+300 s at a time step of 0.001 s, 1e+303 steps; allowed: up to 1e+12 steps",
        ),
        (
            1e300,
            {"options": StepOptions(time_step=1e-30)},
            "time step of 1e-30 s, inf steps; allowed: up to 1e+12 steps",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:.*falsified by the rounding")
def test_runs_without_a_frame_or_an_end_are_refused(
    duration: float, options: dict, words: str, device: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        record_run(Scene.load(BEAD, duration=duration), tmp_path / "run", device=device, **options)
    assert words in str(error.value)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("worlds", "kept"), [(1, 2), (2, 3), (1, 0)])
def test_no_more_worlds_are_kept_than_there_are(worlds: int, kept: int, device: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"recorded worlds = {kept}; allowed: 1 to {worlds}"):
        record_run(Scene.load(BEAD), tmp_path / "run", worlds=worlds, recorded_worlds=kept, device=device)
    assert not (tmp_path / "run").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("scene", sorted(BEAD.parent.glob("*.usda")), ids=lambda path: path.stem)
def test_a_run_ends_when_its_scene_does(scene: Path, device: str) -> None:
    loaded = Scene.load(scene)
    model = Model.build(loaded, device=device)
    (*_, last) = frame_steps(loaded.settings.duration, loaded.settings.frames_per_second, model.time_step)
    assert last * model.time_step == pytest.approx(loaded.settings.duration, rel=1e-12)
