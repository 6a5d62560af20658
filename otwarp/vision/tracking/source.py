"""Where measurements come from: templates, a trained network, or its ONNX file; all look at pieces of frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.networks.run import Estimator
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.specimen import Specimen
from otwarp.vision.tracking.matching import Matcher, mirror_probability, with_errors
from otwarp.vision.tracking.recorded import RecordedBody, in_camera
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.templates import Templates, posed
from otwarp.vision.view import camera_of, microscope_of, sensor_of

MARGIN = (0.5, 0.15)
"""By how much templates reach beyond where a run goes: depth [µm], tilt [rad]."""

HELD_OUT = 16
"""Images of poses between templates, on which their errors are measured."""


@dataclass(frozen=True)
class TemplateSource:
    """Poses by templates.

    Attributes:
        matcher: Of the body.
        least: Correlation below which an image does not show it.
    """

    matcher: Matcher
    least: float = 0.6

    def look(self, image: np.ndarray, guess: np.ndarray | None) -> tuple[Estimate, float] | None:
        """As `Source`; without a guess both signs of the tilt are tried."""
        match, mirror = self.matcher.estimate(image, guess), 0.0
        if guess is None:
            match, mirror = mirror_probability(self.matcher, image, match)
        return None if match.correlation < self.least else (match.estimate, mirror)


@dataclass(frozen=True)
class NetworkSource:
    """Poses by a trained network, which expects nothing; the signs of its tilts count as right."""

    net: Estimator

    def look(self, image: np.ndarray, guess: np.ndarray | None) -> tuple[Estimate, float]:
        """As `Source`."""
        return self.net.estimate(image[None])[0], 0.0


def network_source(recorded: RecordedBody, net: Estimator) -> tuple[NetworkSource, int]:
    """A trained network, and the side of the images that it takes [pixels].

    Args:
        recorded: The run, whose camera must have the network's pixels.
        net: Of `otwarp.vision.networks.load`.

    Raises:
        InputError: It takes other pixels, or images that are not square.
    """
    pixel = camera_of(recorded.scene).pixel_size
    if abs(net.pixel / pixel - 1.0) > 0.02:
        raise InputError(f"--net takes pixels of {net.pixel:g} µm; allowed: the camera's, {pixel:g} µm")
    height, width = net.shape
    if height != width:
        raise InputError(f"--net takes images of {width} × {height} pixels; allowed: squares")
    return NetworkSource(net), width


def template_source(
    recorded: RecordedBody,
    size: int,
    *,
    rendering: Rendering | None = None,
    device: str | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> TemplateSource:
    """Templates for all depths and tilts that a body of a run goes through, with a margin, and what they err.

    Args:
        recorded: The run.
        size: Side of the pieces [pixels].
        rendering: How.
        device: Where.
        seed: Of the poses and the noise on which errors are measured.
        progress: Told how many tilts are done, of how many.

    Raises:
        InputError: Too many templates.
    """
    scene, how = recorded.scene, rendering or Rendering()
    shape = Shape.of(scene, recorded.body, np.zeros(3))
    gone = _gone_through(recorded, shape)
    depths, tilts = gone[:, 0], gone[:, 1]
    limits = [(float(v.min()) - m, float(v.max()) + m) for v, m in zip((depths, tilts), MARGIN, strict=True)]
    leaning = max(limits[1][0], -0.5 * math.pi), min(limits[1][1], 0.5 * math.pi)
    templates = Templates.of_body(
        scene, recorded.body, shape, size=size, depths=limits[0], tilts=leaning, rendering=how, device=device,
        progress=progress,
    )  # fmt: skip
    rng, fourier = np.random.default_rng([seed, 11]), Fourier(device)
    half = 0.5 * camera_of(scene).pixel_size
    # near what the run shows, at poses that it does not
    poses = np.zeros((HELD_OUT, 5))
    poses[:, :2] = rng.uniform(-half, half, (HELD_OUT, 2))
    poses[:, 2:] = gone[rng.integers(0, len(gone), HELD_OUT)] + rng.uniform(-0.1, 0.1, (HELD_OUT, 3))
    poses[:, 3] = np.clip(poses[:, 3], templates.tilt[0], templates.tilt[-1])
    shots = [_shown(recorded, shape, pose, size, how, fourier, n) for n, pose in enumerate(poses)]
    return TemplateSource(with_errors(Matcher(templates), poses, np.array(shots)))


def _gone_through(recorded: RecordedBody, shape: Shape) -> np.ndarray:
    """(n, 3) depth of the centre [µm], tilt and azimuth of the axis [rad] in all frames."""
    camera = camera_of(recorded.scene)
    out = np.zeros((len(recorded), 3))
    for n in range(len(recorded)):
        place, turn = recorded.position[n, recorded.index], recorded.orientation[n, recorded.index]
        at, frame = in_camera(camera, place, turn)
        axis = frame @ shape.axis
        centre = at + frame @ (shape.arm - shape.origin)
        out[n] = centre[2], math.asin(float(np.clip(axis[2], -1.0, 1.0))), math.atan2(axis[1], axis[0])
    return out


def _shown(
    recorded: RecordedBody, shape: Shape, pose: np.ndarray, size: int, how: Rendering, fourier: Fourier, seed: int
) -> np.ndarray:
    """(size, size) grey levels of the body alone at a pose (5)."""
    x, y, depth, tilt, yaw = pose
    still = posed(recorded.scene, recorded.body, shape, float(tilt))
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    start, end = (e @ turn.T + [x, y, depth] for e in (still.start, still.end))
    light = expose(
        Specimen(start, end, still.radius, still.index), microscope_of(recorded.scene), size, focus=[0.0],
        rendering=how, fourier=fourier,
    )  # fmt: skip
    return sensor_of(recorded.scene).levels(light.images([0.0])[0], seed=seed)
