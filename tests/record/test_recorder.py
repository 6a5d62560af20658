from __future__ import annotations

import dataclasses
import json
import os
import resource
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from otwarp.errors import InputError
from otwarp.record.read import read_run
from otwarp.record.recorder import FILES, Recorder, check_folder
from otwarp.scene import Scene
from tests.record.small_run import HELD, RATE, frame


def recorder(scene: Scene, folder: Path, **options: object) -> Recorder:
    return Recorder(scene, folder, **{"frames_per_second": RATE, "held": HELD, "time_step": 1e-3, "seed": 7, **options})


def strict_json(path: Path) -> dict:
    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in {path.name}")

    return json.loads(path.read_text(), parse_constant=refuse)


def test_a_run_leaves_its_five_files_and_nothing_else(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "a" / "run", forces=True) as out:
        for index in range(40):
            out.write(frame(scene, index, worlds=2))
    names = sorted(p.name for p in (tmp_path / "a" / "run").iterdir())
    assert names == ["figure.png", "run.nc", "run.usda", "summary.json", "trajectory.usdc"]
    summary = strict_json(tmp_path / "a" / "run" / "summary.json")
    assert summary == out.summary
    assert summary["status"] == "finished"
    assert (summary["scene"], summary["worlds"], summary["seed"], summary["time_step_s"]) == ("small", 2, 7, 1e-3)
    assert (summary["frames"], summary["steps"]) == (40, 390)
    assert summary["duration_s"] == pytest.approx(39 / RATE)
    assert summary["real_time_factor"] == pytest.approx(summary["duration_s"] / summary["wall_time_s"])
    assert summary["trap_distance"]["mean"] == pytest.approx(0.25)
    assert summary["trap_distance"]["warning_line"] == 1.0
    assert summary["contact_force"]["mean"] == pytest.approx(np.mean([1.0 + i / RATE for i in range(40)]))
    assert summary["contact_force"]["robots"]["/World/Group/left"]["samples"] == 80
    assert [w["outcome"] for w in summary["task"]["worlds"]] == ["undecided", "undecided"]
    assert "small: 0.65 s simulated" in summary["text"]


def test_many_worlds_are_counted(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "run", worlds=3, usd_world=None, figure=False) as out:
        for index in range(5):
            item = frame(scene, index, worlds=40)
            position = np.array(item.position)
            if index >= 2:
                position[:10, 2, 0] += 9.0
            out.write(dataclasses.replace(item, position=position))
    task = out.summary["task"]
    assert task["counts"] == {"undecided": 30, "delivered": 0, "robot lost": 0, "cell lost": 10}
    assert "worlds" not in task
    assert task["median_time_s"] == {"cell lost": 2 / RATE}
    assert (out.summary["worlds"], out.summary["recorded_worlds"]) == (40, 3)
    assert "30 undecided, 10 cell lost" in out.summary["text"]
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["run.nc", "summary.json"]


def test_warnings_name_the_line_and_the_share(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "run", usd_world=None, figure=False) as out:
        out.warn("the step is coarse")
        for index in range(4):
            far = np.array([[2.5 if index == 3 else 0.5, 0.5]])
            escaped = np.array([[0.021 if index == 3 else np.nan, np.nan]])
            out.write(frame(scene, index, trap_distance=far, escape_time=escaped))
    assert out.summary["warnings"] == [
        "the step is coarse",
        "the robot–trap distance was above its warning line of 1 µm for 12 % of the time",
        "a trap lost the sphere that it holds: /World/Traps/left at t = 0.021 s",
    ]
    assert out.summary["escapes"] == 1
    assert out.summary["first_escape"] == {"trap": "/World/Traps/left", "world": 0, "time_s": 0.021}


def test_while_it_runs_the_summary_says_so_and_an_error_becomes_its_status(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), recorder(scene, tmp_path / "run", figure=False) as out:
        out.write(frame(scene, 0))
        assert strict_json(tmp_path / "run" / "summary.json")["status"] == "running"
        out.write(frame(scene, 1))
        raise RuntimeError("the disk\ncaught fire")
    summary = strict_json(tmp_path / "run" / "summary.json")
    assert (summary["status"], summary["frames"]) == ("stopped: the disk caught fire", 2)
    assert Usd.Stage.Open(str(tmp_path / "run" / "run.usda")).GetEndTimeCode() == 1.0
    assert len(read_run(tmp_path / "run" / "run.nc").time) == 2


def test_the_first_reason_to_stop_stays(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), recorder(scene, tmp_path / "run", figure=False) as out:
        out.write(frame(scene, 0))
        out.stop("interrupted by the user")
        raise KeyboardInterrupt
    assert out.summary["status"] == "stopped: interrupted by the user"


def test_a_new_run_replaces_the_old_one_whole_and_leaves_other_files_alone(scene: Scene, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with recorder(scene, folder) as out:
        for index in range(3):
            out.write(frame(scene, index))
    (folder / "notes.txt").write_text("mine")
    (folder / ".run.nc.part").write_text("left by a killed program")
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    second = recorder(scene, folder, usd_world=None, figure=False)
    # nothing has been touched yet: a run that fails before its first frame costs nothing
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    second.write(frame(scene, 0))
    assert sorted(p.name for p in folder.iterdir()) == ["notes.txt", "run.nc", "summary.json"]
    second.close()
    assert (folder / "notes.txt").read_text() == "mine"


def test_a_recorder_without_frames_leaves_no_trace(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "deep" / "run"):
        pass
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scene"]


def test_a_folder_that_cannot_be_written_is_refused_before_anything_starts(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/otwarp"), tmp_path / ("x" * 400)):
        with pytest.raises(InputError, match=r"output folder is .*cannot be written") as error:
            recorder(scene, folder)
        assert "\n" not in str(error.value)
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="Permission denied"):
        check_folder(tmp_path / "run")


def test_a_run_does_not_replace_its_own_scene(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "run", figure=False) as out:
        for index in range(61):
            out.write(frame(scene, index))
    again = dataclasses.replace(scene, file=tmp_path / "run" / "run.usda")
    with pytest.raises(InputError, match=r"holds the scene run\.usda"):
        recorder(again, tmp_path / "run")
    assert Usd.Stage.Open(str(tmp_path / "run" / "run.usda")).GetEndTimeCode() == 60.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frames_per_second": 0.0}, "frames per second = 0"),
        ({"frames_per_second": float("nan")}, "frames per second = nan"),
        ({"worlds": 0}, "recorded worlds = 0; allowed: 1 or more"),
        ({"usd_world": -1}, "USD world = -1"),
        ({"arrow_scale": -2.0}, "arrow scale = -2"),
    ],
)
def test_bad_arguments_are_refused(scene: Scene, tmp_path: Path, options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        recorder(scene, tmp_path / "run", **options)
    assert not (tmp_path / "run").exists()


def test_a_world_that_is_not_there_is_refused_before_the_old_run_goes(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "summary.json").write_text("old")
    with pytest.raises(InputError, match=r"USD world = 3; allowed: 0 … 1"):
        recorder(scene, tmp_path / "run", usd_world=3).write(frame(scene, 0, worlds=2))
    assert (tmp_path / "run" / "summary.json").read_text() == "old"


def test_frames_must_fit_and_come_in_order(scene: Scene, tmp_path: Path) -> None:
    with recorder(scene, tmp_path / "run", figure=False) as out:
        out.write(frame(scene, 1))
        with pytest.raises(ValueError, match=r"frame time is 0\.0166667 s"):
            out.write(frame(scene, 1))
        with pytest.raises(ValueError, match=r"frame position has shape \(2, 6, 3\); allowed: \(1, 6, 3\)"):
            out.write(frame(scene, 2, worlds=2))
        with pytest.raises(ValueError, match="frame contact_load has shape"):
            out.write(frame(scene, 2, contact_load=np.zeros((1, 0))))
    assert len(read_run(tmp_path / "run" / "run.nc").time) == 1


GROWTH = 2**20
"""Bytes of memory that 900 more frames may cost: 0.1 MB was measured, and 2.1 MB when their samples are kept."""


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


@pytest.mark.thorough
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_memory_does_not_grow_with_the_run(scene: Scene, tmp_path: Path) -> None:
    out = recorder(scene, tmp_path / "run", forces=True, figure=False)
    for index in range(300):
        out.write(frame(scene, index))
    before = resident()
    for index in range(300, 1200):
        out.write(frame(scene, index))
    assert resident() - before < GROWTH
    out.close()
    assert set(FILES) >= {p.name for p in (tmp_path / "run").iterdir()}
