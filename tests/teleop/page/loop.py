"""A live loop for tests: a real simulation, steered by an sink's commands as fast as the test asks."""

from __future__ import annotations

import numpy as np

import otwarp as ot
from otwarp.simulation.frame import capture_frame
from otwarp.teleop import HandFrame, LiveFrame, MoveTraps, PaceNow, Pause, SetPower


class Loop:
    """Steps a scene and keeps what was asked.

    Args:
        scene: One world of it is stepped.
        speed: Fastest that a trap may move [µm/s]; farther than it reaches at once it would lose what it holds.
    """

    def __init__(self, scene: ot.Scene, *, speed: float = 30.0, device: str = "cpu"):
        self.sim = ot.Simulation(scene, device=device, seed=1, threads=1)
        self.targets = np.array([trap.position.at(0.0) for trap in scene.traps])
        self.places = self.targets.copy()
        self.asked: list[object] = []
        self.hands: tuple[HandFrame, ...] = ()
        self.warnings: tuple[str, ...] = ()
        self.paused = False
        self.beat, self._speed = 0, speed

    def obey(self, commands: object) -> None:
        for command in commands:  # type: ignore[attr-defined]
            self.asked.append(command)
            if isinstance(command, MoveTraps):
                for k, position in command.positions.items():
                    self.targets[k] = position
            elif isinstance(command, Pause):
                self.paused = command.on
            elif isinstance(command, SetPower):
                power = np.array([trap.power.at(0.0)[0] for trap in self.sim.scene.traps])
                power[list(command.traps) or slice(None)] = command.power
                self.sim.control.set(trap_power=power)

    def advance(self, seconds: float) -> None:
        if not self.paused:
            way = self.targets - self.places
            length = np.linalg.norm(way, axis=1, keepdims=True)
            step = np.minimum(length, self._speed * seconds)
            self.places = self.places + way * step / np.maximum(length, 1e-12)
            self.sim.control.set(trap_position=self.places)
            self.sim.run(seconds)
        self.beat += 1

    def frame(self) -> LiveFrame:
        frame = capture_frame(self.sim)
        force = np.zeros((2, 3))
        for k, trap in enumerate(self.sim.scene.traps):
            if trap.hand != "none":
                force[("left", "right").index(trap.hand)] += frame.trap_force[0, k]
        return LiveFrame(
            beat=self.beat,
            wall=self.sim.time,
            frame=frame,
            hand_force=force,
            hands=self.hands,
            pace=PaceNow(paused=self.paused),
            warnings=self.warnings,
        )
