"""A trained network on data sets: how far off it is, how sure, and how far from what the images hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets import Robot, open_dataset
from otwarp.vision.networks import checkpoint
from otwarp.vision.networks.baselines import BASELINES, Shown
from otwarp.vision.networks.bound import bounds
from otwarp.vision.networks.estimate import ANGLES
from otwarp.vision.networks.learnt import POSES, check_robot, learnt_of, warn_of_exceeded
from otwarp.vision.networks.library import ELSEWHERE, memory_named
from otwarp.vision.networks.metrics import errors_of, scores_of
from otwarp.vision.networks.predict import Predictions
from otwarp.vision.networks.prepare import dataset_digest
from otwarp.vision.networks.run import Estimator, network_file
from otwarp.vision.networks.use import load

SAME_PIXEL = 0.01
"""Relative difference of pixels that a network does not mind."""

LAYERS = 4
"""Equal parts of the depths, in which errors are compared with the bound."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Of one data set.

    Attributes:
        name: Of its folder.
        about: Which of its images: `test part of random`, or `all images`.
        scores: As of `metrics.scores_of`.
        baselines: The same, by the name of the baseline; none where the data set was not trained on.
        efficiency: By quantity `bound` and `rmse` over the same images [µm, deg], and their ratio `efficiency`.
        by_pose: The same apart for every pose and for every quarter of the depths: rows of `tilt` [deg], `depth` [µm],
            least and greatest of the row's images, and `quantities`, as of `efficiency`.
        by_tilt: Rows of `tilt` [deg], `images`, and `rmse` by quantity [µm, deg].
        errors: (n, k) [µm, rad], with `tilt` and `depth` (n) [deg, µm] and `sigma` (n, k) as stated; for figures.
    """

    name: str
    about: str
    scores: Mapping[str, Any]
    baselines: Mapping[str, Mapping[str, Any]]
    efficiency: Mapping[str, Mapping[str, float]]
    by_pose: Sequence[Mapping[str, Any]]
    by_tilt: Sequence[Mapping[str, Any]]
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)

    def said(self) -> dict[str, Any]:
        """The scores as numbers and texts for a JSON file."""
        return {"name": self.name, "about": self.about, "scores": dict(self.scores), "baselines": dict(self.baselines),
                "efficiency": dict(self.efficiency), "by_pose": list(self.by_pose),
                "by_tilt": list(self.by_tilt)}  # fmt: skip


def evaluate(
    run: str | Path,
    datasets: Sequence[str | Path],
    *,
    poses: int = 8,
    baselines: bool = True,
    device: str | None = None,
    any_robot: bool = False,
    report: Callable[[str], None] | None = None,
) -> tuple[Estimator, list[Evaluation]]:
    """Look how good a network is.

    Of the data set that it was trained on, the test part of its split; of any other, all images.

    Args:
        run: Folder of a training.
        datasets: Folders of data sets.
        poses: Of which the Cramér–Rao bound is computed; 0 for none.
        baselines: Whether to compare with `BASELINES`, which learn from the training part.
        device: cpu, cuda:0, …; None: the best there is.
        any_robot: Whether data sets may be of other robots.
        report: Called with what is being done.

    Returns:
        The network, and an evaluation for every data set.

    Raises:
        InputError: No such training or data set, one whose images, classes or robot are not those of the network, or
            a network of another training.

    Warns:
        PlausibilityWarning: A data set goes beyond the poses that the network has learnt.
    """
    folder = Path(run)
    _check_no_export(folder)
    estimator = load(folder, device=device)
    if not datasets:
        raise InputError("there is no data set to evaluate on; allowed: one or more folders of data sets")
    run_json = (folder if folder.is_dir() else folder.parent) / checkpoint.RUN
    asked = checkpoint.read_json(run_json)
    if estimator.about.get("training") != checkpoint.digest(asked):
        raise InputError(f"{network_file(folder)}: is not the network of the training in {run_json}; allowed: the one "
                         "that this training wrote")  # fmt: skip
    # . and .. are no names
    names = [(p if p.name not in ("", "..") else p.resolve()).name for p in map(Path, datasets)]
    opened = [(name, open_dataset(d)) for name, d in zip(names, datasets, strict=True)]
    for name, data in opened:
        check_fits(estimator, data, name)
        if not any_robot:
            check_robot(estimator.about, Robot.read(data.manifest["robot"]), name)
        ranges = {n: ends for n, ends in learnt_of(data).items() if n in POSES}
        warn_of_exceeded(estimator.about, ranges, name)
    found = []
    for name, data in opened:
        if report:
            report(name)
        own = dataset_digest(data) == asked["dataset"]
        found.append(_one(estimator, name, data, asked["settings"], own, poses, baselines, device))
    return estimator, found


def _check_no_export(run: Path) -> None:
    """Refuse an exported network, which lies without the training that it came from."""
    if run.suffix == ".onnx" and not run.is_dir():
        raise InputError(f"run is {run}, an exported network; allowed: the folder of its training, or network.pt there")


def check_fits(estimator: Estimator, data: Any, name: str) -> None:
    """Refuse a data set whose images or classes are not those of a network.

    Raises:
        InputError: They are not.
    """
    if tuple(data.shape) != estimator.shape:
        raise InputError(f"{name}: images are {data.shape[1]}x{data.shape[0]} pixels; allowed: {estimator.shape[1]}x"
                         f"{estimator.shape[0]}, which the network was trained on")  # fmt: skip
    pixel = float(data.manifest["optics"]["pixel"])
    if abs(pixel / estimator.pixel - 1.0) > SAME_PIXEL:
        raise InputError(
            f"{name}: pixel is {pixel:g} µm; allowed: {estimator.pixel:g} µm, which the network was trained on"
        )
    classes = np.asarray(estimator.targets.classes)
    if estimator.about["heads"] != "pose" and np.any(np.asarray(data.labels["tilt_class"]) >= 0):
        same = len(classes) == len(data.classes) and np.allclose(classes, data.classes, atol=1e-3)
        if not same:
            there, own = (f"{len(c)}, {_ends(c)}" for c in (data.classes, classes))
            raise InputError(f"{name}: has other classes of tilt: {there}; allowed: the network's {own}")


def _ends(classes: np.ndarray) -> str:
    return f"{classes[0]:g}° to {classes[-1]:g}°" if len(classes) else "none"


def _one(
    estimator: Estimator,
    name: str,
    data: Any,
    settings: Mapping[str, Any],
    own: bool,
    poses: int,
    baselines: bool,
    device: str | None,
) -> Evaluation:
    """Evaluate one data set; `own`: the network was trained on it."""
    split = data.split(settings["split"]) if own else {}
    index = split["test"] if own else np.arange(data.count)
    about = f"test part of split {settings['split']}" if own else "all images"
    said, targets = estimator.predict(data.images(index)), estimator.targets
    others: dict[str, Any] = {}
    if own and baselines:
        train = Shown.of(data, split["train"], targets)
        classes = len(targets.classes) if np.any(train.tilt_class >= 0) else 0
        for title, baseline in BASELINES.items():
            others[title] = scores_of(baseline(train, data.images(index), classes), targets, data.labels, index)
    names = estimator.quantities
    away = errors_of(said, targets, data.labels, index) if names else np.zeros((len(index), 0))
    efficiency, by_pose = _bounded(data, index, away, names, poses, device) if poses and names else ({}, [])
    return Evaluation(
        name, about, scores_of(said, targets, data.labels, index), others, efficiency, by_pose,
        _by_tilt(data.labels["tilt"][index], away, names), _drawn(data, index, said, away),
    )  # fmt: skip


def _drawn(data: Any, index: np.ndarray, said: Predictions, away: np.ndarray) -> dict[str, np.ndarray]:
    found = {"away": away, "tilt": data.labels["tilt"][index], "depth": data.labels["depth"][index]}
    if said.covariance is not None:
        found["sigma"] = np.sqrt(np.diagonal(said.covariance, axis1=1, axis2=2))
    return found


def _bounded(
    data: Any, index: np.ndarray, away: np.ndarray, names: tuple[str, ...], poses: int, device: str | None
) -> tuple[dict[str, dict[str, float]], list[dict[str, Any]]]:
    """Bound over error of the images of some poses: of all together, and by pose and depth."""
    with memory_named("a pose of the Cramér–Rao bound", device or "the GPU", f"poses 0, for no bound, or {ELSEWHERE}"):
        rows, variance = bounds(data, index, names, poses=poses, device=device)
    order = np.argsort(index)
    mine = away[order[np.searchsorted(index, rows, sorter=order)]]
    depth, pose = data.labels["depth"][rows], data.labels["pose"][rows]
    low, high = float(depth.min()), float(depth.max())
    layer = np.minimum(LAYERS * (depth - low) / max(high - low, 1e-9), LAYERS - 1).astype(int)
    apart = []
    for one, part in sorted(set(zip(pose.tolist(), layer.tolist(), strict=True))):
        here = (pose == one) & (layer == part)
        apart.append({"tilt": float(data.labels["tilt"][rows][here][0]),
                      "depth": [float(depth[here].min()), float(depth[here].max())],
                      "quantities": _efficiency(variance[here], mine[here], names)})  # fmt: skip
    return _efficiency(variance, mine, names), apart


def _efficiency(variance: np.ndarray, away: np.ndarray, names: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Bound over error by quantity, both root mean squares over the images whose bound is finite."""
    found = {}
    for n, name in enumerate(names):
        finite = np.isfinite(variance[:, n])
        if finite.any():
            unit = _unit(name)
            least = unit * math.sqrt(float(np.mean(variance[finite, n])))
            rmse = unit * math.sqrt(float(np.mean(away[finite, n] ** 2)))
            found[name] = {"bound": least, "rmse": rmse, "efficiency": least / rmse if rmse else math.inf,
                           "images": int(finite.sum())}  # fmt: skip
    return found


def _by_tilt(tilt: np.ndarray, away: np.ndarray, names: tuple[str, ...]) -> list[dict[str, Any]]:
    rows = []
    for value in np.unique(np.round(tilt, 6)):
        mine = np.abs(tilt - value) < 1e-5
        rmse = {name: _unit(name) * float(np.sqrt(np.mean(away[mine, n] ** 2))) for n, name in enumerate(names)}
        rows.append({"tilt": float(value), "images": int(mine.sum()), "rmse": rmse})
    return rows


def _unit(name: str) -> float:
    """Of what is reported over what is computed: degrees for angles."""
    return math.degrees(1.0) if name in ANGLES else 1.0
