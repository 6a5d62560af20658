"""From intensities to grey levels: photoelectrons, pixels that differ, what the sensor adds, and rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from otwarp.errors import InputError

NOISE = 2
"""Version of how grey levels follow from light and seed: 1 drew Poisson's and normal numbers in float64."""

MOST_WHOLE = 1e6
"""Electrons of full scale from which on 16 bits and float32 do not tell one of them from the next."""

FEW = 100.0
"""Mean photoelectrons below which their number is drawn from Poisson's distribution itself."""


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
        """Answer of each pixel over the mean, an array of a `shape`, by `seed`: the same for all images of a sensor."""
        if self.nonuniformity == 0.0:
            return np.ones(shape)
        return _sensitivities(self.nonuniformity, shape, seed)

    def levels(self, intensity: np.ndarray, *, seed: int = 0, image: int = 0) -> np.ndarray:
        """Grey levels of images (…, height, width) whose unhindered light is 1: uint8 up to eight bits, else uint16.

        Args:
            intensity: 0 or more.
            seed: Key of the noise and of the pixels' sensitivities.
            image: Another key of the noise alone: its number in a series from one sensor.
        """
        light = np.maximum(np.asarray(intensity, dtype=np.float32), np.float32(0.0))
        light *= np.float32(self.brightness)
        if self.nonuniformity:
            light *= self.sensitivities(light.shape[-2:], seed).astype(np.float32)
            np.maximum(light, np.float32(0.0), out=light)
        self._disturb(light, np.random.default_rng([seed, 0, image]))
        np.clip(light, 0.0, 1.0, out=light)
        if self.gamma != 1.0:
            np.power(light, np.float32(1.0 / self.gamma), out=light)
        light *= np.float32(2**self.bits - 1)
        return np.rint(light, out=light).astype(np.uint8 if self.bits <= 8 else np.uint16)

    def _disturb(self, light: np.ndarray, rng: np.random.Generator) -> None:
        """Add the noise of photoelectrons and of reading, in place.

        Both come of one normal number z for a pixel, which costs a quarter of drawing Poisson's: the sum of a Poisson
        number of mean λ and a normal one of variance σ² has the cumulants λ, v = λ + σ² and λ, and Cornish and
        Fisher's expansion λ + √v z + λ (z² − 1)/(6 v) has the same up to order 1/λ² (1938, doi:10.2307/1400905). Where
        λ is below `FEW` Poisson's numbers themselves are drawn.
        """
        if not self.noise and math.isinf(self.electrons):
            return
        normal = rng.standard_normal(light.shape, dtype=np.float32)
        step = 1.0 / self.electrons  # of an electron, relative to full scale; 0 for very many
        if not step:
            light += np.multiply(normal, np.float32(self.noise), out=normal)
            return
        few = light < FEW * step
        dim = light[few].astype(float)
        dark = rng.poisson(dim * self.electrons) * step + self.noise * normal[few] if dim.size else None
        variance = light * np.float32(step)
        skew = variance * np.float32(step / 6.0)
        variance += np.float32(self.noise**2)
        # without light and noise there is no variance; such pixels are among the few
        np.maximum(variance, np.float32(1e-30), out=variance)
        skew /= variance
        light += np.multiply(np.sqrt(variance, out=variance), normal, out=variance)
        np.multiply(normal, normal, out=normal)
        normal -= np.float32(1.0)
        light += np.multiply(normal, skew, out=normal)
        if not self.noise and self.electrons < MOST_WHOLE:  # nothing hides that electrons are whole
            light[...] = np.rint(light * np.float32(self.electrons)) * np.float32(step)
        if dark is not None:
            light[few] = dark


@lru_cache(maxsize=8)
def _sensitivities(deviation: float, shape: tuple[int, int], seed: int) -> np.ndarray:
    found = 1.0 + deviation * np.random.default_rng([seed, 1]).standard_normal(shape)
    found.flags.writeable = False
    return found
