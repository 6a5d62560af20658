"""Learning curves: a line an epoch, as CSV and JSON for programs and as a figure for people."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from otwarp.files import written
from otwarp.vision.networks.checkpoint import write_json

COLUMNS = ("epoch", "rate", "training_loss", "validation_loss", "accuracy", "depth_normalized_rmse", "depth_rmse_um",
           "seconds", "images_per_second")  # fmt: skip
"""Empty where a network does not say it."""

TRAINING, VALIDATION, THIRD = "#0072b2", "#d55e00", "#009e73"


def write_curves(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `curves.csv` and `curves.json` into a folder."""
    with written(folder / "curves.csv", "curves.csv") as part, part.open("w", newline="", encoding="utf-8") as file:
        lines = csv.DictWriter(file, COLUMNS)
        lines.writeheader()
        lines.writerows({c: "" if row.get(c) is None else row[c] for c in COLUMNS} for row in rows)
    write_json(folder / "curves.json", [{c: row.get(c) for c in COLUMNS} for row in rows])


def draw_curves(file: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Draw losses, and the errors of the validation part, over the epochs."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    epochs = [row["epoch"] for row in rows]
    for name, color, style in (("training_loss", TRAINING, "-"), ("validation_loss", VALIDATION, "--")):
        left.plot(epochs, [row[name] for row in rows], style, color=color, label=name.partition("_")[0], marker=".")
    left.set(xlabel="epoch", ylabel="loss")
    left.legend(frameon=False)
    shown = (("depth_rmse_um", "depth [µm]", THIRD, "-"), ("depth_normalized_rmse", "depth, normalised", TRAINING, ":"))
    for name, label, color, style in shown:
        values = [math.nan if row.get(name) is None else row[name] for row in rows]
        if not all(math.isnan(v) for v in values):
            right.plot(epochs, values, style, color=color, label=label, marker=".")
    wrong = [1.0 - row["accuracy"] for row in rows if row.get("accuracy") is not None]
    if len(wrong) == len(epochs):
        right.plot(epochs, wrong, "--", color=VALIDATION, label="wrong classes", marker=".")
    right.set(xlabel="epoch", ylabel="rms error, share of images")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    with written(file, file.name) as part:
        figure.savefig(part, dpi=130, format="png")
