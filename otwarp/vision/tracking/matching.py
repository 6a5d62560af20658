"""Poses from images by templates: correlation to begin with, then least squares, whose curvature is the covariance."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.tracking.templates import Templates

COARSE = 32
"""Pixels of a side at which a pose is sought."""

YAWS = 36
"""Azimuths at which it is sought, over a full turn."""

TRIED = 4
"""Poses from which least squares begin where nothing is expected."""

APART = 0.3
"""Least difference of their azimuths [rad]."""

LOST = 0.85
"""Correlation below which a pose is sought anew."""

ROUNDS = 25
"""Steps of the least squares, at most."""

NEAR = (0.25, 0.1)
"""Depth [µm] and tilt [rad] within which errors are alike: standard deviations of a weight, about one template."""

PRIOR = 0.3
"""How much the mean of all measured errors counts beside those nearby, of which one counts 1."""

LEAST = 1e-4
"""Standard deviation of a pose beyond noise, at least [µm, rad]."""

STILL = 0.03
"""Length of a step, over the standard deviations, below which they end."""


@dataclass(frozen=True, eq=False)
class Match:
    """A pose that explains an image.

    Attributes:
        estimate: The pose, with the covariance of its noise and of what templates err.
        correlation: Of the image with that of the pose; 1 is the same.
        residual: Root mean square difference of contrast.
    """

    estimate: Estimate
    correlation: float
    residual: float


@dataclass(frozen=True, eq=False)
class TemplateErrors:
    """What poses err beyond noise, measured at some of them.

    A few source points and thick slices err by ten times as much at one tilt as at another, alike in all images of it.

    Attributes:
        depth, tilt: (n) of the images on which it was measured [µm, rad].
        squares: (n, 5) of x, y, depth, tilt, yaw [µm², rad²].
    """

    depth: np.ndarray
    tilt: np.ndarray
    squares: np.ndarray

    def variance(self, depth: float, tilt: float) -> np.ndarray:
        """(5) mean squares of those measured near a pose, and a little of all."""
        away = ((self.depth - depth) / NEAR[0]) ** 2 + ((self.tilt - tilt) / NEAR[1]) ** 2
        weight = np.exp(-0.5 * away)
        mean = self.squares.mean(axis=0)
        return (weight @ self.squares + PRIOR * mean) / (weight.sum() + PRIOR) + LEAST**2


class Matcher:
    """Lays templates on images.

    Args:
        templates: Of the body.
        errors: What the poses err beyond noise; None: nothing but `LEAST`. `with_errors` measures them.
    """

    def __init__(self, templates: Templates, errors: TemplateErrors | None = None):
        self.templates = templates
        self.errors = errors or TemplateErrors(np.zeros(1), np.zeros(1), np.zeros((1, 5)))
        self._small: tuple[np.ndarray, np.ndarray, int] | None = None

    def estimate(self, image: np.ndarray, start: np.ndarray | None = None) -> Match:
        """The pose of the body in an image.

        Args:
            image: (height, width) grey levels of the camera.
            start: (5) x, y [µm], depth [µm], tilt, yaw [rad] of a pose nearby; None: sought over all templates.
        """
        contrast = self.templates.contrast(image)
        tried = [] if start is None else [self._fitted(contrast, np.asarray(start, dtype=float))]
        if not tried or tried[0].correlation < LOST:
            tried += [self._fitted(contrast, pose) for pose in self.sought(contrast)]
        return max(tried, key=lambda match: match.correlation)

    def sought(self, contrast: np.ndarray) -> list[np.ndarray]:
        """(5) poses of templates, shifts and azimuths with the largest normalised correlations, the best first."""
        t = self.templates
        factor = max(1, math.ceil(max(contrast.shape) / COARSE))
        if self._small is None or self._small[2] != factor:
            self._small = *self._reduced(factor), factor
        spectra, norms, _ = self._small
        smooth = ndimage.uniform_filter(contrast, factor, mode="constant")
        found: list[tuple[float, np.ndarray]] = []
        yaws = np.zeros(1) if t.ball else np.arange(YAWS) * 2.0 * math.pi / YAWS
        if t.reversible and t.tilt[0] <= -t.tilt[-1] + 1e-9:
            yaws = yaws[: YAWS // 2]
        for yaw in yaws:
            piece = _sampled(smooth, factor, float(yaw))
            both = np.fft.irfft2(np.fft.rfft2(piece) * spectra, s=piece.shape) / norms[..., None, None]
            n = int(np.argmax(both))
            lean, height, row, column = (int(k) for k in np.unravel_index(n, both.shape))
            x, y = (factor * t.pixel * ((k + COARSE // 2) % COARSE - COARSE // 2) for k in (column, row))
            c, s = math.cos(yaw), math.sin(yaw)
            pose = np.array([c * x - s * y, s * x + c * y, t.depth[height], t.tilt[lean], yaw])
            found.append((float(both.ravel()[n]), pose))
        chosen: list[np.ndarray] = []
        for _, pose in sorted(found, key=lambda row: -row[0]):
            if all(abs(_turn(pose[4] - other[4])) > APART for other in chosen):
                chosen.append(pose)
        return chosen[:TRIED]

    def _reduced(self, factor: int) -> tuple[np.ndarray, np.ndarray]:
        """(t, d, …) conjugate spectra of the templates in fewer pixels, and (t, d) their norms."""
        shape = self.templates.splines.shape
        small = np.zeros((*shape[:2], COARSE, COARSE))
        for k in np.ndindex(shape[:2]):
            image = ndimage.uniform_filter(_values(self.templates.splines[k]), factor, mode="constant")
            small[k] = _sampled(image, factor, 0.0)
        return np.conj(np.fft.rfft2(small)), np.maximum(np.linalg.norm(small, axis=(2, 3)), 1e-12)

    def _fitted(self, contrast: np.ndarray, pose: np.ndarray) -> Match:
        """Least squares from a pose nearby, with Levenberg's and Marquardt's damping."""
        free = self._free()
        pose, damping = self._within(pose), 1e-3
        seen, slopes = self.templates.image(contrast.shape, *pose)
        rest = contrast - seen
        cost = float((rest * rest).sum())
        for _ in range(ROUNDS):
            j = slopes[free].reshape(len(free), -1)
            curve, gradient = j @ j.T, j @ rest.ravel()
            scale = np.sqrt(np.maximum(np.diag(curve), 1e-12))
            shared = curve / np.outer(scale, scale)
            step = np.linalg.solve(shared + damping * np.eye(len(free)), gradient / scale) / scale
            trial = pose.copy()
            trial[free] += step
            trial = self._within(trial)
            tried, its = self.templates.image(contrast.shape, *trial)
            left = contrast - tried
            new = float((left * left).sum())
            if new > cost:
                damping *= 10.0
                if damping > 1e6:
                    break
                continue
            done = np.all(np.abs(trial - pose)[free] * scale < STILL * math.sqrt(cost / rest.size))
            pose, seen, slopes, rest, cost, damping = trial, tried, its, left, new, max(0.1 * damping, 1e-9)
            if done:
                break
        return self._match(contrast, seen, slopes, pose, cost)

    def _match(
        self, contrast: np.ndarray, seen: np.ndarray, slopes: np.ndarray, pose: np.ndarray, cost: float
    ) -> Match:
        free = self._free()
        j = slopes[free].reshape(len(free), -1)
        variance = cost / max(contrast.size - len(free), 1)
        curve = j @ j.T
        scale = np.sqrt(np.maximum(np.diag(curve), 1e-12))
        inverse = np.linalg.pinv(curve / np.outer(scale, scale), rcond=1e-10, hermitian=True) / np.outer(scale, scale)
        covariance = np.diag(np.full(5, np.inf))
        covariance[np.ix_(free, free)] = variance * inverse + np.diag(self.errors.variance(pose[2], pose[3])[free])
        both = math.sqrt(float((contrast * contrast).sum() * (seen * seen).sum()))
        correlation = float((contrast * seen).sum()) / both if both > 0.0 else 0.0
        x, y, depth, tilt, yaw = pose
        estimate = Estimate(x=x, y=y, depth=depth, tilt=tilt, yaw=_turn(yaw), covariance=covariance)
        return Match(estimate, correlation, math.sqrt(cost / contrast.size))

    def _free(self) -> np.ndarray:
        """Indices of what can be found: of a ball only its place, and nothing that all templates share."""
        t = self.templates
        chosen = [True, True, len(t.depth) > 1, not t.ball and len(t.tilt) > 1, not t.ball]
        return np.flatnonzero(chosen)

    def _within(self, pose: np.ndarray) -> np.ndarray:
        """A pose within the templates."""
        t = self.templates
        out = pose.copy()
        out[2] = min(max(pose[2], t.depth[0]), t.depth[-1])
        if out[3] > t.tilt[-1] and t.tilt[-1] > 1.5 and t.reversible:
            # beyond upright the other end rises
            out[3], out[4] = math.pi - out[3], out[4] + math.pi
        out[3] = min(max(out[3], t.tilt[0]), t.tilt[-1])
        return out


def with_errors(
    matcher: Matcher,
    poses: np.ndarray,
    images: Iterable[np.ndarray],
    progress: Callable[[int, int], None] | None = None,
) -> Matcher:
    """The same with errors measured on images of known poses.

    Args:
        matcher: Without them.
        poses: (n, 5) of the images.
        images: (n, height, width) grey levels, or what makes one after the other.
        progress: Told how many images are done, of how many.

    Raises:
        InputError: No image.
    """
    if not len(poses):
        raise InputError("images to measure errors on are 0; allowed: 1 or more")
    bare = Matcher(matcher.templates)
    wrong = []
    for pose, image in zip(poses, images, strict=True):
        found = bare.estimate(image, pose).estimate
        off = found.mean - pose
        off[4] = _turn(off[4])
        noise = np.diag(found.covariance)
        wrong.append(np.where(np.isfinite(noise), np.maximum(off**2 - noise, 0.0), 0.0))
        if progress is not None:
            progress(len(wrong), len(poses))
    known = np.asarray(poses, dtype=float)
    return Matcher(matcher.templates, TemplateErrors(known[:, 2], known[:, 3], np.array(wrong)))


def mirror_probability(matcher: Matcher, image: np.ndarray, match: Match) -> tuple[Match, float]:
    """The better of a match and of the one with the other sign of tilt, and how probable the worse one is.

    Residuals of neighbouring pixels are alike where templates err, so that a hundredth of the pixels counts.
    """
    e = match.estimate
    low, high = matcher.templates.tilt[[0, -1]]
    if matcher.templates.ball or not low <= -e.tilt <= high:
        return match, 0.0
    other = matcher.estimate(image, np.array([e.x, e.y, e.depth, -e.tilt, e.yaw]))
    if abs(other.estimate.tilt - e.tilt) < 1e-3:
        return match, 0.0
    better, worse = sorted((match, other), key=lambda m: m.residual)
    ratio = 0.5 * image.size / 100.0 * 2.0 * math.log(max(worse.residual, 1e-12) / max(better.residual, 1e-12))
    return better, 1.0 / (1.0 + math.exp(min(ratio, 50.0)))


def moved(estimate: Estimate, x: float, y: float) -> Estimate:
    """The same seen from a middle that lies (x, y) [µm] before it."""
    return dataclasses.replace(estimate, x=estimate.x + x, y=estimate.y + y)


def _values(spline: np.ndarray) -> np.ndarray:
    """What a spline is at its knots."""
    kernel = np.array([1.0, 4.0, 1.0]) / 6.0
    return ndimage.convolve1d(ndimage.convolve1d(spline, kernel, axis=0), kernel, axis=1)


def _sampled(image: np.ndarray, factor: int, yaw: float) -> np.ndarray:
    """(COARSE, COARSE) of an image about its middle pixel, turned back by an azimuth, every `factor` pixels."""
    row, column = (np.indices((COARSE, COARSE)) - COARSE // 2) * float(factor)
    c, s = math.cos(yaw), math.sin(yaw)
    at = np.array([s * column + c * row + image.shape[0] // 2, c * column - s * row + image.shape[1] // 2])
    return ndimage.map_coordinates(image, at, order=1, mode="constant")


def _turn(angle: float) -> float:
    """The same angle within ±π [rad]."""
    return (float(angle) + math.pi) % (2.0 * math.pi) - math.pi
