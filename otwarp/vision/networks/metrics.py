"""Figures of merit of predictions: accuracy, F1, errors, and whether the stated uncertainty is right."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.networks.estimate import ANGLES, QUANTITIES
from otwarp.vision.networks.predict import Predictions
from otwarp.vision.networks.targets import Targets, errors, truth

COVERAGES = {"68": 0.994457883209753, "95": 1.959963984540054}
"""Per cent of a normal distribution within so many standard deviations."""


def confusion(predicted: np.ndarray, true: np.ndarray, classes: int) -> np.ndarray:
    """(classes, classes) images of each true class (row) by the class that was said (column)."""
    return np.bincount(true * classes + predicted, minlength=classes**2).reshape(classes, classes)


def f1(table: np.ndarray) -> float:
    """Mean over the classes that occur of the harmonic mean of precision and recall."""
    hit, said, there = np.diag(table), table.sum(0), table.sum(1)
    occurs = there > 0
    return float(np.mean(2.0 * hit[occurs] / np.maximum(said + there, 1)[occurs]))


def spans(labels: Mapping[str, np.ndarray], index: np.ndarray) -> np.ndarray:
    """(n) focus range of each image's pose: µm for a step of 1 of normalised depth; NaN where a pose has one image."""
    pose = np.asarray(labels["pose"], dtype=np.int64)
    depth, unit = (np.asarray(labels[name], dtype=float) for name in ("depth", "depth_normalized"))
    _, where = np.unique(pose, return_inverse=True)
    count = int(where.max()) + 1
    ends = np.full((4, count), np.nan)
    for row, values in enumerate((depth, unit)):
        ends[2 * row], ends[2 * row + 1] = np.inf, -np.inf
        np.minimum.at(ends[2 * row], where, values)
        np.maximum.at(ends[2 * row + 1], where, values)
    wide, steps = ends[1] - ends[0], ends[3] - ends[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(steps > 0.0, wide / steps, np.nan)[where][index]


def scores_of(
    said: Predictions, targets: Targets, labels: Mapping[str, np.ndarray], index: np.ndarray
) -> dict[str, Any]:
    """All figures of merit of predictions.

    Args:
        said: Of n images.
        targets: What the network says.
        labels: Of the data set, angles in degrees.
        index: (n) which of its images.

    Returns:
        `images`; of the paper's heads `accuracy`, `f1`, `confusion`, `depth_normalized_rmse`, `depth_um_rmse`; of the
        pose's `rmse` of each quantity [µm, deg], `axis_rmse_deg`, `bias`, `coverage`, `nll`, `nees`.
    """
    found: dict[str, Any] = {"images": len(index)}
    if said.scores is not None:
        found |= _classes(said.scores, np.asarray(labels["tilt_class"])[index].astype(np.int64))
    if said.depth is not None:
        away = said.depth - np.asarray(labels["depth_normalized"], dtype=float)[index]
        found["depth_normalized_rmse"] = _rms(away)
        metric = away * spans(labels, index)
        if np.isfinite(metric).all():
            found["depth_um_rmse"] = _rms(metric)
    if said.mean is not None:
        true = truth(labels, index)
        away = errors_of(said, targets, labels, index)
        found |= pose_scores(away, said.covariance, targets.names)
        if "tilt" in targets.names:
            found["axis_rmse_deg"] = _axis_error(said.mean, true, targets)
    return found


def in_words(scores: Mapping[str, Any]) -> str:
    """What `scores_of` found, in a line: tilts named right, and root mean square errors."""
    words = [f"{100 * scores['accuracy']:.1f} % of tilts right"] if "accuracy" in scores else []
    if "depth_normalized_rmse" in scores:
        words.append(f"normalised depth {scores['depth_normalized_rmse']:.3g}")
    units = {name: "°" if name in ANGLES else " µm" for name in QUANTITIES}
    return ", ".join([*words, *(f"{name} {value:.3g}{units[name]}" for name, value in scores.get("rmse", {}).items())])


def errors_of(said: Predictions, targets: Targets, labels: Mapping[str, np.ndarray], index: np.ndarray) -> np.ndarray:
    """(n, k) errors of predicted poses [µm, rad]; `scores_of` has the arguments."""
    columns = [QUANTITIES.index(name) for name in targets.names]
    assert said.mean is not None
    return errors(said.mean, truth(labels, index)[:, columns], targets.names, mirrored=targets.mirrored)


def _classes(scores: np.ndarray, true: np.ndarray) -> dict[str, Any]:
    has = true >= 0
    if not has.any():
        return {}
    predicted = np.argmax(scores, 1)
    table = confusion(predicted[has], true[has], scores.shape[1])
    return {"accuracy": float(np.mean(predicted[has] == true[has])), "f1": f1(table), "confusion": table.tolist()}


def pose_scores(away: np.ndarray, covariance: np.ndarray | None, names: tuple[str, ...]) -> dict[str, Any]:
    """Errors, and what the stated covariance says of them.

    Args:
        away: (n, k) errors [µm, rad].
        covariance: (n, k, k) as stated; None where nothing is.
        names: The k quantities.

    Returns:
        `rmse`, `median` (of absolute errors) and `bias` by quantity [µm, deg]. Of what is stated `sigma` (root mean
        square) by quantity; `coverage`: by per cent and quantity the share of errors within so many standard
        deviations; `nll`: mean negative log density of all together, in nats with µm and rad; `nees`: mean normalised
        squared error over k, 1 where all is right.

    Raises:
        InputError: A covariance that has no inverse, as a network states it whose training has diverged.
    """
    unit = np.array([math.degrees(1.0) if name in ANGLES else 1.0 for name in names])
    each = lambda values: {name: float(v) for name, v in zip(names, values, strict=True)}  # noqa: E731
    found = {
        "rmse": each(unit * np.sqrt(np.mean(away**2, 0))),
        "median": each(unit * np.median(np.abs(away), 0)),
        "bias": each(unit * np.mean(away, 0)),
    }
    if covariance is None:
        return found
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    squares, volume = _squares(away, covariance)
    return found | {
        "sigma": each(unit * np.sqrt(np.mean(deviation**2, 0))),
        "coverage": {p: each(np.mean(np.abs(away) <= z * deviation, 0)) for p, z in COVERAGES.items()},
        "nll": float(np.mean(0.5 * (squares + volume + len(names) * math.log(2.0 * math.pi)))),
        "nees": float(np.mean(squares)) / len(names),
    }


def _squares(away: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n) errors (n, k) squared over covariances (n, k, k), and (n) logarithms of their determinants."""
    with np.errstate(invalid="ignore"):
        sign, volume = np.linalg.slogdet(covariance)
    wrong = np.flatnonzero(~(np.isfinite(away).all(1) & np.isfinite(volume) & (sign > 0.0)))
    if len(wrong):
        raise InputError(f"covariance that the network states of {len(wrong)} of {len(away)} images has no inverse; "
                         "allowed: a network that has learnt, as with a smaller --lr")  # fmt: skip
    return np.einsum("ni,ni->n", away, np.linalg.solve(covariance, away[..., None])[..., 0]), volume


def _axis_error(mean: np.ndarray, true: np.ndarray, targets: Targets) -> float:
    """Root mean square angle between the axes as said and as they are [deg], which upright ones have as well."""
    whole = true.copy()
    whole[:, [QUANTITIES.index(name) for name in targets.names]] = mean
    for name, value in targets.others.items():
        whole[:, QUANTITIES.index(name)] = value
    one, other = (_axis(values[:, 3], values[:, 4]) for values in (whole, true))
    cosine = np.sum(one * other, 1)
    return math.degrees(_rms(np.arccos(np.clip(np.abs(cosine) if targets.mirrored else cosine, -1.0, 1.0))))


def _axis(tilt: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(tilt) * np.cos(yaw), np.cos(tilt) * np.sin(yaw), np.sin(tilt)], 1)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def widening(away: np.ndarray, covariance: np.ndarray) -> tuple[float, ...]:
    """(k) factors of the standard deviations that make normalised errors one on average.

    Networks are too sure of images that they have not seen; the validation part says by how much (Levi et al. 2022,
    doi:10.3390/s22155540).

    Args:
        away: (n, k) errors.
        covariance: (n, k, k) as stated.
    """
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return tuple(float(v) for v in np.sqrt(np.mean((away / deviation) ** 2, 0)))
