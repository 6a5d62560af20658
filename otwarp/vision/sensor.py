"""From intensities to grey levels: photoelectrons, pixels that differ, what the sensor adds, and rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A camera's sensor, linear up to its full scale.

    Attributes:
        brightness: Of unhindered light, relative to full scale.
        electrons: Photoelectrons of full scale, whose number is Poisson's; inf for none of that noise.
        noise: Standard deviation of what reading adds, relative to full scale.
        nonuniformity: Standard deviation of the pixels' sensitivities, which stay as they are.
        bits: Of a grey level.
        gamma: A level is the light to the power 1/gamma.

    Raises:
        InputError: A number out of its range.
    """

    brightness: float = 0.35
    electrons: float = 10000.0
    noise: float = 0.01
    nonuniformity: float = 0.0
    bits: int = 8
    gamma: float = 1.0

    def __post_init__(self) -> None:
        limits = {"brightness": 1.0, "electrons": math.inf, "gamma": 10.0}
        for name, high in limits.items():
            if not 0.0 < getattr(self, name) <= high:
                raise InputError(f"{name} of the sensor is {getattr(self, name):g}; allowed: above 0, up to {high:g}")
        for name in ("noise", "nonuniformity"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name} of the sensor is {getattr(self, name):g}; allowed: 0 to 1")
        if not 1 <= self.bits <= 16:
            raise InputError(f"bits of the sensor is {self.bits}; allowed: 1 to 16")

    def sensitivities(self, shape: tuple[int, int], seed: int) -> np.ndarray:
        """(height, width) how much more than the mean each pixel answers; the same for all images of a sensor."""
        if self.nonuniformity == 0.0:
            return np.ones(shape)
        return 1.0 + self.nonuniformity * np.random.default_rng([seed, 1]).standard_normal(shape)

    def levels(self, intensity: np.ndarray, *, seed: int = 0, image: int = 0) -> np.ndarray:
        """Grey levels of images (…, height, width) whose unhindered light is 1: uint8 up to eight bits, else uint16.

        Args:
            intensity: 0 or more.
            seed: Key of the noise and of the pixels' sensitivities.
            image: Another key of the noise alone: its number in a series from one sensor.
        """
        light = self.brightness * np.maximum(np.asarray(intensity, dtype=float), 0.0)
        light = light * self.sensitivities(light.shape[-2:], seed)
        rng = np.random.default_rng([seed, 0, image])
        if math.isfinite(self.electrons):
            light = rng.poisson(np.maximum(light, 0.0) * self.electrons) / self.electrons
        if self.noise:
            light = light + self.noise * rng.standard_normal(light.shape)
        top = 2**self.bits - 1
        found = np.rint(top * np.clip(light, 0.0, 1.0) ** (1.0 / self.gamma))
        return found.astype(np.uint8 if self.bits <= 8 else np.uint16)
