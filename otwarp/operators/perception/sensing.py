"""Pictures, estimates and delays between states and simulated operators' servo chains, on the device: `Sensing`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from otwarp.operators.chain import ChainBatch, zeros
from otwarp.operators.kernels import perception
from otwarp.operators.kernels.perception import PerceptionData, PerceptionRow, ServedData, TruthData
from otwarp.operators.perception.errors import LONGEST_DELAY


class Sensing:
    """Between the state as it is and the chains of W worlds.

    Args:
        chain: What gets estimates.
        truth: Chains whose arrays `sphere`, `trap` and `power` have the state as it is.
        rows: (W) structs of `errors.perception_rows`.
        robot: (S) robot of each sphere, from 0 on.
        seed: Key of the random numbers.
        rate: Of the servo [1/s].
        eyes: `SightData` of the state as it is, and what the operators see of it.
        held, point: (T) sphere that a hand's trap holds, −1 for none, and (T, 3) where it holds it, from
            its focus [µm].
        eye_rate: Pictures a second for eyes at a microscope.
    """

    def __init__(
        self,
        chain: ChainBatch,
        truth: ChainBatch,
        rows: np.ndarray,
        robot: np.ndarray,
        *,
        seed: int,
        rate: float,
        eyes: tuple[Any, Any],
        held: np.ndarray,
        point: np.ndarray,
        eye_rate: float,
    ):
        self.chain, self.device = chain, chain.device
        self.truth = TruthData()
        self.truth.sphere, self.truth.trap, self.truth.power = truth.sphere, truth.trap, truth.power
        self.truth.sight, self.sight = eyes
        self.served = ServedData()
        self.served.sphere, self.served.trap, self.served.power = chain.sphere, chain.trap, chain.power
        self.served.time, self.served.now = (zeros((len(rows),), wp.float64, self.device) for _ in range(2))
        self.served.fresh = zeros((len(rows),), wp.bool, self.device)
        self.data = self._data(rows, robot, held, point, rate)
        self.data.seed, self.data.rate, self.data.eye_rate, self.data.before = seed, rate, eye_rate, LONGEST_DELAY

    def _data(self, rows: np.ndarray, robot: np.ndarray, held: np.ndarray, point: np.ndarray, rate: float) -> Any:
        """What pictures are made with, and room for estimates under way."""
        worlds, spheres, traps = len(rows), len(robot), len(held)
        # an estimate waits `delay`, and a period more at most; one comes every rate/frame_rate periods
        places = int(np.ceil(np.max((rows["delay"] + 1) * rows["frame_rate"]) / rate)) + 2
        data, device = PerceptionData(), self.device
        data.robots = int(robot.max()) + 1
        data.robot = wp.array(robot, dtype=wp.int32, device=device)
        data.held = wp.array(held, dtype=wp.int32, device=device)
        data.point = wp.array(point, dtype=wp.vec3d, device=device)
        data.rows = wp.array(rows, dtype=PerceptionRow, device=device)
        shapes: Mapping[str, tuple[int, ...]] = {
            **dict.fromkeys(("now", "frame", "eye_frame", "taken", "served"), (worlds,)),
            "error": (worlds, data.robots),
            "tick": (worlds, places),
            "sphere": (worlds, places, spheres),
            **dict.fromkeys(("trap", "power"), (worlds, places, traps)),
        }
        for name, shape in shapes.items():
            setattr(data, name, zeros(shape, PerceptionData.vars[name].type.dtype, device))
        return data

    def begin(self) -> None:
        """Give the chains what they get at the start, of a scene that stood still before."""
        self._launch(perception.begin_perception, self.data, self.truth, self.served, self.sight)

    def period(self, done: wp.array) -> None:
        """The end of a servo period, of worlds that are not `done`, (W) int32."""
        self._launch(perception.perceive, self.data, self.truth, self.served, self.sight, done)

    def _launch(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(kernel, dim=len(self.data.rows), inputs=inputs, device=self.device)
        self.chain.refresh(self.served.time, self.served.fresh)
