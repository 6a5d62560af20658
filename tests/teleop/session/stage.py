"""The live loop with real hands, chains and simulation, all on one virtual clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from otwarp import teleop as c
from otwarp.haptics.core.config import HapticsConfig
from otwarp.scene import Scene
from otwarp.teleop import LiveFrame
from otwarp.teleop.operators import plan_hands
from otwarp.teleop.operators.servo import LinkedClock, VirtualServo
from otwarp.teleop.session.live import LiveLoop
from tests.teleop.scenes import three_beads

RATE = 120.0


class Watcher:
    """An sink that keeps all frames and asks what it is told to."""

    interval = 0.0

    def __init__(self) -> None:
        self.frames: list[LiveFrame] = []
        self.asked: list[c.Command] = []
        self.lines: list[str] = []
        self.closed = False

    def publish(self, live: LiveFrame) -> None:
        self.frames.append(live)

    def commands(self) -> Sequence[c.Command]:
        asked, self.asked = self.asked, []
        return asked

    def complain(self, line: str) -> None:
        self.lines.append(line)

    def close(self) -> None:
        self.closed = True


class Stage:
    """A loop, its servo and a watcher.

    Args:
        scene: None for three beads.
        watch: Whether there is a watcher.
        config: Of the hands, None for the presets.
        options: Of the loop.
        clock: None for one of its own.
        devices: Hand → device.
    """

    def __init__(
        self,
        scene: Scene | None = None,
        *,
        watch: bool = True,
        config: HapticsConfig | dict[str, Any] | None = None,
        options: dict[str, Any] | None = None,
        clock: LinkedClock | None = None,
        **devices: str,
    ):
        scene = scene or three_beads()
        self.clock, self.watcher = clock or LinkedClock(), Watcher()
        self.plans = plan_hands(scene, devices, config=config, force_gain=0.02)
        self.servo: VirtualServo | None = None
        self.news: list[str] = []

        def make_servo(plans, local):
            self.servo = VirtualServo(self.clock, plans, local, len(scene.traps))
            return self.servo

        self.loop = LiveLoop(
            scene,
            self.plans,
            sinks=(self.watcher,) if watch else (),
            make_servo=make_servo,
            notice=self.news.append,
            clock=self.clock,
            device="cpu",
            **{"rate": RATE, **(options or {})},
        )

    def run(self, seconds: float) -> LiveFrame:
        """Ticks for so long; the last frame."""
        live = None
        for _ in range(round(seconds * RATE)):
            live = self.loop.tick()
            self.clock.sleep_until(self.clock.now() + 1.0 / RATE)
        assert live is not None
        return live


def place(live: LiveFrame, body: int) -> np.ndarray:
    return live.frame.position[0, body]
