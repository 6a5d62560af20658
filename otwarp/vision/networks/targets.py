"""What a network is to say of a data set's images: which quantities, in which units, how far they spread."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from otwarp.vision.networks.estimate import ANGLES, QUANTITIES

FLAT = 1e-6
"""Spread of a label [µm, rad] below which there is nothing to learn."""


@dataclass(frozen=True, kw_only=True)
class Targets:
    """Labels as numbers to learn.

    Attributes:
        names: Quantities that vary over the training images.
        offset, scale: Their middle and spread, in the order of `names` [µm, rad].
        others: Value of each quantity that does not vary [µm, rad].
        mirrored: Whether a robot whose axis is turned round looks the same.
        classes: Tilts of the classes [deg]; empty for none.
    """

    names: tuple[str, ...]
    offset: tuple[float, ...]
    scale: tuple[float, ...]
    others: Mapping[str, float] = field(default_factory=dict)
    mirrored: bool = False
    classes: tuple[float, ...] = ()

    def said(self) -> dict[str, Any]:
        """Names, offsets and scales for a file, from which `read` makes them again."""
        return {"names": list(self.names), "offset": list(self.offset), "scale": list(self.scale),
                "others": dict(self.others), "mirrored": self.mirrored, "classes": list(self.classes)}  # fmt: skip

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Targets:
        """The targets of a file that `said` wrote."""
        lists = {name: tuple(said[name]) for name in ("names", "offset", "scale", "classes")}
        return cls(others=said["others"], mirrored=said["mirrored"], **lists)


def truth(labels: Mapping[str, np.ndarray], index: np.ndarray) -> np.ndarray:
    """(n, 5) `QUANTITIES` of images [µm, rad].

    Args:
        labels: Of a data set, angles in degrees.
        index: (n) which images.
    """
    columns = [np.asarray(labels[q], dtype=float)[index] for q in QUANTITIES]
    return np.stack([np.radians(c) if q in ANGLES else c for q, c in zip(QUANTITIES, columns, strict=True)], 1)


def turned_round(symmetry: Mapping[str, Any], rolls: bool) -> bool:
    """Whether a robot at (−tilt, yaw + 180°) looks as at (tilt, yaw).

    Args:
        symmetry: As of a data set's manifest.
        rolls: Whether images differ in the robot's turn about its long axis, which is no label to learn.
    """
    if not symmetry["flip"]:
        return False
    half_turn = np.diag([-1.0, -1.0, 1.0])  # with no turn about the long axis, this is what leads from one to the other
    there = [np.allclose(turn, half_turn, atol=1e-6) for turn in symmetry["rotations"]]
    return bool(symmetry["axial"] or rolls or any(there))


def targets_of(
    labels: Mapping[str, np.ndarray], index: np.ndarray, *, symmetry: Mapping[str, Any], classes: np.ndarray
) -> Targets:
    """What can be learnt from images.

    Args:
        labels: Of a data set, angles in degrees.
        index: Its training images.
        symmetry: As of its manifest.
        classes: Tilts of the classes [deg].
    """
    values = truth(labels, index)
    names, offset, scale, others = [], [], [], {}
    roll = np.asarray(labels.get("roll", np.zeros(len(labels["tilt"]))))[index]
    axis = turned_round(symmetry, bool(np.ptp(roll) > 0.0))
    for name, column in zip(QUANTITIES, values.T, strict=True):
        middle, spread = _circular(column) if name == "yaw" else (float(np.mean(column)), float(np.std(column)))
        if spread < FLAT or (symmetry["spherical"] and name in ANGLES):
            others[name] = middle
        else:
            names.append(name)
            offset.append(middle)
            scale.append(spread)
    # (tilt, yaw) and (−tilt, yaw + 180°) are told apart where yaw is known
    both = "tilt" in names and "yaw" in names
    return Targets(
        names=tuple(names), offset=tuple(offset), scale=tuple(scale), others=others, mirrored=axis and both,
        classes=tuple(float(c) for c in classes),
    )  # fmt: skip


def _circular(angle: np.ndarray) -> tuple[float, float]:
    """Middle of angles on a circle, and their spread around it; at most that of all directions [rad]."""
    middle = float(np.angle(np.mean(np.exp(1j * angle))))
    away = wrapped(angle - middle)
    return middle, min(float(np.sqrt(np.mean(away**2))), math.pi / math.sqrt(3.0))


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles from −π to π [rad]."""
    return angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi))


def errors(mean: np.ndarray, true: np.ndarray, names: tuple[str, ...], *, mirrored: bool) -> np.ndarray:
    """(n, k) mean − true [µm, rad], of the poses that look the same the nearer in its angles.

    Args:
        mean, true: (n, k) [µm, rad].
        names: The k quantities.
        mirrored: Whether a robot whose axis is turned round looks the same.
    """
    found = _difference(mean, true, names)
    if not mirrored:
        return found
    sign = np.array([-1.0 if q == "tilt" else 1.0 for q in names])
    step = np.array([math.pi if q == "yaw" else 0.0 for q in names])
    other = _difference(mean, true * sign + step, names)
    angles = [n for n, q in enumerate(names) if q in ANGLES]
    nearer = np.sum(other[:, angles] ** 2, 1) < np.sum(found[:, angles] ** 2, 1)
    return np.where(nearer[:, None], other, found)


def _difference(mean: np.ndarray, true: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    found = mean - true
    if "yaw" in names:
        found[:, names.index("yaw")] = wrapped(found[:, names.index("yaw")])
    return found
