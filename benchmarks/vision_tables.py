"""Tables of networks: confusion by tilt, bounds by tilt and depth, what is reached on unseen tilts and robots."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.vision_trainings import SPLITS, of_robots, of_split
from otwarp.bench.report import NOTHING, Table
from otwarp.vision.datasets import Spec, open_dataset
from otwarp.vision.datasets.domain import Range
from otwarp.vision.datasets.splits import USUAL
from otwarp.vision.networks.evaluate import Evaluation
from otwarp.vision.networks.train import train

ERRORS = ("accuracy", "F1", "depth, normalised", "depth [µm]", "tilt [°]")
"""Heads of `cells`."""

ROBOTS = 6
"""Of the data set that leaves out robots."""

FEWER = 10
"""Times as few focal positions has each of them: light goes through every pose anew."""

CLASS = {"radius_scale": Range(0.95, 1.05), "length_scale": Range(0.97, 1.03), "index": Range(1.5, 1.54)}
"""How robots of the class differ: as in `vision/shifted.toml`."""

UNSEEN = {"unseen_tilts": "tilts that do not train", "random": f"{ROBOTS} robots, random frames",
          "unseen_robots": f"of {ROBOTS} robots those that do not train"}  # fmt: skip
"""Splits, and what they test on."""


def cells(scores: Sequence[Mapping[str, Any]]) -> list[str]:
    """Mean, and spread where there are several seeds; depth in µm by the pose's head, or by the paper's alone."""
    out = []
    for keys in (("accuracy",), ("f1",), ("depth_normalized_rmse",), ("depth", "depth_um_rmse"), ("tilt",)):
        values = [next((v[k] for k in keys for v in (s.get("rmse", {}), s) if k in v), None) for s in scores]
        known = [v for v in values if v is not None]
        if len(known) < len(values):
            out.append(NOTHING)
        else:
            spread = f" ± {np.std(known, ddof=1):.2g}" if len(known) > 1 else ""
            out.append(f"{np.mean(known):.3g}{spread}")
    return out


def confusion_by_tilt(place: Path, runs: Mapping[str, Any], data: Mapping[str, Any]) -> Table:
    """Of every tilt, how often a network names it, and which other tilt it names most often.

    Args:
        place: The data set.
        runs: Trainings by name, whose seeds are counted together; of these the paper's, if there are such.
        data: Their metrics, as the table of splits leaves them.
    """
    classes = open_dataset(place).classes
    papers = [name for name, how in runs.items() if how.get("heads") == "paper"]
    columns = [f"{name}, {split}" for name in papers or runs for split in SPLITS]
    tables = [np.sum([one["test"]["confusion"] for one in data[name]], axis=0) for name in columns]
    rows = [(f"{tilt:.3g}", *(_named(table[n], n, classes) for table in tables)) for n, tilt in enumerate(classes)]
    note = "Images of a tilt that are named right; in brackets the tilt most confused with, and how often. All seeds."
    return Table(title="Confusion of tilts", head=("tilt [°]", *columns), rows=rows, note=note)


def _named(counts: np.ndarray, n: int, classes: np.ndarray) -> str:
    """`96 % (5°: 3 %)`."""
    if not counts.sum():
        return NOTHING
    share, others = 100.0 * counts / counts.sum(), np.where(np.arange(len(counts)) == n, 0, counts)
    most = int(np.argmax(others))
    return f"{share[n]:.0f} %" + (f" ({classes[most]:.3g}°: {share[most]:.0f} %)" if others[most] else "")


def bounds_by_pose(one: Evaluation) -> Table:
    """Error, bound and their ratio at some tilts and depths."""
    rows = []
    for row in one.by_pose:
        found = [row["quantities"].get(name) for name in ("depth", "tilt")]
        numbers = [
            (f"{e['rmse']:.3g}", f"{e['bound']:.2g}", f"{100 * e['efficiency']:.2g} %") if e else (NOTHING,) * 3
            for e in found
        ]
        ends = f"{row['depth'][0]:.2g} … {row['depth'][1]:.2g}"
        images = max((e["images"] for e in row["quantities"].values()), default=0)
        rows.append((f"{row['tilt']:.3g}", ends, str(images), *numbers[0], *numbers[1]))
    head = ("tilt [°]", "depths [µm]", "images", "depth [µm]", "its bound", "bound / error", "tilt [°]", "its bound",
            "bound / error")  # fmt: skip
    note = "Root mean squares over the test images of a tilt in a quarter of the depths; network and split as above."
    return Table(title="Errors and Cramér–Rao bounds by tilt and depth", head=head, rows=rows, note=note)


def many_robots(spec: Spec) -> Spec:
    """The poses of a data set, fewer images of each and at random heights, of several robots of the class for one."""
    return dataclasses.replace(spec, robots=ROBOTS, between=0, count=spec.count // FEWER, scattered=True,
                               domain={**spec.domain, **CLASS}, text="",
                               splits={"random": list(USUAL), "unseen_robots": True})  # fmt: skip


def unseen(
    place: Path,
    robots: Path,
    work: Path,
    name: str,
    how: Mapping[str, Any],
    seeds: int,
    device: str,
    data: dict[str, Any],
) -> Table:
    """One network on tilts and robots that it has not seen.

    Args:
        place: The data set with a split of unseen tilts.
        robots: That of `many_robots`.
        work: Folder of the trainings.
        name, how: The network, and its settings.
        seeds: Of every training.
        device: Where.
        data: Gets all metrics.
    """
    rows = []
    for split, folders in {"unseen_tilts": of_split(work, name, how, "unseen_tilts", seeds),
                           **of_robots(work, name, how, seeds)}.items():  # fmt: skip
        some = [train(place if split == "unseen_tilts" else robots, folder, settings, device=device)
                for folder, settings in folders.items()]  # fmt: skip
        images = some[0]["images"]
        found = cells([s["test"] for s in some])
        named = [NOTHING, NOTHING] if split == "unseen_tilts" else found[:2]
        rows.append((UNSEEN[split], str(images["train"]), str(images["test"]), *named, *found[2:]))
        data[f"{name}, {UNSEEN[split]}"] = some
    note = f"{name}; a tilt that does not train cannot be named. Robots: radii ±5 %, lengths ±3 %, index 1.50 to 1.54."
    head = ("tested on", "training images", "test images", *ERRORS)
    return Table(title="Unseen tilts, unseen robots", head=head, rows=rows, note=note)
