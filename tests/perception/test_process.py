"""Laboratory, camera and estimator in processes of their own, on the machine's clock: what comes, not how soon."""

from __future__ import annotations

import time

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.realtime import RealClock
from otwarp.perception.assemble import SeeingOptions, closed_loop
from otwarp.perception.camera import CameraLost
from otwarp.perception.estimator import Look
from otwarp.perception.followed import LostRule
from otwarp.perception.lab import LabOrder
from otwarp.perception.looker import DirectLooker
from otwarp.perception.photographer import Photographer
from otwarp.perception.plant import Plant, PlantOptions, plant_scene
from otwarp.perception.process import ProcessLooker
from otwarp.perception.simulated import SimulatedCamera
from otwarp.simulation import Simulation
from tests.perception.scenes import PIECE, QUICKLY, estimator, seen_bead

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

    while len(loop.latency) < 5 or time.perf_counter() - begun < 0.6:
        turn()
    pose = loop.bodies[0].pose
    assert pose is not None and not loop.warnings
    assert twin.prim_poses()[0][0, 0] == pytest.approx(pose.position, abs=1e-5)
    # the traps have gone 1 µm; a bead scatters by 0.02 µm in its trap
    assert pose.position == pytest.approx(np.add(place, [1.0, 0.0, 0.0]), abs=0.15)
    stages = loop.latency.percentiles()
    total = sum(stages[name]["p50"] for name in ("rendering", "estimate", "filter"))
    assert loop.bodies[0].accepted >= 5 and 0.0 < total < 3.0 * stages["total"]["p99"]
    assert "from light to state" in loop.summary()["text"]
    process = looker._process
    process.kill()
    with pytest.raises(CameraLost, match="the process that reads it has ended"):
        while time.perf_counter() - begun < PATIENCE:
            looker.looks(time.perf_counter())
            time.sleep(0.01)


class Prompt(DirectLooker):
    """Gives out a look of nothing every 10 ms, from when it is started."""

    began = count = 0.0

    def start(self, now: float) -> None:
        """See `Looker`."""
        self.began = now

    def looks(self, now: float) -> list[Look]:
        """See `Looker`."""
        found = []
        while (light := self.began + 0.01 * (self.count + 1)) <= now:
            self.count += 1
            times = dict.fromkeys(("time", "made", "sent", "read", "done"), light)
            found.append(Look(number=int(self.count), exposure=0.0, crop=0.0, estimate=0.0, bodies=(), **times))
        return found


def test_light_from_before_the_first_turn_is_no_latency():
    """It waited for the session to begin, however long that took."""
    scene, clock, now = seen_bead(), RealClock(), [0.0]
    clock.now = lambda: now[0]
    plant = Plant(plant_scene(scene, PlantOptions(seed=5)), seed=5, device="cpu")
    camera = SimulatedCamera(plant, Photographer(scene, rendering=QUICKLY, device="cpu"), rate=100.0)
    loop = closed_loop(scene, {0: PIECE}, Prompt(camera, estimator()), clock=clock)
    loop.start()
    twin = Simulation(scene, device="cpu", seed=1)
    counted = []
    for now[0] in (0.205, 0.213, 0.233):
        loop.update(twin, now[0], np.array([scene.traps[0].position.at(0.0)]), scene.traps[0].power.at(0.0))
        loop.published()
        counted.append((loop.frames, len(loop.latency)))
    assert counted == [(20, 0), (21, 1), (23, 3)]
    assert loop.latency.percentiles()["total"]["p99"] == pytest.approx(0.013, abs=3e-4)


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


def test_who_waits_for_a_look_is_woken_by_it(looker):
    """And by the end of the camera; nobody waits for what cannot come."""
    looker.open()
    scene, begun = seen_bead(), time.perf_counter()
    loop, twin = closed_loop(scene, looker.pieces, looker), Simulation(scene, device="cpu", seed=1)
    loop.start()
    place, power = scene.traps[0].position.at(0.0)[None], scene.traps[0].power.at(0.0)
    now = begun
    while not looker.await_look(now + 0.01):  # a laboratory exposes no further than it was commanded
        now = time.perf_counter()
        assert now - begun < PATIENCE
        loop.update(twin, now, place, power)
    assert looker.looks(now)
    looker._process.kill()
    while not looker._ended:
        looker.looks(begun)
        assert looker.await_look(begun + PATIENCE)
    assert not looker.await_look(begun + 1e6)
    assert time.perf_counter() - begun < PATIENCE
