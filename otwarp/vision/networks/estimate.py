"""What a network says of an image: where the robot is, how it lies, and how certain that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError

QUANTITIES = ("x", "y", "depth", "tilt", "yaw")
"""What an estimate has, in the order of its covariance: µm, µm, µm, rad, rad."""

ANGLES = ("tilt", "yaw")
"""Those that are angles [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Position and orientation of a robot relative to the middle of an image and its focal plane.

    Attributes:
        x, y: Centre of the robot from the middle pixel's centre [µm]; x right, y up.
        depth: Height of its centre above the focal plane, along the light [µm].
        tilt: Of its long axis out of the focal plane, up at its head [rad].
        yaw: Azimuth of its axis in the image plane, from x towards y [rad].
        covariance: (5, 5) of (x, y, depth, tilt, yaw) [µm, rad]. What a network does not estimate has infinite
            variance, no covariance, and the mean of the images that it was trained on as its value.

    Raises:
        InputError: A covariance of another shape.
    """

    x: float
    y: float
    depth: float
    tilt: float
    yaw: float
    covariance: np.ndarray

    def __post_init__(self) -> None:
        shape = np.shape(self.covariance)
        if shape != (len(QUANTITIES),) * 2:
            raise InputError(f"covariance of an estimate is an array of shape {shape}; allowed: (5, 5)")

    @property
    def mean(self) -> np.ndarray:
        """(5) x, y, depth, tilt, yaw [µm, µm, µm, rad, rad]."""
        return np.array([getattr(self, name) for name in QUANTITIES])

    @property
    def known(self) -> tuple[str, ...]:
        """Which of `QUANTITIES` were estimated."""
        return tuple(q for q, v in zip(QUANTITIES, np.diag(self.covariance), strict=True) if np.isfinite(v))

    @classmethod
    def of(
        cls, names: tuple[str, ...], values: np.ndarray, covariance: np.ndarray, others: dict[str, float]
    ) -> Estimate:
        """From some of the quantities.

        Args:
            names: Which, k of `QUANTITIES`.
            values: (k) [µm, rad].
            covariance: (k, k) of them.
            others: Value of each of the other quantities.
        """
        mean = {**others, **{name: float(v) for name, v in zip(names, values, strict=True)}}
        whole = np.diag(np.full(len(QUANTITIES), np.inf))
        where = [QUANTITIES.index(name) for name in names]
        whole[np.ix_(where, where)] = covariance
        return cls(covariance=whole, **mean)
