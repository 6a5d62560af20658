"""Scripts for Hold and Orient: a power, or a spacing, that follows what is seen."""

from __future__ import annotations

import numpy as np

from otwarp.envs.experts.policies import Seen

MOST_POWER = 1.2
"""Of the trap of Hold, at 1 of its action; at -1 there is none [mW]."""
SPEED_LIMIT = 2.0
"""What 1 stands for in an action of Orient [µm/s]."""

POWERS = (8.0, 32.0)
"""Of a trap of Orient by strategy B, at -1 and 1 of its action [mW]."""


class ConstantPower:
    """The same power whatever the stream does.

    Args:
        power: Of the trap of Hold [mW].
    """

    def __init__(self, power: float):
        self.power = power

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 1) actions."""
        return np.full((len(fresh), 1), 2.0 * self.power / MOST_POWER - 1.0)


class PowerServo:
    """As much power as lets the robot hang `wanted` off the trap: its force grows with both.

    Args:
        wanted: Distance from the trap [µm]; the force is largest at 2.8, and thermal motion goes 0.2 to 0.4 beyond.
        margin: Power that is kept at least [mW].
    """

    MEMORY = 0.9
    """Share of the last estimate that is kept in each period: thermal motion is averaged away."""

    def __init__(self, wanted: float = 2.1, margin: float = 0.1):
        self.wanted, self.margin = wanted, margin
        self._need = np.zeros(0)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 1) actions."""
        away = np.sqrt(sum(seen[f"trap_offset.{axis}"] ** 2 for axis in "xyz"))
        asked = seen["trap_power"] * away / self.wanted
        if self._need.shape != asked.shape:
            self._need = np.full_like(asked, 0.5 * MOST_POWER)
        self._need[fresh] = 0.5 * MOST_POWER
        # a robot that drifts off is answered at once, calm by and by
        mean = self.MEMORY * self._need + (1.0 - self.MEMORY) * asked
        self._need = np.maximum(np.where(away > self.wanted, np.maximum(asked, mean), mean), self.margin)
        return np.clip(2.0 * self._need / MOST_POWER - 1.0, -1.0, 1.0)[:, None]


class SpacingServo:
    """Both traps move together or apart until the end of the pair is as high as is wanted.

    Args:
        gain: Speed of each trap over the error of the height [1/s].
    """

    def __init__(self, gain: float = 1.5):
        self.gain = gain

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 2) actions: of the left trap and the right one; a pair in wider traps lies flatter."""
        speed = self.gain * (seen["raised"] - seen["wanted_rise"])
        return np.clip(np.stack([-speed, speed], axis=1) / SPEED_LIMIT, -1.0, 1.0)


class TiltServo:
    """The trap of the end that is to rise is made the weaker one and both close quickly; then their distance is served.

    Args:
        gain: Speed of each trap over the error of the height [1/s].
        share: Part of the range of powers by which they are unequal.
    """

    FLAT, NEAR = 0.17, 0.3
    """Height of the right end while the robot is flat; how much nearer to it counts as not tilted [µm]."""
    CLOSED, OPEN, ANSWER = 7.8, 9.3, 10.0
    """Distances of the traps at which a robot does not stay flat, and at which it does [µm]; speed over what is missing
    of one of them [1/s]."""

    def __init__(self, gain: float = 2.0, share: float = 0.7):
        self.gain, self.share = gain, share

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 4) actions: along y and power of the left trap and of the right one, which is at lower y."""
        side = np.where(seen["wanted_rise"] > self.FLAT, 1.0, -1.0)
        tilt, wanted = side * (seen["raised"] - self.FLAT), side * (seen["wanted_rise"] - self.FLAT)
        # a robot that has turned the other way is laid flat first
        target = np.where(tilt < -self.NEAR, self.OPEN, self.CLOSED)
        missing = self.ANSWER * (np.abs(seen["trap_spread.y"]) - target)
        flat = (tilt < self.NEAR) & (wanted > self.NEAR)
        speed = np.where(flat, missing, self.gain * (wanted - tilt)) / SPEED_LIMIT
        power = self.share * side
        return np.clip(np.stack([-speed, power, speed, -power], axis=1), -1.0, 1.0)
