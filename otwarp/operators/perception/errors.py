"""What stands between a scene and what a SIMULATED operator is given of it: delay, frame rate, errors of a pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from otwarp.errors import InputError
from otwarp.operators.kernels.perception import PerceptionRow
from otwarp.operators.loop import FRAME_RATE

LONGEST_DELAY = 1.0
"""Longest delay from a picture to the chain [s]; pictures have been taken for so long before the start."""
EYES = ("microscope", "twin")
"""What an operator looks at: the scene without delay, or the estimate that the chain gets, as late and as wrong."""


@dataclass(frozen=True, kw_only=True)
class Perception:
    """Errors of an estimator, and its delay. As made, none: the chain gets each picture as it is, at once.

    Errors are normally distributed, in every picture and of every robot anew, and independent of each other.

    Attributes:
        delay: From a picture to the servo's chain [s], to whole servo periods.
        frame_rate: Pictures per second.
        depth_error: Standard deviation along z, the optical axis [µm].
        lateral_error: Along x and along y [µm].
        tilt_error: Of the turn about x, out of the plane [°]; it is about the middle of a robot's trapped spheres.
        yaw_error: Of the turn about z [°].
        correlation: Time in which errors are forgotten, to 1/e [s]; 0 for pictures that know nothing of each other.
        depth_bias, lateral_bias: Added to z, and to x, of every robot in every picture [µm].
        tilt_bias: Added to the tilt [°].
        lost: Part of the pictures of which no estimate is made.
        stamped: Whether an estimate has the traps of its picture with it; else the traps of now are put beside it, as
            where nobody notes when a picture was taken.
        eyes: A name of `EYES`.
        eyes_delay: Until the operator sees a picture, beside the delay of eye and hand [s]; None for what goes with
            `eyes`: `delay`, or 0 for a microscope. Operators know it, and correct no more often than before.

    Raises:
        InputError: A value out of range.
    """

    delay: float = 0.0
    frame_rate: float = FRAME_RATE
    depth_error: float = 0.0
    lateral_error: float = 0.0
    tilt_error: float = 0.0
    yaw_error: float = 0.0
    correlation: float = 0.0
    depth_bias: float = 0.0
    lateral_bias: float = 0.0
    tilt_bias: float = 0.0
    lost: float = 0.0
    stamped: bool = True
    eyes: str = "microscope"
    eyes_delay: float | None = None

    def __post_init__(self) -> None:
        ranges = {"delay": (0.0, LONGEST_DELAY, "s"), "frame_rate": (1.0, 20_000.0, "Hz"), "lost": (0.0, 0.99, "")}
        ranges |= dict.fromkeys(("depth_error", "lateral_error"), (0.0, 100.0, "µm"))
        ranges |= dict.fromkeys(("depth_bias", "lateral_bias"), (-100.0, 100.0, "µm"))
        ranges |= dict.fromkeys(("tilt_error", "yaw_error"), (0.0, 180.0, "°")) | {"tilt_bias": (-180.0, 180.0, "°")}
        ranges |= {"correlation": (0.0, 1e4, "s")}
        ranges |= {} if self.eyes_delay is None else {"eyes_delay": (0.0, LONGEST_DELAY, "s")}
        for name, (low, high, unit) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"{name} is {value!r}; allowed: {low:g} to {high:g} {unit}".rstrip())
        if self.eyes not in EYES:
            raise InputError(f"eyes is {self.eyes!r}; allowed: {', '.join(EYES)}")

    @property
    def exact(self) -> bool:
        """Whether estimates have no errors."""
        return not any(getattr(self, f.name) for f in fields(self) if f.name.endswith(("_error", "_bias")))

    @property
    def display_delay(self) -> float:
        """Until the operator sees a picture [s]."""
        if self.eyes_delay is not None:
            return self.eyes_delay
        return self.delay if self.eyes == "twin" else 0.0


def perception_rows(perceptions: Sequence[Perception], number: np.ndarray, rate: float) -> np.ndarray:
    """(W) structs `PerceptionRow`.

    Args:
        perceptions: (W) of the worlds.
        number: (W) keys of their random numbers: the operators'.
        rate: Of the servo [1/s].

    Raises:
        InputError: More pictures than servo periods.
    """
    out = np.zeros(len(perceptions), dtype=np.dtype(PerceptionRow.numpy_dtype()))  # type: ignore[arg-type]
    out["number"] = number
    for row, p in zip(out, perceptions, strict=True):
        if p.frame_rate > rate:
            raise InputError(f"frame rate is {p.frame_rate:g}; allowed: 1 to the servo's, {rate:g} Hz")
        row["delay"] = round(p.delay * rate)
        row["frame_rate"] = p.frame_rate
        row["keep"] = np.exp(-1.0 / (p.frame_rate * p.correlation)) if p.correlation > 0.0 else 0.0
        angles = np.deg2rad([p.tilt_error, p.yaw_error])
        row["deviation"] = [p.lateral_error, p.lateral_error, p.depth_error, *angles]
        row["bias"] = [p.lateral_bias, 0.0, p.depth_bias, np.deg2rad(p.tilt_bias), 0.0]
        row["lost"] = p.lost
        row["exact"], row["stamped"], row["twin"] = p.exact, p.stamped, p.eyes == "twin"
    return out
