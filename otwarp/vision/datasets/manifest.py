"""What `manifest.json` of a data set must say, and the optics and sensor that it says."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Rendering
from otwarp.vision.sensor import Sensor

VERSION = 1
"""Of the layout of the folder."""

ATTRIBUTES = {
    "pose": ("1", "number of the rendered pose"),
    "robot": ("1", "number of the robot of the class"),
    "tilt": ("deg", "angle of the robot's long axis to the focal plane, positive towards where light goes"),
    "tilt_class": ("1", "index of the tilt among the manifest's classes, -1 for none"),
    "depth": ("um", "height of the robot's centre above the focal plane, along the light"),
    "depth_normalized": ("1", "depth between 0 and 1 of the focus sweep of its pose"),
}
"""Labels that are no parameters: units and meaning."""

Fits = Callable[[Any], bool]


def _counts(value: Any) -> bool:
    """Whether a value of JSON is a whole number above 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def _number(value: Any) -> bool:
    """Whether a value of JSON is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(value: Any) -> bool:
    """Whether a value of JSON is a list of numbers."""
    return isinstance(value, list) and all(map(_number, value))


def _place(value: Any) -> bool:
    """Whether a value of JSON is three numbers."""
    return _numbers(value) and len(value) == 3


def _texts(value: Any) -> bool:
    """Whether a value of JSON is a list of texts."""
    return isinstance(value, list) and all(isinstance(v, str) for v in value)


def _object(value: Any) -> bool:
    """Whether a value of JSON is an object."""
    return isinstance(value, dict)


def _truth(value: Any) -> bool:
    """Whether a value of JSON is true or false."""
    return isinstance(value, bool)


def _each(**inside: Fits) -> Fits:
    """Whether a value of JSON is a list of objects that have these entries."""

    def fits(value: Any) -> bool:
        """All of them."""
        good = isinstance(value, list) and all(map(_object, value))
        return good and all(test(v.get(name)) for v in value for name, test in inside.items())

    return fits


SHAPES: Mapping[str, Fits] = {
    "count": _counts,
    "poses": _counts,
    "chunk": _counts,
    "shape": lambda value: isinstance(value, list) and len(value) == 2 and all(map(_counts, value)),
    "labels": lambda value: _texts(value) and set(ATTRIBUTES) <= set(value),
    "splits_made": _texts,
    "classes": _numbers,
    "seed": lambda value: isinstance(value, int) and not isinstance(value, bool),
    **dict.fromkeys(("robot", "symmetry", "optics", "sensor", "rendering", "layout", "domain"), _object),
}
"""What a manifest must say: whether a value can be it."""

TABLES: Mapping[str, Mapping[str, Fits]] = {
    "robot": {
        "spheres": _each(center=_place, radius=_number, index=_number),
        "rods": _each(start=_place, end=_place, radius=_number, index=_number),
    },
    "symmetry": {
        **dict.fromkeys(("axial", "flip", "spherical"), _truth),
        "rotations": lambda value: isinstance(value, list) and all(
            isinstance(turn, list) and len(turn) == 3 and all(map(_place, turn)) for turn in value
        ),
    },
    "optics": {
        **dict.fromkeys(("numerical_aperture", "condenser_aperture", "wavelength", "medium_index", "pixel"), _number),
        "zernike": lambda value: _object(value) and all(n.isdecimal() and _number(v) for n, v in value.items()),
    },
    "sensor": {"bits": _counts},
    "layout": {
        **dict.fromkeys(("count", "width", "height"), _counts),
        "depth": lambda value: _numbers(value) and len(value) == 2,
    },
}  # fmt: skip
"""What its tables must say; optics and sensor have defaults for the rest."""

FIELDS: Mapping[str, type] = {"optics": Microscope, "sensor": Sensor, "rendering": Rendering}
"""Tables that say nothing but what these have."""


def check_manifest(said: Any, file: Path) -> None:
    """Refuse a manifest of another version, or one that says what cannot be.

    Args:
        said: What it says.
        file: Where, for the message.

    Raises:
        InputError: The first entry that is wrong or missing.
    """
    if not isinstance(said, dict) or said.get("version") != VERSION:
        version = said.get("version") if isinstance(said, dict) else None
        raise InputError(f"{file}: version = {version!r}; allowed: {VERSION}, as this otwarp writes it")
    for name, fits in SHAPES.items():
        _check(file, said, name, fits)
    for table, entries in TABLES.items():
        for name, fits in entries.items():
            _check(file, said[table], name, fits, f"{table}.")
    for table, kind in FIELDS.items():
        known = {field.name for field in dataclasses.fields(kind)}
        for name in said[table]:
            if name not in known:
                raise InputError(f"{file}: {table}.{name} is unknown; allowed: what otwarp vision dataset wrote")
    ranges = {name: [how] for name, how in said["domain"].items()}
    for name in ranges:
        _check(file, ranges, name, _each(low=_number, high=_number, values=_numbers), "domain.")
    if not said["robot"]["spheres"] and not said["robot"]["rods"]:
        raise InputError(f"{file}: robot has no solids; allowed: what otwarp vision dataset wrote")


def _check(file: Path, said: Mapping[str, Any], name: str, fits: Fits, table: str = "") -> None:
    if not fits(said.get(name)):
        raise InputError(f"{file}: {table}{name} = {said.get(name)!r:.60}; allowed: what otwarp vision dataset wrote")


def microscope_in(manifest: Mapping[str, Any]) -> Microscope:
    """The microscope of a data set, where nothing varies.

    Raises:
        InputError: A number out of its range.
    """
    zernike = {int(noll): rms for noll, rms in manifest["optics"]["zernike"].items()}
    return Microscope(**(manifest["optics"] | {"zernike": zernike}))


def sensor_in(manifest: Mapping[str, Any]) -> Sensor:
    """The sensor of a data set, where nothing varies; JSON has no infinity, which is a text there.

    Raises:
        InputError: A number out of its range.
    """
    said: dict[str, Any] = {n: float(v) if isinstance(v, str) else v for n, v in manifest["sensor"].items()}
    return Sensor(**said)
