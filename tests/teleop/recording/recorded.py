"""Sessions of a real servo process that are recorded: short, in wall time, with nothing asserted of it."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import HandConfig, HapticsConfig
from otwarp.haptics.force.law import ForceGrid, IsotropicLaw, Law, SplitLaw, TableLaw
from otwarp.haptics.servo.link import Cycles, HandSetup
from otwarp.haptics.servo.process import ServoProcess
from otwarp.scene import Scene
from otwarp.simulation.frame import SHAPES, Frame
from otwarp.teleop import HandFrame, LiveFrame
from otwarp.teleop.recording import RecordingWriter
from tests.haptics.setups import AXIAL, RADIAL

EVENTUALLY = 60.0
"""Seconds after which something that must happen is called missing."""


def table_law() -> TableLaw:
    """A made-up bilinear table of two levels that pulls towards the focus."""
    grids = []
    for spacing, radius in ((0.05, 0.5), (0.2, 2.0)):
        columns, rows = int(radius / spacing) + 4, int(2.0 * radius / spacing) + 4
        node = array("f")
        for j in range(rows):
            for i in range(columns):
                rho, z = (i - 1) * spacing, (j - 1) * spacing - radius
                fall = math.exp(-(rho * rho + z * z))
                node.extend((-rho * fall, 0.0, -0.3 * z * fall))
        grids.append(ForceGrid(spacing, radius, 0.98 * radius, columns, node))
    return TableLaw(tuple(grids), 1, False, 0.4)


LAWS: dict[str, Law] = {"isotropic": IsotropicLaw(RADIAL), "split": SplitLaw(RADIAL, AXIAL), "table": table_law()}


def scene_now(beat: int) -> SceneFrame:
    """Two traps at rest, each with spheres that wander about."""
    t = 0.008 * beat
    spheres = tuple(
        SphereFrame((2.0 * n + 0.3 * math.sin(3.0 * t + n), 0.2 * math.cos(5.0 * t), 0.1 * math.sin(t)), n)
        for n in range(2)
    )
    return SceneFrame(beat, t, spheres, tuple(TrapFrame(n, (2.0 * n, 0.0, 0.0), 20.0) for n in range(2)), 0.5)


def live_frame(beat: int, wall: float, hands: tuple[HandFrame, ...] = (), warnings: tuple[str, ...] = ()) -> LiveFrame:
    """A frame of two traps and no bodies."""
    count = {"body": 0, "trap": 2}
    shapes = {n: (1, count[axis], *((width,) if width else ())) for n, (axis, width) in SHAPES.items()}
    arrays = {name: np.full(shape, 0.25 * beat) for name, shape in shapes.items()}
    frame = Frame(step=beat, time=0.008 * beat, **arrays)
    return LiveFrame(beat=beat, wall=wall, frame=frame, hand_force=np.zeros((2, 3)), hands=hands, warnings=warnings)


class Session:
    """A servo, a simulation that publishes every few milliseconds, and a recording of both."""

    def __init__(self, scene: Scene, configs: dict[str, tuple[str, HandConfig]], law: Law, make=make_chain):
        self.scene, self.devices = scene, {name: device for name, (device, _) in configs.items()}
        self.config = HapticsConfig(hands=tuple(config for _, config in configs.values()))
        self.laws = {trap: (law,) for hand in self.config.hands for trap in hand.traps}
        setups = [
            HandSetup(device, partial(make, config, self.laws, ()), name=name)
            for name, (device, config) in configs.items()
        ]
        self.servo = ServoProcess(setups, spheres=2, traps=2)
        self.beat, self.recording, self.drained = 0, None, {name: b"" for name in configs}
        self.publishing = True

    def __enter__(self) -> Session:
        self.servo.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.servo.stop()
        if self.recording is not None:
            self.fetch()
            self.recording.close()

    def record(self, path: Path) -> RecordingWriter:
        about = {"config": self.config, "devices": self.devices, "laws": self.laws, "kinds": (), "scene": self.scene}
        self.recording = RecordingWriter(path, **about, settings={"seed": 3})
        self.servo.record(True)
        return self.recording

    def fetch(self) -> None:
        for n, name in enumerate(self.devices):
            cycles: Cycles = self.servo.drain(n)
            self.drained[name] += cycles.records
            self.recording.cycles(name, cycles)

    def frame(self) -> None:
        """One turn of the loop."""
        if self.publishing:
            self.beat += 1
            self.servo.publish(scene_now(self.beat))
        else:
            self.servo.heartbeat()
        if self.recording is not None:
            now = time.perf_counter()
            hands = []
            for n, hand in enumerate(self.config.hands):
                gains = {"motion_gain": hand.motion_gain, "force_gain": hand.force_gain}
                about = {"name": hand.name, "device": self.devices[hand.name], "traps": hand.traps, "clamp": 3.3}
                hands.append(HandFrame(**about, **gains, now=self.servo.hand(n), present=True))
            warnings = ("hand left: far",) if self.beat % 8 < 4 else ()
            self.recording.frame(live_frame(self.beat, now, tuple(hands), warnings), None)
            self.fetch()

    def run(self, seconds: float, until: Callable[[], bool] = lambda: True) -> None:
        """Frames for some time, and then until something is so."""
        begun = time.monotonic()
        while time.monotonic() < begun + seconds or not until():
            assert time.monotonic() < begun + EVENTUALLY, "did not happen"
            self.frame()
            time.sleep(0.004)

    def state(self, hand: int) -> str:
        now = self.servo.hand(hand)
        return now.state if now else ""

    def arm(self, hand: int = 0) -> None:
        """Armed, however long the machine takes; a busy one may let the watchdog act in between."""

        def pushes() -> bool:
            if self.state(hand) in ("disarmed", "fault"):
                self.servo.arm(hand)
            return self.state(hand) == "armed"

        self.run(0.0, pushes)
