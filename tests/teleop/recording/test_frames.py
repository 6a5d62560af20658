"""The moments of a recording: the numbers of the frames that were written, from MCAP and from bags made of it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.errors import InputError
from otwarp.teleop.recording.frames import ARRAYS, frame_names, is_session, read_frames, scene_of
from tests.view.runs import RATE, SCENE, frames
from tests.view.sessions import COUNT, session

pytest.importorskip("rosbags")

SINGLE = 1e-6
"""Relative rounding of metres and back in single precision."""


@pytest.fixture(scope="module")
def take(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording."""
    path = tmp_path_factory.mktemp("take") / "take.mcap"
    session(path, ot.Scene.load(SCENE))
    return path


def check(path: Path) -> None:
    """It holds what was written."""
    found, scene = read_frames(path), ot.Scene.load(SCENE)
    wanted = frames(scene, COUNT)
    assert found.complete and found.time == pytest.approx(np.arange(COUNT) / RATE, abs=1e-9)
    assert found.simulated == pytest.approx([frame.time for frame in wanted], abs=1e-12)
    bodies, traps = frame_names(scene)
    for n in (0, 44, COUNT - 1):
        for k, name in enumerate(bodies):
            np.testing.assert_allclose(found.poses[name][n, :3], wanted[n].position[0, k], rtol=SINGLE, atol=SINGLE)
            np.testing.assert_allclose(found.poses[name][n, 3:], wanted[n].orientation[0, k], atol=SINGLE)
        for k, name in enumerate(traps):
            np.testing.assert_allclose(
                found.poses[name][n, :3], wanted[n].trap_position[0, k], rtol=SINGLE, atol=SINGLE
            )
        for name in ARRAYS:
            np.testing.assert_allclose(found.arrays[name][n], getattr(wanted[n], name)[0], rtol=SINGLE)


def test_a_recording_has_the_numbers_that_were_written(take: Path):
    check(take)
    assert scene_of(take, read_frames(take).about).bodies == ot.Scene.load(SCENE).bodies


@pytest.mark.parametrize("name", ["take.bag", "take_ros2"])
def test_a_bag_made_of_it_has_them_as_well(take: Path, tmp_path: Path, name: str):
    bag = tmp_path / name
    convert = shutil.which("rosbags-convert", path=str(Path(sys.executable).parent))
    assert convert is not None
    subprocess.run([convert, "--src", str(take), "--dst", str(bag)], check=True)
    assert is_session(bag)
    check(bag)


def test_a_recording_cut_short_is_read_up_to_there(take: Path, tmp_path: Path):
    cut = tmp_path / "cut.mcap"
    data = take.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="too little of one"):  # a session below a second is one chunk
        read_frames(cut)
    cut.write_bytes(data[:-40])
    found = read_frames(cut)
    assert not found.complete and len(found.time) == COUNT


def test_what_is_no_recording_is_refused(take: Path, tmp_path: Path):
    (tmp_path / "no.mcap").write_bytes(b"not at all")
    (tmp_path / "no.bag").write_bytes(b"not at all")
    for name in ("no.mcap", "no.bag", "missing.mcap"):
        with pytest.raises(InputError, match=rf"^{re.escape(str(tmp_path / name))}: ") as refused:
            read_frames(tmp_path / name)
        assert str(refused.value).count(name) == 1
    about = dict(read_frames(take).about)
    gone = {**about["scene"], "file": str(tmp_path / "gone.usda")}
    with pytest.raises(InputError, match=r"gone\.usda is not there; allowed: --scene"):
        scene_of(take, about | {"scene": gone})
    assert scene_of(take, about | {"scene": gone}, SCENE).file == SCENE
    with pytest.raises(InputError, match=r"lacks /World/.*, which take\.mcap recorded"):
        scene_of(take, about, SCENE.with_name("single_bead.usda"))


def test_a_recording_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("otwarp.teleop.recording.FORMAT", 99)
    session(tmp_path / "later.mcap", ot.Scene.load(SCENE))
    with pytest.raises(InputError, match="is a recording of format 99; allowed: 1"):
        read_frames(tmp_path / "later.mcap")


def test_bodies_that_were_not_simulated_are_left_out(take: Path):
    about = dict(read_frames(take).about)
    names = about["scene"]["bodies"][:2]
    found = scene_of(take, about | {"scene": {**about["scene"], "bodies": names}})
    assert [body.name for body in found.bodies] == names
