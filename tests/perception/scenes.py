"""A bead in the trap of the right hand, its laboratory, and a session that sees it, all on one virtual clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from otwarp.perception.assemble import SeeingOptions, closed_loop, estimator_of, see
from otwarp.perception.closed_loop import ClosedLoop
from otwarp.perception.estimator import Estimator
from otwarp.perception.followed import LostRule
from otwarp.perception.looker import DirectLooker
from otwarp.perception.photographer import Photographer
from otwarp.perception.plant import Plant, PlantOptions, plant_scene
from otwarp.perception.simulated import SimulatedCamera
from otwarp.scene import Camera, Scene
from otwarp.teleop.operators.servo import LinkedClock
from otwarp.vision.rendering import Rendering
from tests.teleop.scenes import bead, three_beads, trap
from tests.teleop.session.stage import Stage

QUICKLY = Rendering(rings=1, thickness=0.5, margin=1.0)
PIECE = 32
TOP = Camera(
    prim="/World/top", pixel_size=0.13, numerical_aperture=1.0, condenser_aperture=0.3, focus=5.0, frame=(40.0, 20.0)
)
QUICK_RAMP = {"hands": [{"name": "right", "safety": {"ramp_time": 0.1}}]}
SIZE = (307, 153)
"""Pixels of its frame."""


@cache
def seen_bead() -> Scene:
    """The bead of the right hand, its trap, and the camera `top`."""
    whole = three_beads(brownian=True, camera=TOP)
    settings = replace(whole.settings, time_step=None)
    return replace(whole, bodies=(bead("right"),), traps=(trap("right"),), settings=settings)


@cache
def estimator() -> Estimator:
    """Templates of the bead."""
    options = SeeingOptions(rendering=QUICKLY, piece=PIECE, device="cpu")
    return estimator_of(seen_bead(), see(seen_bead(), options))


class Lab:
    """A session of the bead that is fed by images of a plant.

    Args:
        delay: From light to measurement [s].
        rate: Exposures per second.
        plant: By what the laboratory differs.
        wrap: Puts something around the camera.
        look: Another estimator.
        rule: When the bead is lost.
        scene: The bead; None: `seen_bead`.
        seeing: For recordings.
        device: Of the right hand.
    """

    def __init__(
        self,
        *,
        delay: float = 0.02,
        rate: float = 100.0,
        plant: PlantOptions | None = None,
        wrap: Callable[[SimulatedCamera], Any] = lambda camera: camera,
        look: Estimator | None = None,
        rule: LostRule | None = None,
        scene: Scene | None = None,
        seeing: SeeingOptions | None = None,
        device: str = "virtual:line,from=0/0/0,to=0.05/0/0,duration=2,mass=0",
    ):
        scene, options = scene or seen_bead(), plant or PlantOptions(seed=5)
        self.clock = LinkedClock()
        there = Plant(plant_scene(scene, options), seed=options.seed, device="cpu")
        self.camera = SimulatedCamera(there, Photographer(scene, rendering=QUICKLY, device="cpu", seed=2), rate=rate)
        looker = DirectLooker(wrap(self.camera), look or estimator(), delay=delay)
        self.perception: ClosedLoop = closed_loop(scene, {0: PIECE}, looker, rule=rule, seeing=seeing, clock=self.clock)
        self.stage = Stage(
            scene, clock=self.clock, options={"perception": self.perception}, config=QUICK_RAMP, right=device
        )
        self.stage.loop.start(arm=True)

    @property
    def plant(self) -> Plant:
        """The laboratory."""
        return self.camera.plant

    def run(self, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """After each turn of the loop, (n, 3): where twin and plant have the bead [µm], and the force sent [N]."""
        twin, truth, force = [], [], []
        for _ in range(turns):
            live = self.stage.run(1.0 / 120.0)
            twin.append(live.frame.position[0, 0])
            truth.append(self.plant.poses()[0][0])
            force.append(live.hands[0].force)
        return np.array(twin), np.array(truth), np.array(force)

    @property
    def state(self) -> str:
        """Of the hand."""
        now = self.stage.loop.hands.frames[0].now
        return now.state if now is not None else ""

    def close(self) -> None:
        """End the session."""
        self.stage.loop.close()
