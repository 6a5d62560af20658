"""Laboratory, camera and estimator in processes of their own, on the machine's clock: what comes, not how soon."""

from __future__ import annotations

import time

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.perception.assemble import SeeingOptions, closed_loop
from otwarp.perception.camera import CameraLost
from otwarp.perception.followed import LostRule
from otwarp.perception.lab import LabOrder
from otwarp.perception.process import ProcessLooker
from otwarp.simulation import Simulation
from tests.perception.scenes import PIECE, QUICKLY, seen_bead

SEEING = SeeingOptions(rendering=QUICKLY, piece=PIECE, device="cpu")
PATIENCE = 60.0


def laboratory(commands: str) -> LabOrder:
    return LabOrder(
        scene=seen_bead(), commands=commands, seed=5, device="cpu", rate=100.0, rendering=QUICKLY, name="top"
    )  # fmt: skip


@pytest.fixture
def looker():
    one = ProcessLooker(seen_bead(), SEEING, bodies=1, camera="top", lab=laboratory)
    yield one
    one.close()


def test_a_laboratory_beside_the_session(looker):
    """Traps go there, images come back, the twin follows; a laboratory that dies is told, and nothing hangs."""
    looker.open()
    assert looker.pieces == {0: PIECE} and looker.info.simulated
    scene = seen_bead()
    twin = Simulation(scene, device="cpu", seed=1)
    loop = closed_loop(scene, looker.pieces, looker, rule=LostRule(after=30.0, lag=30.0))
    loop.start()
    place, power = scene.traps[0].position.at(0.0), scene.traps[0].power.at(0.0)
    begun = time.perf_counter()

    def turn() -> None:
        now = time.perf_counter()
        assert now - begun < PATIENCE
        away = min(1.0, 2.0 * (now - begun))
        loop.update(twin, now, place[None] + [away, 0.0, 0.0], power)
        loop.published()
        time.sleep(0.01)

    while loop.bodies[0].accepted < 5 or time.perf_counter() - begun < 0.6:
        turn()
    pose = loop.bodies[0].pose
    assert pose is not None and not loop.warnings
    assert twin.prim_poses()[0][0, 0] == pytest.approx(pose.position, abs=1e-5)
    # the traps have gone 1 µm; a bead scatters by 0.02 µm in its trap
    assert pose.position == pytest.approx(np.add(place, [1.0, 0.0, 0.0]), abs=0.15)
    stages = loop.latency.percentiles()
    total = sum(stages[name]["p50"] for name in ("rendering", "estimate", "filter"))
    assert len(loop.latency) >= 5 and 0.0 < total < 3.0 * stages["total"]["p99"]
    assert "from light to state" in loop.summary()["text"]
    process = looker._process
    process.kill()
    with pytest.raises(CameraLost, match="the process that reads it has ended"):
        while time.perf_counter() - begun < PATIENCE:
            looker.looks(time.perf_counter())
            time.sleep(0.01)


def test_frames_of_another_size_are_refused(tmp_path):
    """Places count from the middle of the scene's frame: another size would move all bodies, unnoticed."""
    np.save(tmp_path / "frames.npy", np.full((2, 100, 300), 89, dtype=np.uint8))
    looker = ProcessLooker(seen_bead(), SEEING, bodies=1, camera=f"files:{tmp_path / 'frames.npy'}")
    with pytest.raises(InputError, match=r"frames are 300 × 100 pixels; allowed: 307 × 153, as /World/top has them"):
        looker.open()


def test_a_camera_that_is_not_there_is_said_in_one_line(tmp_path):
    looker = ProcessLooker(seen_bead(), SEEING, bodies=1, camera=f"files:{tmp_path}")
    with pytest.raises(InputError) as error:
        looker.open()
    assert "holds no image" in str(error.value) and "\n" not in str(error.value)
    assert np.all([looker.pieces == {}, looker._process is None])
