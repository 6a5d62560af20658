"""All labels of a data set before an image is rendered: which robot lies how, and what it is seen through.

Rows go by pose: of each robot all tilts, those between classes among them, as many poses of each as were asked for;
and within a pose by depth, from below the focal plane to above it.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets.domain import PARAMETERS, generator
from otwarp.vision.datasets.spec import ZERNIKE, Spec
from otwarp.vision.datasets.splits import split_labels
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import grid_for, warn_if_few
from otwarp.vision.sensor import Sensor
from otwarp.vision.specimen import Specimen

ALWAYS = ("yaw", "x", "y")
"""Parameters that are labels even where they do not vary."""

AS_THEY_ARE = ("wavelength", "condenser_aperture", "condenser_x", "condenser_y", "illumination_curvature",
               "medium_index", "numerical_aperture")  # fmt: skip
"""Parameters that the microscope knows by the same name."""


@dataclass(frozen=True, eq=False)
class Labels:
    """Of every image, and where the images of a pose stand.

    Attributes:
        spec: Of the data set.
        first: (p + 1) row of the first image of each pose, and the count of all images.
        arrays: By name (n): pose, tilt, yaw, tilt_class, robot, depth, …, split_….
        outline: Solids that reach as far as the robots of all poses, in all directions: source points and margin of all
            images are chosen for these, so that they do not tell one pose from another.
    """

    spec: Spec
    first: np.ndarray
    arrays: dict[str, np.ndarray]
    outline: Specimen | None = None

    @property
    def planes(self) -> np.ndarray:
        """(2) lowest and highest focal plane relative to the robot's centre [µm]."""
        return -np.array(self.spec.depth[::-1])

    @property
    def poses(self) -> int:
        """How many."""
        return len(self.first) - 1

    @property
    def count(self) -> int:
        """Number of images."""
        return int(self.first[-1])

    @property
    def chunk(self) -> int:
        """Images of a chunk: poses have a whole number of chunks."""
        return int(np.gcd.reduce(np.diff(self.first)))

    def rows(self, pose: int) -> slice:
        """The images of a pose."""
        return slice(int(self.first[pose]), int(self.first[pose + 1]))

    def value(self, name: str, row: int, otherwise: Any) -> Any:
        """Of a parameter in an image, or what stands where it does not vary."""
        return float(self.arrays[name][row]) if name in self.arrays else otherwise

    def specimen(self, pose: int) -> Specimen:
        """The robot of a pose in the light, its centre at the origin."""
        row = int(self.first[pose])
        robot = self.spec.robot.varied(
            radius_scale=self.value("radius_scale", row, 1.0),
            length_scale=self.value("length_scale", row, 1.0),
            index=self.value("index", row, None),
        )
        return robot.at(*(self.value(name, row, 0.0) for name in ("tilt", "yaw", "roll")))

    def microscope(self, row: int) -> Microscope:
        """What an image is seen through.

        Raises:
            InputError: What was drawn cannot be.
        """
        base, changes = self.spec.microscope, {}
        for name in AS_THEY_ARE:
            if name in self.arrays:
                changes[name] = self.value(name, row, None)
        if "glass_depth" in self.arrays:
            changes["depth"] = self.value("glass_depth", row, None)
        zernike = {noll: self.value(name, row, None) for name, noll in ZERNIKE.items() if name in self.arrays}
        if zernike:
            changes["zernike"] = {**base.zernike, **zernike}
        return dataclasses.replace(base, **changes) if changes else base

    def azimuth(self, pose: int) -> float:
        """Turn of the source points [rad]."""
        return math.radians(self.value("azimuth", int(self.first[pose]), 0.0))

    def sensor(self, row: int) -> Sensor:
        """What records an image."""
        names = [n for n in ("brightness", "electrons", "noise", "gamma") if n in self.arrays]
        return dataclasses.replace(self.spec.sensor, **{n: self.value(n, row, None) for n in names})


def labels_of(spec: Spec) -> Labels:
    """Draw everything, and refuse what could not be rendered.

    Raises:
        InputError: A robot outside the frame or thicker than the volume, optics that cannot be, an empty split.
    """
    tilt, kind = _tilts(spec)
    poses = len(tilt) * spec.poses * spec.robots
    robot, which, _ = (a.ravel() for a in np.meshgrid(np.arange(spec.robots), np.arange(len(tilt)),
                                                      np.arange(spec.poses), indexing="ij"))  # fmt: skip
    counts = np.where(kind[which] >= 0, spec.count, spec.between_count)
    first = np.concatenate([[0], np.cumsum(counts)])
    of = np.repeat(np.arange(poses), counts)
    arrays: dict[str, np.ndarray] = {"pose": of.astype(np.int32), "robot": robot[of].astype(np.int32)}
    arrays["tilt"], arrays["tilt_class"] = tilt[which][of], kind[which][of].astype(np.int16)
    arrays["depth"], arrays["depth_normalized"] = _depths(spec, counts)
    for name in (*ALWAYS, *(n for n in spec.domain if n not in ALWAYS)):
        arrays[name] = np.zeros(len(of))
        if name in spec.domain:
            scope, rng = PARAMETERS[name].scope, generator(spec.seed, name)
            size = {"robot": spec.robots, "pose": poses, "image": len(of)}[scope]
            drawn = spec.domain[name].draw(size, rng)
            arrays[name] = drawn[{"robot": robot[of], "pose": of, "image": np.arange(len(of))}[scope]]
    labels = outlined(Labels(spec, first, arrays))
    _check(labels)
    assert labels.outline is not None
    for row in first[:-1]:
        warn_if_few(labels.outline, labels.microscope(int(row)), spec.width, spec.height, labels.planes, spec.rendering)
    arrays.update(split_labels(spec, arrays))
    return labels


def outlined(labels: Labels) -> Labels:
    """The same, with the outline of its robots wherever they are seen."""
    low, high, thickest = np.zeros(3), np.zeros(3), 0.0
    for pose in range(labels.poses):
        robot, rows = labels.specimen(pose), labels.rows(pose)
        shift = np.stack([labels.arrays["x"][rows], labels.arrays["y"][rows], np.zeros(rows.stop - rows.start)])
        ends = np.concatenate([robot.start, robot.end])
        low = np.minimum(low, ends.min(axis=0) + shift.min(axis=1))
        high = np.maximum(high, ends.max(axis=0) + shift.max(axis=1))
        thickest = max(thickest, float(robot.radius.max()))
    outline = Specimen.of_spheres(np.array([low, high]), thickest, 1.0)
    return dataclasses.replace(labels, outline=outline)


def _tilts(spec: Spec) -> tuple[np.ndarray, np.ndarray]:
    """Tilts in order [deg], and their classes, -1 for those between."""
    if not spec.between or len(spec.classes) < 2:
        return spec.classes, np.arange(len(spec.classes))
    share = np.arange(spec.between + 1) / (spec.between + 1)
    gaps = spec.classes[:-1, None] + np.diff(spec.classes)[:, None] * share
    kind = np.where(share[None, :] == 0.0, np.arange(len(gaps))[:, None], -1)
    return np.append(gaps.ravel(), spec.classes[-1]), np.append(kind.ravel(), len(spec.classes) - 1)


def _depths(spec: Spec, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depths [µm], and the same between 0 and 1 of the sweep of their pose."""
    rng = generator(spec.seed, "depth")
    found, scaled = [], []
    for count in counts:
        if spec.scattered:
            depth = np.sort(spec.depth[0] + (spec.depth[1] - spec.depth[0]) * rng.random(count))
        else:
            depth = np.linspace(*spec.depth, count)
        length = depth[-1] - depth[0]
        found.append(depth)
        scaled.append((depth - depth[0]) / length if length > 0.0 else np.zeros(count))
    return np.concatenate(found), np.concatenate(scaled)


def _check(labels: Labels) -> None:
    """Everything that rendering would refuse, before any of it.

    Raises:
        InputError: It would; the message says of which pose.
    """
    spec = labels.spec
    pixel = spec.microscope.pixel
    half = 0.5 * pixel * np.array([spec.width, spec.height])
    volume = spec.volume
    if volume is None:
        assert labels.outline is not None
        square = grid_for(labels.outline, spec.microscope, spec.width, spec.height, labels.planes, spec.rendering)
        volume = square.length
    for pose in range(labels.poses):
        rows = labels.rows(pose)
        specimen = labels.specimen(pose)
        low, high = specimen.low, specimen.high
        tilt = labels.arrays["tilt"][rows.start]
        if high[2] - low[2] > volume:
            raise InputError(f"the robot at tilt {tilt:g}° is {high[2] - low[2]:.3g} µm thick; allowed: up to "
                             f"{volume:.3g} µm, the volume ([render] volume)")  # fmt: skip
        for axis, name in enumerate("xy"):
            shift = labels.arrays[name][rows]
            reach = max(-(low[axis] + shift.min()), high[axis] + shift.max())
            if reach > half[axis]:
                raise InputError(f"the robot at tilt {tilt:g}° reaches {reach:.3g} µm from the middle along {name}; "
                                 f"allowed: up to {half[axis]:.3g} µm, the frame")  # fmt: skip
        varies = any(PARAMETERS[n].scope == "image" for n in spec.domain)
        for row in range(rows.start, rows.stop if varies else rows.start + 1):
            labels.microscope(row)
            labels.sensor(row)
