"""Recorded runs gone on with from a frame: the same way as the run's own, and images that are blurred by it."""

from __future__ import annotations

import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.record import record_run
from otwarp.scene import Scene
from otwarp.vision.moment import moments
from otwarp.vision.replay import BLUR_SAMPLES, Replay
from otwarp.vision.tracking.recorded import RecordedBody

pytestmark = pytest.mark.quick


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "bead"
    record_run(Scene.load("scenes/single_bead.usda", duration=0.2), folder, worlds=2, seed=5, device="cpu")
    return folder


@pytest.mark.thorough
@pytest.mark.parametrize("world", [0, 1])
def test_the_way_to_the_next_frame_is_the_runs_own(run: Path, world: int) -> None:
    scene = Scene.load(run / "run.usda")
    with netCDF4.Dataset(run / "run.nc") as data:
        replay = Replay(scene, data, world, device="cpu")
        place = np.asarray(data["position"][:, world], dtype=float)
        turn = np.asarray(data["orientation"][:, world], dtype=float)
        step, interval = np.asarray(data["step"][:]).astype(int), float(data.time_step)
    for frame in (7, 3):
        places, turns = replay.during(
            place[frame], turn[frame], step[frame], interval * (step[frame + 1] - step[frame])
        )
        assert places.shape == (BLUR_SAMPLES, 1, 3) and turns.shape == (BLUR_SAMPLES, 1, 4)
        assert np.array_equal(places[0], place[frame])
        assert np.abs(places[-1] - place[frame + 1]).max() < 1e-5 < np.abs(places[-1] - places[0]).max()


@pytest.mark.thorough
def test_an_exposure_is_many_moments_and_what_cannot_be_is_refused(run: Path, tmp_path: Path) -> None:
    assert moments(run, time=0.1).position.shape == (1, 1, 3)
    seen = moments(run, time=0.1, exposure=0.01, world=1, device="cpu")
    assert seen.position.shape == (BLUR_SAMPLES, 1, 3)
    assert np.ptp(seen.position, axis=0).max() > 0.01
    with pytest.raises(InputError, match=r"is 0\.05 s; allowed: up to 0\.016\d\d s, the time from frame to frame"):
        RecordedBody.load(run, exposure=0.05)
    body = RecordedBody.load(run, exposure=0.01, device="cpu")
    assert np.array_equal(body.during(2)[0][0], body.position[2])
    shutil.copytree(run, tmp_path / "old")
    with netCDF4.Dataset(tmp_path / "old" / "run.nc", "a") as data:
        data.delncattr("seed")
    with pytest.raises(InputError, match="says nothing of seed, by which bodies move during an exposure; allowed: "):
        moments(tmp_path / "old", exposure=0.01)
