"""How well position and orientation could be known at all: the Cramér–Rao bound of an image, by the renderer's slopes.

No unbiased estimate from an image is better than the inverse of its Fisher information. An image is what the renderer
says, plus the sensor's noise: information is the sum over pixels of slope × slope over variance.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets import Labels, Robot, Spec
from otwarp.vision.datasets.domain import Range
from otwarp.vision.datasets.labels import outlined
from otwarp.vision.datasets.manifest import microscope_in, sensor_in
from otwarp.vision.datasets.shots import pose_intensities
from otwarp.vision.fourier import Fourier
from otwarp.vision.networks.estimate import ANGLES
from otwarp.vision.rendering import Rendering
from otwarp.vision.sensor import Sensor

STEPS = {"x": 0.02, "y": 0.02, "depth": 0.02, "tilt": 0.5, "yaw": 0.5}
"""Of the differences to either side [µm, deg]: small beside what light resolves, large beside rounding in float32."""


def pixel_variance(light: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Variance of what a pixel says, as light relative to full scale; infinite where the pixel is saturated.

    Photons (Poisson: light over electrons), reading, unequal pixels as far as nobody has measured them, and rounding
    to grey levels (a twelfth of a step squared).

    Args:
        light: Relative to full scale, without noise.
        sensor: Its numbers.
    """
    step = sensor.gamma * np.maximum(light, 1e-6) ** (1.0 - 1.0 / sensor.gamma) / (2**sensor.bits - 1)
    photons = light / sensor.electrons if math.isfinite(sensor.electrons) else 0.0
    found = photons + sensor.noise**2 + (sensor.nonuniformity * light) ** 2 + step**2 / 12.0
    return np.where(light < 1.0, found, np.inf)


def fisher_information(intensity: np.ndarray, slopes: np.ndarray, sensor: Sensor) -> np.ndarray:
    """(…, k, k) information of an image about k parameters [1/µm², 1/rad², …].

    Of noise that depends on the light, that the variance tells of the light as well is left out: it is the share 1/2N
    of N photoelectrons in a pixel, and for Poisson's distribution nothing is left out.

    Args:
        intensity: (…, h, w), 1 where light is unhindered.
        slopes: (…, k, h, w) by the parameters.
        sensor: Whose noise it is.
    """
    light = sensor.brightness * np.maximum(intensity, 0.0)
    variance = pixel_variance(light, sensor)
    by = sensor.brightness * slopes
    return np.einsum("...ihw,...jhw->...ij", by / variance[..., None, :, :], by)


def bound(information: np.ndarray) -> np.ndarray:
    """(…, k, k) least covariance of an unbiased estimate of all k parameters together.

    Infinite variance where the image says nothing of a parameter.

    Args:
        information: (…, k, k).
    """
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 1e-300))
    relative = information / scale[..., :, None] / scale[..., None, :]
    out = np.full(information.shape, np.inf)
    for where in np.ndindex(information.shape[:-2]):
        if np.all(scale[where] > 1e-140) and np.linalg.cond(relative[where]) < 1e12:
            out[where] = np.linalg.inv(relative[where]) / scale[where][:, None] / scale[where][None, :]
    return out


@dataclass(frozen=True, eq=False)
class Views:
    """What the renderer says around some images of a pose.

    Attributes:
        intensity: (n, h, w), 1 where light is unhindered.
        slopes: (n, k, h, w) by each quantity [1/µm, 1/rad].
    """

    intensity: np.ndarray
    slopes: np.ndarray


def views(labels: Labels, pose: int, rows: np.ndarray, names: Sequence[str], fourier: Fourier) -> Views:
    """Images of a pose without noise, and their slopes by central differences.

    Args:
        labels: Of a data set.
        pose: Its number.
        rows: (n) which of its images.
        names: k of `estimate.QUANTITIES`.
        fourier: On what.
    """
    slopes = []
    for name in names:
        step = STEPS[name]
        sides = [_look(labels, pose, rows, name, sign * step, fourier) for sign in (1.0, -1.0)]
        slopes.append((sides[0] - sides[1]) / (2.0 * (math.radians(step) if name in ANGLES else step)))
    return Views(pose_intensities(labels, pose, fourier, rows), np.stack(slopes, 1))


def _look(labels: Labels, pose: int, rows: np.ndarray, name: str, step: float, fourier: Fourier) -> np.ndarray:
    """Images as they would be, were one quantity larger by a step [µm, deg]."""
    moved = {**labels.arrays, name: labels.arrays[name] + step}
    return pose_intensities(dataclasses.replace(labels, arrays=moved), pose, fourier, rows)


def bounds(
    dataset: Any, index: np.ndarray, names: Sequence[str], *, poses: int = 8, device: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of images of a data set: of as many poses as are asked for, all images of these that are given.

    Args:
        dataset: As `open_dataset` gives it.
        index: (n) images that are of interest.
        names: k of `estimate.QUANTITIES` that are estimated together.
        poses: How many, evenly among those of the images; each takes a second.
        device: Of the renderer.

    Returns:
        (m) images, some of the index, and (m, k) variances [µm², rad²].

    Raises:
        InputError: Not even one pose.
    """
    if poses < 1:
        raise InputError(f"poses is {poses}; allowed: 1 or more")
    labels, fourier = labels_from(dataset), Fourier(device)
    of = labels.arrays["pose"][index]
    there = np.unique(of)
    chosen = there[np.unique(np.linspace(0, len(there) - 1, min(poses, len(there))).round().astype(int))]
    rows_of, variances = [], []
    for pose in chosen:
        rows = index[of == pose]
        seen = views(labels, int(pose), rows, names, fourier)
        for n, row in enumerate(rows):
            information = fisher_information(seen.intensity[n], seen.slopes[n], labels.sensor(int(row)))
            variances.append(np.diagonal(bound(information)))
        rows_of.append(rows)
    return np.concatenate(rows_of), np.array(variances)


def labels_from(dataset: Any) -> Labels:
    """All that is known of the images of a data set on disk, as if it were about to be rendered.

    Args:
        dataset: As `open_dataset` gives it.
    """
    said, arrays = dataset.manifest, {name: np.asarray(values) for name, values in dataset.labels.items()}
    layout = said["layout"]
    spec = Spec(
        robot=Robot.read(said["robot"]),
        classes=np.array(said["classes"], dtype=float),
        depth=(layout["depth"][0], layout["depth"][1]),
        count=layout["count"],
        width=layout["width"],
        height=layout["height"],
        microscope=microscope_in(said),
        sensor=sensor_in(said),
        rendering=Rendering(**said["rendering"]),
        domain={name: _range(r) for name, r in said["domain"].items()},
        seed=said["seed"],
    )
    pose = arrays["pose"]
    first = np.concatenate([np.flatnonzero(np.diff(pose, prepend=-1)), [len(pose)]])
    return outlined(Labels(spec, first, arrays))


def _range(said: dict[str, Any]) -> Range:
    return Range(said["low"], said["high"], tuple(said["values"]))
