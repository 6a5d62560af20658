"""Pixels of a body's piece in which another body is: where those are, and a look at the rest."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from otwarp.scene import Scene
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.tracking.recorded import Source
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.source import TemplateSource
from otwarp.vision.tracking.templates import posed

AROUND = 0.5
"""How far the image of a body reaches beyond it [µm]."""

ROUNDS = 2
"""Times that hidden pixels are filled with what the body itself would show there, and the body is fitted again."""

MOST = 0.6
"""Share of a body's own pixels above which too much of it is hidden."""


class Outline:
    """The solids of a body as discs and bars in the plane of the image.

    Args:
        scene: With camera and body.
        index: Of the body.
    """

    def __init__(self, scene: Scene, index: int):
        name = scene.bodies[index].name
        still = posed(scene, name, Shape.of(scene, name, np.zeros(3)), 0.0)
        self._start, self._end, self._radius = still.start, still.end, still.radius

    def covers(self, shape: tuple[int, int], pixel: float, pose: np.ndarray, *, around: float = AROUND) -> np.ndarray:
        """(height, width) which pixels of a piece it covers.

        Args:
            shape: Of the piece, whose middle pixel is (height // 2, width // 2).
            pixel: [µm].
            pose: (5) x, y, depth [µm], tilt, yaw [rad] from the middle of the piece.
            around: How far it reaches beyond its solids [µm].
        """
        high, wide = shape
        x, y, _, tilt, yaw = pose
        # about −y the axis rises towards the light; only its shadow counts
        lean = np.array([math.cos(tilt), 1.0])
        ends = []
        for end in (self._start, self._end):
            flat = end[:, :2] * lean
            flat[:, 0] -= math.sin(tilt) * end[:, 2]
            c, s = math.cos(yaw), math.sin(yaw)
            ends.append(np.stack([c * flat[:, 0] - s * flat[:, 1] + x, s * flat[:, 0] + c * flat[:, 1] + y], axis=1))
        columns, rows = (np.arange(wide) - wide // 2) * pixel, (np.arange(high) - high // 2) * pixel
        covered = np.zeros(shape, dtype=bool)
        for first, last, radius in zip(*ends, self._radius + around, strict=True):
            low, top = np.minimum(first, last) - radius, np.maximum(first, last) + radius
            a, b = np.searchsorted(columns, [low[0], top[0]])
            d, e = np.searchsorted(rows, [low[1], top[1]])
            if a < b and d < e:
                covered[d:e, a:b] |= _near(columns[a:b], rows[d:e], first, last, float(radius))
        return covered


def _near(columns: np.ndarray, rows: np.ndarray, first: np.ndarray, last: np.ndarray, radius: float) -> np.ndarray:
    """Which pixels are within a distance of a bar."""
    along = last - first
    length2 = float(along @ along)
    u, v = columns[None, :] - first[0], rows[:, None] - first[1]
    share = np.clip((u * along[0] + v * along[1]) / length2, 0.0, 1.0) if length2 > 0.0 else 0.0
    return (u - share * along[0]) ** 2 + (v - share * along[1]) ** 2 <= radius * radius


def look_past(
    source: Source, levels: np.ndarray, guess: np.ndarray | None, hidden: np.ndarray, own: np.ndarray
) -> tuple[Estimate, float] | None:
    """What a source says of a piece in which others hide pixels.

    Templates are fitted to the other pixels: hidden ones get the values of the fit and the fit is made anew, which
    converges to the least squares of what is seen (Dempster, Laird and Rubin 1977). A network is shown background where
    another body is beside its own.

    Args:
        source: Of the body.
        levels: (height, width) grey levels.
        guess: (5) pose that is expected; None: nothing is hidden.
        hidden: (height, width) where other bodies are.
        own: (height, width) where the body itself is expected.
    """
    if guess is None or not hidden.any():
        return source.look(levels, guess)
    if not isinstance(source, TemplateSource):
        shown = levels.copy()
        shown[hidden & ~own] = np.median(levels[~hidden]) if not hidden.all() else np.median(levels)
        return source.look(shown, guess)
    share = float((hidden & own).sum()) / max(int(own.sum()), 1)
    if share > MOST:
        return None
    found = None
    for _ in range(ROUNDS):
        filled, like = _filled(source, levels, guess, hidden)
        if found is not None and like < source.least:
            return None
        found = source.look(filled, guess)
        if found is None:
            return None
        guess = found[0].mean
    assert found is not None
    estimate, mirror = found
    # what was filled in says nothing
    return dataclasses.replace(estimate, covariance=estimate.covariance / (1.0 - share)), mirror


def _filled(
    source: TemplateSource, levels: np.ndarray, pose: np.ndarray, hidden: np.ndarray
) -> tuple[np.ndarray, float]:
    """Levels whose hidden pixels are those of a pose, and the correlation of the others with it."""
    t = source.matcher.templates
    x, y, depth, tilt, yaw = (float(v) for v in pose)
    depth = min(max(depth, float(t.depth[0])), float(t.depth[-1]))
    tilt = min(max(tilt, float(t.tilt[0])), float(t.tilt[-1]))
    image, _ = t.image((levels.shape[0], levels.shape[1]), x, y, depth, tilt, yaw)
    filled, sensor = levels.astype(float), t.sensor
    light = np.maximum(sensor.brightness * (image[hidden] + 1.0), 0.0)
    filled[hidden] = light ** (1.0 / sensor.gamma) * (2**sensor.bits - 1)
    seen, shown = t.contrast(levels)[~hidden], image[~hidden]
    both = math.sqrt(float((seen**2).sum() * (shown**2).sum()))
    return filled, float((seen * shown).sum()) / both if both > 0.0 else 0.0
