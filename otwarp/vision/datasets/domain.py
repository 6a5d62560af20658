"""What may vary in a data set: each parameter with its unit, and how often it is drawn; ranges, and draws from them."""

from __future__ import annotations

import math
import sys
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError

Scope = Literal["robot", "pose", "image"]


@dataclass(frozen=True)
class Parameter:
    """Something that images depend on.

    Attributes:
        scope: Drawn for every robot, for every pose (light passes anew), or for every image (which costs nothing).
        units: Of its label.
        about: What it is.
        low, high: What is allowed; the microscope and the sensor may allow less.
    """

    scope: Scope
    units: str
    about: str
    low: float = 0.0
    high: float = math.inf


PARAMETERS: Mapping[str, Parameter] = {
    "radius_scale": Parameter("robot", "1", "all radii of the robot over those given", 0.1, 10.0),
    "length_scale": Parameter("robot", "1", "all distances of its solids over those given", 0.1, 10.0),
    "index": Parameter("robot", "1", "refractive index of all solids of the robot", 1.0, 4.0),
    "yaw": Parameter("pose", "deg", "azimuth of the long axis in the image", -360.0, 360.0),
    "roll": Parameter("pose", "deg", "turn about the long axis", -360.0, 360.0),
    "wavelength": Parameter("pose", "um", "of the light in vacuum", 0.1, 10.0),
    "condenser_aperture": Parameter("pose", "1", "numerical aperture of the condenser", 0.0, 1.7),
    "condenser_x": Parameter("pose", "1", "numerical aperture by which the condenser is off the axis", -1.0, 1.0),
    "condenser_y": Parameter("pose", "1", "the same, upwards", -1.0, 1.0),
    "illumination_curvature": Parameter("pose", "1/um", "of waves from a condenser out of focus", -0.02, 0.02),
    "medium_index": Parameter("pose", "1", "refractive index of the liquid", 1.0, 2.0),
    "azimuth": Parameter("pose", "deg", "turn of the source points about the axis of light", -360.0, 360.0),
    "x": Parameter("image", "um", "centre of the robot from that of the middle pixel, to the right", -1e3, 1e3),
    "y": Parameter("image", "um", "centre of the robot from that of the middle pixel, upwards", -1e3, 1e3),
    "numerical_aperture": Parameter("image", "1", "of the objective", 0.01, 1.7),
    "glass_depth": Parameter("image", "um", "of the focal plane below the cover glass, nominal", 0.0, 1e3),
    "defocus": Parameter("image", "wavelength", "root mean square of Zernike's polynomial 4", -10.0, 10.0),
    "astigmatism": Parameter("image", "wavelength", "root mean square of Zernike's polynomial 6", -10.0, 10.0),
    "coma": Parameter("image", "wavelength", "root mean square of Zernike's polynomial 8", -10.0, 10.0),
    "spherical": Parameter("image", "wavelength", "root mean square of Zernike's polynomial 11", -10.0, 10.0),
    "brightness": Parameter("image", "1", "of unhindered light, relative to full scale", 0.0, 1.0),
    "electrons": Parameter("image", "1", "photoelectrons of full scale", 1.0, 1e9),
    "noise": Parameter("image", "1", "standard deviation of reading, relative to full scale", 0.0, 1.0),
    "gamma": Parameter("image", "1", "a level is the light to the power 1/gamma", 0.0, 10.0),
}
"""Names of [domain] in a file of a data set, and of the labels that stand for them."""


@dataclass(frozen=True)
class Range:
    """A uniform distribution, or a choice of values.

    Attributes:
        low, high: Ends, equal for what does not vary.
        values: Each as likely; empty for a range.
    """

    low: float
    high: float
    values: tuple[float, ...] = ()

    @property
    def varies(self) -> bool:
        """Whether draws differ."""
        return self.high > self.low

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count) values."""
        if self.values:
            return np.asarray(self.values)[rng.integers(len(self.values), size=count)]
        return self.low + (self.high - self.low) * rng.random(count)


def range_of(given: Any, name: str) -> Range:
    """A number, `{ from = 0, to = 1 }` or `{ values = [1, 2] }`.

    Raises:
        InputError: Something else.
    """
    if isinstance(given, Mapping) and set(given) == {"from", "to"}:
        low, high = number(given["from"], f"{name}, from,"), number(given["to"], f"{name}, to,")
        if high < low:
            raise InputError(f"{name} goes from {low:g} to {high:g}; allowed: from the smaller to the larger")
        return Range(low, high)
    if isinstance(given, Mapping) and set(given) == {"values"} and isinstance(given["values"], list):
        values = tuple(number(v, name) for v in given["values"])
        if values:
            return Range(min(values), max(values), values)
    if isinstance(given, Mapping):
        raise InputError(f"{name} is {dict(given)}; allowed: a number, {{ from = …, to = … }} or {{ values = [ … ] }}")
    value = number(given, name)
    return Range(value, value)


def number(given: Any, name: str, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number in a range.

    Raises:
        InputError: None, or out of it.
    """
    if isinstance(given, bool) or not isinstance(given, int | float) or not abs(given) <= sys.float_info.max:
        raise InputError(f"{name} is {given!r}; allowed: a finite number")
    if not low <= given <= high:
        ends = f"{low:g} to {high:g}" if math.isfinite(high) else f"{low:g} or more"
        raise InputError(f"{name} is {given:g}; allowed: {ends}")
    return float(given)


def truth(given: Any, name: str) -> bool:
    """True or false.

    Raises:
        InputError: Neither.
    """
    if not isinstance(given, bool):
        raise InputError(f"{name} is {given!r}; allowed: true or false")
    return given


def whole(given: Any, name: str, low: int, high: int) -> int:
    """A whole number in a range.

    Raises:
        InputError: None, or out of it.
    """
    if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
        raise InputError(f"{name} is {given!r}; allowed: a whole number, {low} to {high}")
    return given


def domain_of(given: Mapping[str, Any]) -> dict[str, Range]:
    """The table [domain].

    Raises:
        InputError: Something that cannot vary, or out of its range.
    """
    found = {}
    for name, value in given.items():
        if name not in PARAMETERS:
            raise InputError(f"domain has {name}; allowed: {', '.join(PARAMETERS)}")
        found[name] = range_of(value, f"domain, {name},")
        for end in (found[name].low, found[name].high):
            number(end, f"domain, {name},", PARAMETERS[name].low, PARAMETERS[name].high)
    return found


def generator(seed: int, name: str) -> np.random.Generator:
    """Random numbers of one thing alone: what else varies does not change them."""
    return np.random.default_rng([seed, 2, zlib.crc32(name.encode())])
