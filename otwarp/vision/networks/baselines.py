"""What pictures say without a network: the most similar training image, and measures of focus with ridge regression."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from otwarp.vision.networks.data import area_weights
from otwarp.vision.networks.estimate import QUANTITIES
from otwarp.vision.networks.predict import Predictions
from otwarp.vision.networks.targets import Targets, truth

SIDE = 32
"""Of templates [pixels]: finer ones are no better where sensors are noisy, and cost more."""

BANDS = 12
"""Rings of the spectrum whose power is a measure of focus."""

PENALTY = 1e-3
"""Of the ridge, over the mean square of a standardised feature."""

BLOCK = 512

AT_ONCE = 64
"""Images that stay in a processor's cache while they are measured."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Images with their labels, as a baseline learns from them.

    Attributes:
        images: uint8 (n, height, width).
        tilt_class: (n), −1 for none.
        depth: (n) normalised.
        mean: (n, k) quantities of the targets [µm, rad].
    """

    images: np.ndarray
    tilt_class: np.ndarray
    depth: np.ndarray
    mean: np.ndarray

    @classmethod
    def of(cls, dataset: Any, index: np.ndarray, targets: Targets) -> Shown:
        """Some images of a data set."""
        columns = [QUANTITIES.index(name) for name in targets.names]
        labels: Mapping[str, np.ndarray] = dataset.labels
        return cls(
            images=dataset.images(index),
            tilt_class=np.asarray(labels["tilt_class"])[index].astype(np.int64),
            depth=np.asarray(labels["depth_normalized"], dtype=float)[index],
            mean=truth(labels, index)[:, columns],
        )


def nearest_template(train: Shown, images: np.ndarray, classes: int) -> Predictions:
    """Labels of the training image that correlates most with each image, both reduced to `SIDE` pixels.

    Args:
        train: Templates.
        images: uint8 (n, height, width).
        classes: Of tilt; 0 for none.
    """
    templates, best = _unit(train.images), np.empty(len(images), dtype=np.int64)
    for start in range(0, len(images), BLOCK):
        some = _unit(images[start : start + BLOCK])
        best[start : start + BLOCK] = np.argmax(some @ templates.T, axis=1)
    scores = _one_hot(train.tilt_class[best], classes) if classes else None
    return Predictions(scores=scores, depth=train.depth[best], mean=train.mean[best])


def focus_ridge(train: Shown, images: np.ndarray, classes: int) -> Predictions:
    """Classes, depths and poses by ridge regression of `focus_measures` and their products.

    Args:
        train: Images to learn from.
        images: uint8 (n, height, width).
        classes: Of tilt; 0 for none.
    """
    found, wanted = focus_measures(train.images), [train.depth[:, None], train.mean]
    if classes:
        wanted.append(_one_hot(train.tilt_class, classes))
    said = _ridge(found, np.concatenate(wanted, axis=1))(focus_measures(images))
    k = train.mean.shape[1]
    return Predictions(scores=said[:, 1 + k :] if classes else None, depth=said[:, 0], mean=said[:, 1 : 1 + k])


def focus_measures(images: np.ndarray) -> np.ndarray:
    """(n, features) measures of focus: gradients, Laplacian, contrast, moments, and the power in rings of the spectrum.

    Those of Tenenbaum, Brenner and the variance of the Laplacian are compared in Pertuz et al. 2013
    (doi:10.1016/j.patcog.2012.11.011).

    Args:
        images: uint8 (n, height, width).
    """
    return np.concatenate([_measures(images[s : s + AT_ONCE]) for s in range(0, len(images), AT_ONCE)])


def _measures(images: np.ndarray) -> np.ndarray:
    light = images.astype(np.float32) / 255.0
    height, width = light.shape[1:]
    mean = light.mean(axis=(1, 2), keepdims=True)
    away = light - mean
    square = away * away  # powers of three and four by pow take four times as long as all the rest
    variance = np.mean(square, axis=(1, 2)) + 1e-12
    across = {1: 2, 2: 1}
    slopes = [ndimage.correlate1d(ndimage.correlate1d(light, [-1.0, 0.0, 1.0], axis=axis), [1.0, 2.0, 1.0], axis=other)
              for axis, other in across.items()]  # fmt: skip
    curve = sum(ndimage.correlate1d(light, [1.0, -2.0, 1.0], axis=axis) for axis in (1, 2))
    central = light[:, height // 2 - 2 : height // 2 + 3, width // 2 - 2 : width // 2 + 3].mean(axis=(1, 2))
    found = [
        mean[:, 0, 0],
        np.sqrt(variance),
        np.mean(square * away, axis=(1, 2)) / variance**1.5,
        np.log(np.mean(square * square, axis=(1, 2)) / variance**2),
        np.log(np.mean(slopes[0] ** 2 + slopes[1] ** 2, axis=(1, 2)) + 1e-12),
        np.log(np.mean((light[:, :, 2:] - light[:, :, :-2]) ** 2, axis=(1, 2)) + 1e-12),
        np.log(np.mean((light[:, 2:] - light[:, :-2]) ** 2, axis=(1, 2)) + 1e-12),
        np.log(np.var(curve, axis=(1, 2)) + 1e-12),
        central - mean[:, 0, 0],
        light.max(axis=(1, 2)),
        light.min(axis=(1, 2)),
    ]
    return np.concatenate([np.stack(found, axis=1), _rings(away)], axis=1)


def _rings(away: np.ndarray) -> np.ndarray:
    """(n, BANDS) logarithms of the power in rings of the spectrum."""
    height, width = away.shape[1:]
    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    ring = np.minimum((radius / 0.5 * BANDS).astype(int), BANDS).ravel()
    power = (np.abs(np.fft.rfft2(away)) ** 2).reshape(len(away), -1)
    return np.log(np.stack([power[:, ring == r].mean(axis=1) for r in range(BANDS)], axis=1) + 1e-12)


def _ridge(features: np.ndarray, wanted: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """What tells (n, outputs) from (n, features), of the features, their squares and products."""
    middle, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    pairs = np.triu_indices(features.shape[1])

    def expanded(values: np.ndarray) -> np.ndarray:
        z = (values - middle) / spread
        return np.concatenate([z, z[:, pairs[0]] * z[:, pairs[1]]], axis=1)

    x = expanded(features)
    size, offset = x.std(axis=0) + 1e-9, x.mean(axis=0)
    x = (x - offset) / size
    target = wanted.mean(axis=0)
    matrix = x.T @ x + PENALTY * len(x) * np.eye(x.shape[1])
    weights = np.linalg.solve(matrix, x.T @ (wanted - target))
    return lambda values: (expanded(values) - offset) / size @ weights + target


def _unit(images: np.ndarray) -> np.ndarray:
    """float32 (n, pixels) reduced images without their mean, of length 1."""
    rows, columns = (area_weights(n, min(n, SIDE)).astype(np.float32) for n in images.shape[1:])
    small = np.concatenate([rows @ images[s : s + BLOCK].astype(np.float32) @ columns.T
                            for s in range(0, len(images), BLOCK)])  # fmt: skip
    flat = small.reshape(len(images), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-6)


def _one_hot(kinds: np.ndarray, classes: int) -> np.ndarray:
    """(n, classes) 1 where the class is meant; all 0 for −1."""
    return (kinds[:, None] == np.arange(classes)).astype(float)


BASELINES = {"nearest template": nearest_template, "focus measures, ridge": focus_ridge}
"""By the name in reports."""
