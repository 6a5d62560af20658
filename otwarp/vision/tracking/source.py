"""Where measurements come from: templates, a trained network, or its ONNX file; all look at pieces of frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.transforms import conjugate, rotate
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.fourier import Fourier
from otwarp.vision.networks.estimate import QUANTITIES, Estimate
from otwarp.vision.networks.learnt import OPTICS, check_robot, same_all_around, warn_of_exceeded
from otwarp.vision.networks.run import Estimator
from otwarp.vision.networks.targets import wrapped
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.specimen import Specimen
from otwarp.vision.tracking.matching import Matcher, mirror_probability, with_errors
from otwarp.vision.tracking.recorded import RecordedBody, check_size, in_camera
from otwarp.vision.tracking.rotations import exponential, product
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.templates import Templates, leaning, posed
from otwarp.vision.view import camera_of, microscope_of, sensor_of

MARGIN = (0.5, 0.15)
"""By how much templates reach beyond where a run goes: depth [µm], tilt [rad]."""

ALL_AROUND = 359.0
"""Degrees of azimuths learnt, from which on images need not be turned."""

HELD_OUT = 32
"""Images of poses between templates, spread over the tilts of a run, on which their errors are measured."""

AMONG = 3
"""Frames before and after one, in the order of their tilts, of which depth, tilt and turns of such a pose are."""


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
    """Poses by a trained network; the signs of its tilts count as right.

    Attributes:
        net: The network.
        azimuth: Middle of the azimuths that it has learnt [rad]: an image is turned so that the expected azimuth comes
            to lie there, and what the network says is turned back. None: it has learnt all, or turned optics would
            show the body differently.
        start: Azimuth that is expected before anything is known [rad].
    """

    net: Estimator
    azimuth: float | None = None
    start: float = 0.0

    @property
    def side(self) -> int:
        """Of the images that it is shown [pixels]."""
        own = self.net.shape[0]
        return own if self.azimuth is None else 2 * math.ceil(own / math.sqrt(2.0)) + 2

    def look(self, image: np.ndarray, guess: np.ndarray | None) -> tuple[Estimate, float]:
        """As `Source`; the image has a side of √2 times the network's where images are turned."""
        if self.azimuth is None:
            return self.net.estimate(image[None])[0], 0.0
        by = (self.start if guess is None else float(guess[4])) - self.azimuth
        piece = turned(image, by, self.net.shape[0])
        return turned_back(self.net.estimate(piece[None])[0], by), 0.0


def learnt_azimuths(net: Estimator) -> tuple[float, float]:
    """Middle of the azimuths that a network has learnt, and how far they reach to both sides [rad].

    Args:
        net: Of `otwarp.vision.networks.load`.
    """
    first, last = np.radians(net.about.get("learnt", {}).get("yaw", [-180.0, 180.0]))
    return float(0.5 * (first + last)), float(0.5 * (last - first))


def turns(net: Estimator, *, long: bool, same: bool) -> bool:
    """Whether images can be turned for a network that has not learnt all azimuths.

    Args:
        net: Of `otwarp.vision.networks.load`.
        long: Whether its robot is longer than wide.
        same: Whether optics are the same all around the axis of light, so that a robot that is turned about that axis
            has the image that is turned.
    """
    return long and same and 2.0 * learnt_azimuths(net)[1] < math.radians(ALL_AROUND)


def turned(image: np.ndarray, angle: float, size: int) -> np.ndarray:
    """(size, size) grey levels of the middle of an image, turned by −angle about its middle pixel.

    Args:
        image: (height, width) uint8, with a side of √2 times `size`, or more.
        angle: [rad].
        size: [pixels].
    """
    c, s = math.cos(angle), math.sin(angle)
    middle, own = np.array(image.shape) // 2, np.full(2, size // 2)
    turn = np.array([[c, s], [-s, c]])  # of (row, column)
    corner: Any = middle - turn @ own  # SciPy's types know of one number alone
    found = ndimage.affine_transform(
        image.astype(np.float32), turn, corner, output_shape=(size, size), order=3, mode="nearest"
    )
    return np.clip(np.rint(found), 0, 255).astype(np.uint8)


def turned_back(estimate: Estimate, angle: float) -> Estimate:
    """What was said of an image that was turned by −angle, of the image itself.

    Args:
        estimate: Of the turned image.
        angle: [rad].
    """
    c, s = math.cos(angle), math.sin(angle)
    whole = np.eye(len(QUANTITIES))
    whole[:2, :2] = [[c, -s], [s, c]]
    known = np.isfinite(np.diag(estimate.covariance))
    part = np.where(known[:, None] & known[None, :], estimate.covariance, 0.0)
    if known[0] != known[1]:
        known[:2] = False  # of one direction in the turned image nothing was said
    covariance = np.where(known[:, None] & known[None, :], whole @ part @ whole.T, 0.0)
    covariance[~known, ~known] = np.inf
    x, y = whole[:2, :2] @ [estimate.x, estimate.y]
    return Estimate(x=float(x), y=float(y), depth=estimate.depth, tilt=estimate.tilt, yaw=estimate.yaw + angle,
                    covariance=covariance)  # fmt: skip


def network_source(recorded: RecordedBody, net: Estimator, *, any_robot: bool = False) -> tuple[NetworkSource, int]:
    """A trained network, and the side of the images that it is shown [pixels].

    Args:
        recorded: The run, whose camera must have the network's pixels.
        net: Of `otwarp.vision.networks.load`.
        any_robot: Whether it may be that of another robot.

    Raises:
        InputError: As `network_for`, or images that do not hold the body.

    Warns:
        PlausibilityWarning: As `network_for`.
    """
    shape = Shape.of(recorded.scene, recorded.body, np.zeros(3))
    gone = _gone_through(recorded, shape)
    source = network_for(recorded.scene, recorded.body, net, gone, who="--net", any_robot=any_robot)
    check_size(recorded, net.shape[0])
    return source, source.side


def network_for(
    scene: Scene,
    body: str,
    net: Estimator,
    gone: np.ndarray,
    *,
    who: str,
    any_robot: bool = False,
    turn_always: bool = True,
) -> NetworkSource:
    """A trained network for a body of a scene.

    Args:
        scene: With the camera, which must have the network's pixels.
        body: Its name.
        net: Of `otwarp.vision.networks.load`.
        gone: (n, 3) depth [µm], tilt and azimuth [rad] that it goes through, or begins with.
        who: How a message names the network.
        any_robot: Whether it may be that of another robot.
        turn_always: Whether images are turned as well where all azimuths that it goes through were learnt.

    Raises:
        InputError: It takes other pixels, other levels, images that are not square, or is that of another robot.

    Warns:
        PlausibilityWarning: The body goes through poses, or the camera has optics, that the network has not learnt.
    """
    if not any_robot:
        check_robot(net.about, Robot.of_body(scene, body), body)
    pixel = camera_of(scene).pixel_size
    if abs(net.pixel / pixel - 1.0) > 0.02:
        raise InputError(f"{who} takes pixels of {net.pixel:g} µm; allowed: the camera's, {pixel:g} µm")
    height, width = net.shape
    if height != width:
        raise InputError(f"{who} takes images of {width} × {height} pixels; allowed: squares")
    bits = int(net.about.get("bits", 8))
    if camera_of(scene).bits != bits:
        raise InputError(f"{who} takes levels of {bits} bits; allowed: the camera's, {camera_of(scene).bits}")
    microscope, long = microscope_of(scene), bool(np.any(Shape.of(scene, body, np.zeros(3)).axis))
    middle, half = learnt_azimuths(net)
    learnt = bool(np.all(np.abs(wrapped(gone[:, 2] - middle)) <= half + 1e-6))
    turned = turns(net, long=long, same=same_all_around(microscope)) and (turn_always or not learnt)
    seen = {"depth": gone[:, 0], "tilt": np.degrees(gone[:, 1])}
    if not turned and long:
        seen["yaw"] = np.degrees(middle + wrapped(gone[:, 2] - middle))
    ranges = {name: (float(v.min()), float(v.max())) for name, v in seen.items()}
    ranges |= {name: (getattr(microscope, name),) * 2 for name in OPTICS}
    warn_of_exceeded(net.about, ranges, body)
    return NetworkSource(net, middle, float(gone[0, 2])) if turned else NetworkSource(net)


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
    templates = templates_for(recorded, size, rendering=rendering, device=device, progress=progress)
    return measured(recorded, templates, size, rendering=rendering, device=device, seed=seed)


def templates_for(
    recorded: RecordedBody,
    size: int,
    *,
    rendering: Rendering | None = None,
    device: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Templates:
    """Templates for all depths and tilts that a body of a run goes through, with a margin.

    Args:
        recorded, size, rendering, device, progress: As of `template_source`.

    Raises:
        InputError: Too many templates.
    """
    scene, how = recorded.scene, rendering or Rendering()
    shape = Shape.of(scene, recorded.body, np.zeros(3))
    gone = _gone_through(recorded, shape)
    depths, tilts = gone[:, 0], gone[:, 1]
    limits = [(float(v.min()) - m, float(v.max()) + m) for v, m in zip((depths, tilts), MARGIN, strict=True)]
    leaning = max(limits[1][0], -0.5 * math.pi), min(limits[1][1], 0.5 * math.pi)
    return Templates.of_body(
        scene, recorded.body, shape, size=size, depths=limits[0], tilts=leaning, rendering=how, device=device,
        progress=progress,
    )  # fmt: skip


def measured(
    recorded: RecordedBody,
    templates: Templates,
    size: int,
    *,
    rendering: Rendering | None = None,
    device: str | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> TemplateSource:
    """Templates and what they err, measured on images of poses between them.

    Args:
        recorded, size, rendering, device, seed: As of `template_source`.
        templates: Of `templates_for`.
        progress: Told how many images are done, of how many.
    """
    shape, how = Shape.of(recorded.scene, recorded.body, np.zeros(3)), rendering or Rendering()
    rng, fourier = np.random.default_rng([seed, 11]), Fourier(device)
    half = 0.5 * camera_of(recorded.scene).pixel_size
    poses = np.zeros((HELD_OUT, 6))
    poses[:, :2] = rng.uniform(-half, half, (HELD_OUT, 2))
    poses[:, 2:] = _mixed(np.column_stack([_gone_through(recorded, shape), _rolls(recorded, shape)]), rng)
    poses[:, 3] = np.clip(poses[:, 3], templates.tilt[0], templates.tilt[-1])
    shots = (_shown(recorded, shape, pose, size, how, fourier, n) for n, pose in enumerate(poses))
    return TemplateSource(with_errors(Matcher(templates), poses[:, :5], shots, progress))


def _mixed(gone: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(`HELD_OUT`, 4) depth, tilt, azimuth and roll as the run has them, but none of its poses.

    Poses that scatter more than those of the body err more than they do, and would state too wide a covariance. Azimuth
    and roll are of one frame: of a body that is nearly upright they are nothing without each other.

    Args:
        gone: (n, 4) of the run's frames.
        rng: Random numbers.
    """
    order = np.argsort(gone[:, 1], kind="stable")
    place = ((np.arange(HELD_OUT) + rng.random(HELD_OUT)) / HELD_OUT * len(gone)).astype(int)
    near = place[:, None] + rng.integers(-AMONG, AMONG + 1, (HELD_OUT, 3))[:, [0, 1, 2, 2]]
    frames = order[np.clip(near, 0, len(gone) - 1)]
    return np.stack([gone[frames[:, k], k] for k in range(4)], axis=1) + rng.uniform(-0.01, 0.01, (HELD_OUT, 4))


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


def _rolls(recorded: RecordedBody, shape: Shape) -> np.ndarray:
    """(n) angles about its axis by which a body is turned from how templates show it, in all frames [rad].

    Templates do not know them: what they make a body seem to move by counts as an error. 0 for one that looks the same
    at all of them.
    """
    out = np.zeros(len(recorded))
    if shape.revolves or not np.any(shape.axis):
        return out
    camera = camera_of(recorded.scene)
    for n, turn in enumerate(recorded.orientation[:, recorded.index]):
        there = product(conjugate(np.array(camera.orientation)), turn)
        axis = rotate(there, shape.axis)
        tilt, yaw = math.asin(float(np.clip(axis[2], -1.0, 1.0))), math.atan2(axis[1], axis[0])
        still = product(exponential([0.0, 0.0, yaw]), leaning(recorded.scene, recorded.body, shape, tilt))
        x, y, z, w = product(conjugate(still), shape.nearest(there, still))
        out[n] = math.remainder(2.0 * math.atan2(float(np.dot([x, y, z], shape.axis)), w), 2.0 * math.pi)
    return out


def _shown(
    recorded: RecordedBody, shape: Shape, pose: np.ndarray, size: int, how: Rendering, fourier: Fourier, seed: int
) -> np.ndarray:
    """(size, size) grey levels of the body alone at a pose (6): x, y, depth [µm], tilt, azimuth, roll [rad]."""
    x, y, depth, tilt, yaw, roll = pose
    still = posed(recorded.scene, recorded.body, shape, float(tilt), float(roll))
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    start, end = (e @ turn.T + [x, y, depth] for e in (still.start, still.end))
    light = expose(
        Specimen(start, end, still.radius, still.index), microscope_of(recorded.scene), size, focus=[0.0],
        rendering=how, fourier=fourier,
    )  # fmt: skip
    return sensor_of(recorded.scene).levels(light.images([0.0])[0], seed=seed)
