"""Rendered images of a body at many tilts and depths, and the image of any pose between them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.transforms import conjugate, rotate, rotation_matrix
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.fourier import Fourier
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.sensor import Sensor
from otwarp.vision.specimen import Specimen
from otwarp.vision.tracking.rotations import exponential, product
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.view import camera_of, microscope_of, sensor_of

SPACING = 0.25
"""Between neighbouring templates: of depths, and of what a tilt does to the ends of the body [µm]."""

MOST = 4000
"""Images that a set of templates may have."""


@dataclass(frozen=True, eq=False)
class Templates:
    """Contrast of a body's images at azimuth 0 with its centre in the middle; N pixels a side.

    Attributes:
        tilt: (t) of its long axis out of the focal plane [rad], evenly spaced; one for a ball.
        depth: (d) of its centre above the focal plane [µm], evenly spaced.
        splines: (t, d, N, N) float32 coefficients of cubic splines through intensity − 1.
        pixel: [µm].
        sensor: Of the camera, whose grey levels `contrast` turns into what the splines hold.
        ball: Whether it has no axis.
        reversible: Whether its axis and the opposite of it look the same.
    """

    tilt: np.ndarray
    depth: np.ndarray
    splines: np.ndarray
    pixel: float
    sensor: Sensor
    ball: bool
    reversible: bool

    @classmethod
    def of_body(
        cls,
        scene: Scene,
        body: str,
        shape: Shape,
        *,
        size: int,
        depths: tuple[float, float],
        tilts: tuple[float, float],
        spacing: float = SPACING,
        rendering: Rendering | None = None,
        device: str | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Templates:
        """Render a body as the scene's camera sees it.

        Args:
            scene: With body and camera.
            body: Its name. About its axis it is turned as at the start of the scene.
            shape: Of the body.
            size: Side of the pieces of frames that templates are laid on [pixels].
            depths: Least and greatest [µm].
            tilts: Least and greatest [rad].
            spacing: Of neighbours [µm].
            rendering: How.
            device: Where.
            progress: Told how many tilts are done, of how many.

        Raises:
            InputError: No camera, no such body, an empty range, too many templates, or a contrast that is not the same
                along all directions.
        """
        microscope = microscope_of(scene)
        if microscope.contrast == "dic":
            raise InputError("contrast of the camera is dic, which shows a body differently at each azimuth; "
                             "allowed for templates: brightField, darkField, phaseContrast")  # fmt: skip
        ball = not np.any(shape.axis)
        robot = Robot.of_body(scene, body)
        reach = float(np.abs(np.concatenate([robot.start, robot.end])).max())
        every = _steps("depths", depths, spacing)
        leaning = np.zeros(1) if ball else _steps("tilts", tilts, spacing / max(reach, spacing))
        if len(every) * len(leaning) > MOST:
            raise InputError(f"spacing is {spacing:g} µm, {len(every)} depths × {len(leaning)} tilts; allowed: up to "
                             f"{MOST} templates")  # fmt: skip
        # turned by any angle, a template still covers the piece
        whole = 2 * math.ceil(0.5 * size * math.sqrt(2.0)) + 2
        fourier, splines = Fourier(device), []
        for n, tilt in enumerate(leaning):
            specimen = posed(scene, body, shape, float(tilt))
            light = expose(specimen, microscope, whole, focus=-every[[0, -1]], rendering=rendering, fourier=fourier)
            # raising a body lowers the focal plane within it
            images = light.images(-every) - 1.0
            splines.append([ndimage.spline_filter(image, order=3).astype(np.float32) for image in images])
            if progress is not None:
                progress(n + 1, len(leaning))
        return cls(leaning, every, np.array(splines), microscope.pixel, sensor_of(scene), ball, shape.reversible)

    @property
    def sides(self) -> int:
        """Pixels of a template's side."""
        return self.splines.shape[-1]

    def contrast(self, levels: np.ndarray) -> np.ndarray:
        """Intensity − 1 of grey levels of the camera."""
        top = 2**self.sensor.bits - 1
        return (np.asarray(levels, dtype=float) / top) ** self.sensor.gamma / self.sensor.brightness - 1.0

    def image(
        self, shape: tuple[int, int], x: float, y: float, depth: float, tilt: float, yaw: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(height, width) contrast of a pose, and (5, height, width) its derivatives by x, y, depth, tilt and yaw.

        Args:
            shape: Of the image; its middle pixel is (height // 2, width // 2).
            x, y: From the middle [µm].
            depth: [µm], within the templates.
            tilt: [rad], within the templates.
            yaw: [rad].
        """
        columns, rows = np.arange(float(shape[1])), np.arange(float(shape[0]))[:, None]
        right, up = (columns - shape[1] // 2) * self.pixel - x, (rows - shape[0] // 2) * self.pixel - y
        c, s = math.cos(yaw), math.sin(yaw)
        middle = self.sides // 2
        at = np.array([(-s * right + c * up) / self.pixel + middle, (c * right + s * up) / self.pixel + middle])
        seen = [
            np.zeros(shape) if p is None else
            ndimage.map_coordinates(p, at, order=3, prefilter=False, mode="constant")
            for p in self._blended(depth, tilt)
        ]  # fmt: skip
        across, along = _slopes(seen[0], self.pixel)
        return seen[0], np.array([-across, -along, seen[1], seen[2], up * across - right * along])

    def _blended(self, depth: float, tilt: float) -> list[np.ndarray | None]:
        """Splines of a depth and tilt, and their derivatives by both; None where there is one of these alone."""
        d, depths, slopes = _cubic(self.depth, depth)
        t, tilts, leans = _cubic(self.tilt, tilt)
        part = self.splines[t[0] : t[-1] + 1, d[0] : d[-1] + 1]
        order = _order(part.shape)
        return [
            np.einsum("i,j,ijab->ab", a, b, part, optimize=order) if a.any() and b.any() else None
            for a, b in ((tilts, depths), (tilts, slopes), (leans, depths))
        ]


def posed(scene: Scene, body: str, shape: Shape, tilt: float, roll: float = 0.0) -> Specimen:
    """The solids of a body alone in the frame of the camera, its centre at the origin, at a tilt and azimuth 0.

    Args:
        scene: With body and camera.
        body: Its name.
        shape: Of the body.
        tilt: [rad].
        roll: By which it is turned about its axis from how it is at the start of the scene [rad].
    """
    robot = Robot.of_body(scene, body)
    turn = leaning(scene, robot.name, shape, tilt, roll)
    whole = robot.frame @ rotation_matrix(turn).T
    return Specimen(robot.start @ whole, robot.end @ whole, robot.radius, robot.index)


def leaning(scene: Scene, body: str, shape: Shape, tilt: float, roll: float = 0.0) -> np.ndarray:
    """(4) orientation in the frame of the camera of a body at a tilt and azimuth 0; arguments as of `posed`."""
    start = next(b for b in scene.bodies if b.name == body).orientation
    turn = product(conjugate(np.array(camera_of(scene).orientation)), np.array(start))
    if np.any(shape.axis):
        axis = rotate(turn, shape.axis)
        flat = math.hypot(axis[0], axis[1])
        azimuth = math.atan2(axis[1], axis[0]) if flat > 1e-6 else 0.0
        turn = product(exponential([0.0, 0.0, -azimuth]), turn)
        # about −y the axis rises from x towards z
        turn = product(exponential([0.0, math.atan2(axis[2], flat) - tilt, 0.0]), turn)
    return product(turn, exponential(roll * shape.axis))


def _steps(name: str, limits: tuple[float, float], spacing: float) -> np.ndarray:
    low, high = limits
    if not (math.isfinite(low) and math.isfinite(high) and low <= high and spacing > 0.0):
        raise InputError(f"{name} of the templates are {low:g} to {high:g}; allowed: finite, the least first")
    if high == low:
        return np.array([low])
    return np.linspace(low, high, max(4, math.ceil((high - low) / spacing - 1e-9) + 1))  # cubic pieces need four


@functools.cache
def _order(shape: tuple[int, ...]) -> list[Any]:
    """In which order weights of tilts, of depths, and splines are multiplied: to find it takes as long as to do it."""
    weights = np.ones(shape[0]), np.ones(shape[1])
    return np.einsum_path("i,j,ijab->ab", *weights, np.empty(shape, dtype=np.float32), optimize=True)[0]


NODES = tuple(tuple(float(k) for k in range(4) if k != i) for i in range(4))
"""Of four knots, those besides each."""


def _cubic(knots: np.ndarray, at: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The four knots around a value, Lagrange's weights, and their derivatives."""
    if len(knots) == 1:
        return np.zeros(1, dtype=int), np.ones(1), np.zeros(1)
    step = knots[1] - knots[0]
    place = float((min(max(at, knots[0]), knots[-1]) - knots[0]) / step)
    first = int(min(max(math.floor(place) - 1, 0), len(knots) - 4))
    u = place - first
    weights, slopes = np.ones(4), np.zeros(4)
    for i, (a, b, c) in enumerate(NODES):
        scale = (i - a) * (i - b) * (i - c)
        weights[i] = (u - a) * (u - b) * (u - c) / scale
        slopes[i] = ((u - b) * (u - c) + (u - a) * (u - c) + (u - a) * (u - b)) / scale
    return first + np.arange(4), weights, slopes / step


def _slopes(image: np.ndarray, pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives along rows (x) and columns (y), of fourth order within [1/µm]."""
    found = []
    for turned in (image, image.T):
        near = np.gradient(turned, axis=1)
        far = (turned[:, 4:] - turned[:, :-4]) / 4.0
        slope = near.copy()
        slope[:, 2:-2] = (4.0 * near[:, 2:-2] - far) / 3.0
        found.append(slope / pixel)
    return found[0], found[1].T
