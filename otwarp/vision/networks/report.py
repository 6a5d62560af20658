"""The page of an evaluation: tables for people, numbers for programs, figures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.files import check_place, written, written_together
from otwarp.vision.datasets.store import DATA, MANIFEST
from otwarp.vision.networks.checkpoint import write_json
from otwarp.vision.networks.estimate import ANGLES
from otwarp.vision.networks.evaluate import Evaluation
from otwarp.vision.networks.figures import draw_calibration, draw_confusion, draw_errors
from otwarp.vision.networks.run import Estimator


def check_report(folder: str | Path) -> Path:
    """The folder of a report, which may be that of the report before.

    Args:
        folder: Where; it is not made yet.

    Raises:
        InputError: It is a data set or in its arrays, or cannot be written.
    """
    place = Path(folder)
    whole = place.resolve()
    if (whole / MANIFEST).exists() or DATA in whole.parts:
        raise InputError(f"--report is {place}, which holds a data set; allowed: a folder of its own")
    check_place(place, "--report", folder=True)
    return place


def write_report(folder: str | Path, estimator: Estimator, found: Sequence[Evaluation]) -> Path:
    """Write `report.md`, `report.json` and figures: all of them, or none where one cannot be written.

    Args:
        folder: Where; it is made.
        estimator: What was evaluated.
        found: On which data sets, with which result.

    Returns:
        The page.

    Raises:
        InputError: As `check_report`.
        OSError: The disk is full; what was there stays as it was.
    """
    place = check_report(folder)
    with written_together(place) as apart:
        _write(apart, estimator, found)
    return place / "report.md"


def _write(folder: Path, estimator: Estimator, found: Sequence[Evaluation]) -> None:
    """All files of an evaluation."""
    about, names = estimator.about, estimator.quantities
    lines = [f"# {about['net']}, epoch {about['epoch']}", "", _weights(about["weights"]), ""]
    for number, one in enumerate(found, start=1):
        stem = f"{number}_{re.sub(r'[^A-Za-z0-9_-]', '_', one.name)}"
        lines += [f"## {one.name}: {one.about}, {one.scores['images']} images", "", *_scores(one, names)]
        lines += _stated(one.scores, names) + _bounds(one) + _tilts(one, names)
        drawn = {
            f"{stem}_confusion.png": draw_confusion(folder / f"{stem}_confusion.png", one, estimator.targets.classes),
            f"{stem}_errors.png": draw_errors(folder / f"{stem}_errors.png", one, names),
            f"{stem}_calibration.png": draw_calibration(folder / f"{stem}_calibration.png", one, names),
        }
        lines += [
            f"![{file.removesuffix('.png').rpartition('_')[2]}]({file})" for file, there in drawn.items() if there
        ]
        lines.append("")
    write_json(folder / "report.json", {"network": about, "evaluations": [one.said() for one in found]})
    page = folder / "report.md"
    with written(page, page.name) as part:
        part.write_text("\n".join(lines), encoding="utf-8")


def _weights(weights: Mapping[str, str]) -> str:
    if weights["source"] == "none":
        return "Trained from random weights."
    return f"Trained from weights of {weights['source']}: `{weights['file']}`, SHA-256 {weights['sha256'][:16]}…"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown, the first column text and the others numbers, and a line after it."""
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows), ""]


def titles(names: Sequence[str]) -> list[str]:
    """Quantities with their units."""
    return [f"{name} [{'°' if name in ANGLES else 'µm'}]" for name in names]


def number(value: Any) -> str:
    """Three digits, or a dash for nothing."""
    return "–" if value is None else f"{value:.3g}"


def _scores(one: Evaluation, names: Sequence[str]) -> list[str]:
    head = ["", "accuracy", "F1", "depth, normalised", "the same [µm]", *titles(names)]
    rows = []
    for title, scores in {"network": one.scores, **one.baselines}.items():
        rmse = scores.get("rmse", {})
        cells = [scores.get(k) for k in ("accuracy", "f1", "depth_normalized_rmse", "depth_um_rmse")]
        rows.append([title, *map(number, cells), *(number(rmse.get(name)) for name in names)])
    said = "Shares of tilts named right, mean F1; the others are root mean square errors."
    return [*table(head, rows), said, ""]


def _stated(scores: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    if "coverage" not in scores:
        return []
    rows = [["stated deviation", *(number(scores["sigma"][name]) for name in names)],
            ["mean error", *(number(scores["bias"][name]) for name in names)]]  # fmt: skip
    rows += [[f"within the {p} % interval", *(f"{100 * values[name]:.1f} %" for name in names)]
             for p, values in scores["coverage"].items()]  # fmt: skip
    said = (
        f"Negative log density {scores['nll']:.3g} nats an image (µm, rad); squared error {scores['nees']:.3g} of the "
    )
    said += "stated one."
    return ["**Stated uncertainty**", "", *table(["", *titles(names)], rows), said, ""]


def _bounds(one: Evaluation) -> list[str]:
    if not one.efficiency:
        return []
    rows = [[title, number(e["bound"]), number(e["rmse"]), f"{100 * e['efficiency']:.2g} %", str(e["images"])]
            for (name, e), title in zip(one.efficiency.items(), titles(list(one.efficiency)), strict=True)]  # fmt: skip
    head = ["", "bound", "error", "bound / error", "images"]
    whole = ["**Cramér–Rao bound**, root mean squares over the images of some poses", "", *table(head, rows)]
    names = list(one.efficiency)
    head = ["tilt [°]", "depth [µm]", *(f"{title}: {what}" for title in titles(names) for what in ("error", "bound"))]
    cells = [[row["quantities"].get(name, {}) for name in names] for row in one.by_pose]
    rows = [[f"{row['tilt']:g}", f"{row['depth'][0]:.2g} … {row['depth'][1]:.2g}",
             *(number(e.get(key)) for e in found for key in ("rmse", "bound"))]
            for row, found in zip(one.by_pose, cells, strict=True)]  # fmt: skip
    return [*whole, "**The same by pose and depth**", "", *table(head, rows)]


def _tilts(one: Evaluation, names: Sequence[str]) -> list[str]:
    if not names or len(one.by_tilt) > 60:
        return []
    rows = [
        [f"{row['tilt']:g}", str(row["images"]), *(number(row["rmse"][name]) for name in names)] for row in one.by_tilt
    ]
    return ["**Root mean square error by tilt**", "", *table(["tilt [°]", "images", *titles(names)], rows)]
