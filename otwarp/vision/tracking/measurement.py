"""What is measured of a body at a time: where its centre is, and the direction of its axis or its whole orientation."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Camera
from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.tracking.rotations import cross, cross_matrix, difference
from otwarp.vision.tracking.shape import Shape

UNKNOWN = 1e6
"""Standard deviation [µm, rad] from which on a component counts as not measured."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurement:
    """One look at a body, in the axes of whoever looks.

    Attributes:
        time: When the light came [s], not when the result did.
        position: (3) of the body's centre in the world [µm].
        covariance: (3, 3), with an axis (5, 5), with an orientation (6, 6): of the position along the axes of `frame`
            [µm²]; then of tilt and of azimuth, which is counted along the great circle across the tilt, or of the turn
            in the axes of the world [rad²]. Infinite variances are not measured.
        axis: (3) unit vector of its long axis in the world, or None.
        orientation: (4) quaternion of its prim in the world, or None; not both.
        frame: (3, 3) columns: axes of the camera in the world, the last one along the light.
        mirror: Probability that the tilt of the axis was seen with the wrong sign.

    Raises:
        InputError: A number that is not finite, a covariance of another shape or that is not positive.
    """

    time: float
    position: np.ndarray
    covariance: np.ndarray
    axis: np.ndarray | None = None
    orientation: np.ndarray | None = None
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))
    mirror: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.time):
            raise InputError(f"time of a measurement is {self.time}; allowed: a finite time [s]")
        if self.axis is not None and self.orientation is not None:
            raise InputError("a measurement has an axis and an orientation; allowed: one of them")
        for name, length in (("position", 3), ("axis", 3), ("orientation", 4)):
            value = getattr(self, name)
            if value is not None and (np.shape(value) != (length,) or not np.all(np.isfinite(value))):
                raise InputError(f"{name} of a measurement is {value}; allowed: {length} finite numbers")
        if not 0.0 <= self.mirror <= 0.5:
            raise InputError(f"mirror of a measurement is {self.mirror:g}; allowed: 0 to 0.5")
        check_covariance(self.covariance, 5 if self.axis is not None else 6 if self.orientation is not None else 3)

    @cached_property
    def known(self) -> np.ndarray:
        """Indices of the components that were measured."""
        return np.flatnonzero(np.diag(self.covariance) < UNKNOWN**2)

    @cached_property
    def sees_axis(self) -> bool:
        """Whether both tilt and azimuth of an axis were measured."""
        return self.axis is not None and {3, 4} <= set(self.known.tolist())

    def mirrored(self) -> Measurement:
        """What would have been measured had the tilt been seen with its other sign."""
        assert self.axis is not None
        normal = self.frame[:, 2]
        covariance = np.array(self.covariance, dtype=float)
        others = [0, 1, 2, 4]
        covariance[3, others] *= -1.0
        covariance[others, 3] *= -1.0
        other = copy.copy(self)  # which is one if this is: unlike `replace`, this asks not again
        vars(other).update(axis=self.axis - 2.0 * (self.axis @ normal) * normal, covariance=covariance)
        return other

    def innovation(
        self, shape: Shape, place: np.ndarray, turn: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What was measured beyond a pose: (m) residual, (m, 6) its derivative, (m, m) covariance of the noise.

        The body's symmetry is used: of the axes and orientations that look alike, the nearest to the pose counts. A
        ball has no axis, whatever was measured of one.

        Args:
            shape: The body.
            place: (3) its centre of diffusion [µm].
            turn: (4) its orientation.
        """
        rotation, into = rotation_matrix(turn), self.frame.T
        arm = rotation @ shape.arm
        size = len(self.covariance)
        residual, slope = np.zeros(size), np.zeros((size, 6))
        residual[:3] = into @ (self.position - place - arm)
        slope[:3, :3] = into
        slope[:3, 3:] = -into @ cross_matrix(arm)
        known = self.known
        if self.axis is not None and not shape.axis.any():
            known = known[known < 3]
        elif self.axis is not None:
            residual[3:], slope[3:, 3:] = self._axis_innovation(shape, rotation @ shape.axis)
        elif self.orientation is not None:
            residual[3:] = difference(shape.nearest(self.orientation, turn), turn)
            slope[3:, 3:] = np.eye(3)
        return residual[known], slope[known], np.asarray(self.covariance, dtype=float)[known][:, known]

    def _axis_innovation(self, shape: Shape, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(2) turn that leads from the axis of a pose to the measured one, along (2, 3) directions, and these."""
        assert self.axis is not None
        measured, normal = self.axis, self.frame[:, 2]
        if not self.sees_axis:
            measured = self._completed(seen)
        elif shape.reversible and seen @ measured < 0.0:
            seen = -seen
        basis = tilt_and_azimuth(measured, normal)
        across = cross(seen, measured)
        sine = math.hypot(*across)
        turned = across * (math.atan2(sine, float(seen @ measured)) / sine if sine > 1e-12 else 1.0)
        return basis @ turned, basis

    def _completed(self, seen: np.ndarray) -> np.ndarray:
        """The measured axis, with what was not measured of it, tilt or azimuth, as the pose has it."""
        assert self.axis is not None
        normal = self.frame[:, 2]
        tilt_from, azimuth_from = (self.axis if k in self.known else seen for k in (3, 4))
        flat = azimuth_from - (azimuth_from @ normal) * normal
        length = float(np.linalg.norm(flat))
        flat = flat / length if length > 1e-9 else self.frame[:, 0]
        sine = float(np.clip(tilt_from @ normal, -1.0, 1.0))
        return sine * normal + math.sqrt(1.0 - sine * sine) * flat


def tilt_and_azimuth(axis: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(2, 3) directions about which turns lift an axis out of the focal plane, and carry it on in azimuth."""
    across = cross(axis, normal)
    length = math.hypot(*across)
    if length < 1e-9:
        across = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        length = math.hypot(*across)
    across = across / length
    return np.array([across, cross(across, axis)])


def check_covariance(covariance: np.ndarray, size: int) -> None:
    """Refuse what is no covariance.

    Raises:
        InputError: Another shape, not symmetric, or not positive definite where it is finite.
    """
    given = np.asarray(covariance, dtype=float)
    if given.shape != (size, size):
        raise InputError(f"covariance of a measurement has shape {given.shape}; allowed: ({size}, {size})")
    variances = np.diag(given)
    known = np.flatnonzero(variances < UNKNOWN**2)
    part = given[known][:, known]
    own = variances[known]
    scale = np.sqrt(np.abs(own))
    if np.isnan(variances).any() or not np.isfinite(part).all():
        raise InputError("covariance of a measurement is not finite; allowed: numbers, or inf for what is not measured")
    if (own <= 0.0).any():
        raise InputError(f"covariance of a measurement has the variance {own.min():.3g}; allowed: above 0")
    shared = part / (scale[:, None] * scale)
    if np.abs(shared - shared.T).max(initial=0.0) > 1e-5 or np.linalg.eigvalsh(shared).min(initial=1.0) <= 1e-10:
        raise InputError("covariance of a measurement is not positive definite; allowed: eigenvalues above 0")


def of_estimate(
    estimate: Any, time: float, camera: Camera, middle: np.ndarray | None = None, *, mirror: float = 0.0
) -> Measurement:
    """A measurement in the world from an `Estimate` of an image.

    Args:
        estimate: Of networks or templates, relative to the middle of an image and its focal plane.
        time: When the image was taken [s].
        camera: Of the scene: its frame, and where it focuses.
        middle: (2) of the image, from the middle of the camera's frame along its axes [µm]; None: there.
        mirror: Probability that the sign of the tilt is wrong.

    Raises:
        InputError: See `Measurement`.
    """
    frame = rotation_matrix(np.asarray(camera.orientation, dtype=float))
    x, y = (0.0, 0.0) if middle is None else middle
    place = np.array([camera.center[0] + x + estimate.x, camera.center[1] + y + estimate.y, camera.focus])
    place[2] += estimate.depth
    tilt, yaw = float(estimate.tilt), float(estimate.yaw)
    axis = np.array([math.cos(tilt) * math.cos(yaw), math.cos(tilt) * math.sin(yaw), math.sin(tilt)])
    given = np.asarray(estimate.covariance, dtype=float)
    known = ~(np.diag(given) >= UNKNOWN**2)  # nan is refused below, with what is known
    kept = np.where(np.outer(known, known), given, 0.0)
    # azimuth counts along the great circle, which it moves along by the cosine of the tilt
    upright = given[3, 3] if known[3] else 0.0
    scale = np.array([1.0, 1.0, 1.0, 1.0, math.sqrt(math.cos(tilt) ** 2 + min(float(upright), 1.0) + 1e-6)])
    covariance = kept * np.outer(scale, scale)
    covariance[~known, ~known] = np.inf
    whole = {"time": time, "position": frame @ place, "frame": frame}
    if not (known[3] or known[4]):
        return Measurement(covariance=covariance[:3, :3], **whole)
    return Measurement(covariance=covariance, axis=frame @ axis, mirror=mirror if known[3] else 0.0, **whole)
