"""What a network has seen in training: of which robot, how it lay, through which optics; and what it has not."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.vision.datasets.manifest import microscope_in
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.microscope import Microscope

POSES = {"tilt": "°", "yaw": "°", "depth": " µm"}
OPTICS = {"numerical_aperture": "", "condenser_aperture": "", "wavelength": " µm", "medium_index": ""}
AROUND = (1, 4, 11, 22, 37, 56)
"""Noll's numbers of the aberrations that are the same all around: none, defocus, spherical ones."""

ASKEW = ("condenser_x", "condenser_y", "astigmatism", "coma")
"""Labels of optics that are not."""

SLACK = 0.02
"""Of a range or a value, by which it may be exceeded without a word."""


def learnt_of(dataset: Any) -> dict[str, tuple[float, float]]:
    """For a file: the least and greatest of labels and optics [µm, deg], by name.

    Args:
        dataset: As `open_dataset` gives it.
    """
    ranges = {}
    for name in (*POSES, *OPTICS):
        if name in dataset.labels:
            values = np.asarray(dataset.labels[name], dtype=float)
            ranges[name] = float(values.min()), float(values.max())
        else:
            ranges[name] = (float(dataset.manifest["optics"][name]),) * 2
    return ranges


def same_all_around(microscope: Microscope) -> bool:
    """Whether a robot that is turned about the axis of light has the image that is turned.

    Args:
        microscope: Its contrast, condenser and aberrations count.
    """
    askew = [n for n, value in microscope.zernike.items() if value and n not in AROUND]
    return not (microscope.contrast == "dic" or microscope.condenser_x or microscope.condenser_y or askew)


def seen_all_around(dataset: Any) -> bool:
    """Whether `same_all_around` holds of the optics of all images of a data set.

    Args:
        dataset: As `open_dataset` gives it.
    """
    microscope = microscope_in(dataset.manifest)
    return same_all_around(microscope) and not any(np.any(dataset.labels.get(name, 0.0)) for name in ASKEW)


def robot_of(about: Mapping[str, Any]) -> Robot:
    """The robot that a network was trained on.

    Args:
        about: Of an `Estimator`.

    Raises:
        InputError: Its file does not say.
    """
    if "robot" not in about:
        raise InputError("the network does not say of which robot it is; allowed: one that this otwarp trained, or "
                         "--any-robot")  # fmt: skip
    return Robot.read(about["robot"])


def check_robot(about: Mapping[str, Any], robot: Robot, whose: str) -> None:
    """Refuse a network of another robot.

    Args:
        about: Of an `Estimator`.
        robot: That it is to look at.
        whose: Where that is from, for the message.

    Raises:
        InputError: It is another.
    """
    own = robot_of(about)
    if not own.same(robot):
        names = [f"{r.name or 'a robot of its file'}, {len(r.radius)} solids, {r.length:.3g} µm" for r in (own, robot)]
        raise InputError(f"{whose}: the robot ({names[1]}) is not that of the network ({names[0]}); allowed: a network "
                         "of this robot, or --any-robot")  # fmt: skip


def exceeded(about: Mapping[str, Any], seen: Mapping[str, tuple[float, float]]) -> list[str]:
    """Ranges of what is to be seen beyond those of the training, in words; none of a network that does not say.

    Args:
        about: Of an `Estimator`.
        seen: By name of `POSES` and `OPTICS` the least and greatest [µm, deg].
    """
    found = []
    for name, (low, high) in seen.items():
        first, last = about.get("learnt", {}).get(name, (-np.inf, np.inf))
        slack = SLACK * max(last - first, abs(last), 1e-9)
        if low < first - slack or high > last + slack:
            unit = (POSES | OPTICS)[name]
            found.append(f"{name.replace('_', ' ')} {_ends(low, high)}{unit} (learnt: {_ends(first, last)}{unit})")
    return found


def warn_of_exceeded(about: Mapping[str, Any], seen: Mapping[str, tuple[float, float]], whose: str) -> None:
    """Say in a line what a network has not learnt of what it is to see.

    Args:
        about, seen: As of `exceeded`.
        whose: Where that is from.

    Warns:
        PlausibilityWarning: There is something.
    """
    found = exceeded(about, seen)
    if found:
        warnings.warn(f"{whose}: the network has not learnt {', '.join(found)}", PlausibilityWarning, stacklevel=2)


def _ends(low: float, high: float) -> str:
    return f"{low:.4g}" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g}"
