"""A small signal chain for tests of the servo: a spring to the first sphere, a ramp, a slew limit and a watchdog."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from otwarp.haptics.core import ZERO, DeviceInfo, DeviceSample, SceneFrame, ServoFrame

STIFFNESS = 100.0
"""N/m; 1 µm of scene is 1 mm of hand."""
SLEW = 200.0
"""N/s."""
DECAY, DISARM, RAMP = 0.02, 0.1, 0.05


class SpringChain:
    def __init__(self, info: DeviceInfo):
        self.info = info
        self.phase = "disarmed"
        self.force = ZERO
        self.gain = 0.0
        self.wanted, self.complaint = False, ""
        self.beat, self.heard, self.time, self.tick = 0, 0.0, 0.0, 0

    asked = moved = ZERO
    gains = (None, None)

    heat = 0.0
    account = (0.0, -1e-4, 1e-4, 1e-3)

    def set_gains(self, motion_gain=None, force_gain=None) -> None:
        self.gains = (motion_gain, force_gain)

    def state(self, scene):
        return {"force": self.force, "phase": self.phase, "gain": self.gain}

    def restore(self, state):
        self.force, self.phase, self.gain = tuple(state["force"]), state["phase"], state["gain"]
        self.wanted = self.phase in ("ramping", "armed")

    def arm(self) -> None:
        self.wanted, self.complaint = True, ""
        self.phase, self.gain, self.heard = "ramping", 0.0, self.time

    def disarm(self) -> None:
        self.wanted = False
        if self.phase != "disarmed":
            self.phase = "decaying"

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame:
        self.tick += 1
        dt, self.time = (sample.time - self.time if self.tick > 1 else 0.001), sample.time
        if scene.beat != self.beat:
            self.beat, self.heard = scene.beat, sample.time
        age = sample.time - self.heard
        if age >= DISARM:
            if self.wanted:
                self.wanted, self.complaint = False, "nothing new from the simulation"
            self.phase = "disarmed"
        elif self.wanted:  # a state in between ramps it in again, as `Safety` does
            self.phase = "decaying" if age >= DECAY else "armed" if self.gain == 1.0 else "ramping"
        rate = {"ramping": 1.0 / RAMP, "armed": 1.0 / RAMP, "decaying": -1.0 / (0.7 * (DISARM - DECAY))}
        self.gain = min(1.0, max(0.0, self.gain + rate.get(self.phase, -math.inf) * dt))
        if self.phase == "ramping" and self.gain == 1.0:
            self.phase = "armed"
        if self.phase == "decaying" and self.gain == 0.0 and not self.wanted:
            self.phase = "disarmed"
        centre = scene.spheres[0].position if scene.spheres else ZERO
        force = []
        for x, c, f in zip(sample.position, centre, self.force, strict=True):
            wish = -self.gain * STIFFNESS * (x - 1e-3 * c)
            force.append(f + max(-SLEW * dt, min(SLEW * dt, wish - f)))
        self.force = (force[0], force[1], force[2])
        trap = (1e3 * sample.position[0], 1e3 * sample.position[1], 1e3 * sample.position[2])
        traps = ((0, trap),)
        return ServoFrame(self.tick, sample.time, sample.position, self.force, traps, self.phase, 0.0, sample.buttons)


class TellingChain(SpringChain):
    """Writes down what its process has loaded."""

    def __init__(self, file: str, info: DeviceInfo):
        super().__init__(info)
        self.file = file

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame:
        if self.tick == 20:
            part = Path(self.file + ".part")
            part.write_text("\n".join(sorted(sys.modules)))
            part.rename(self.file)
        return super().step(sample, scene)
