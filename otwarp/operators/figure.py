"""A picture of a study of SIMULATED operators, which says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.operators.folder import Folder
from otwarp.operators.summary import LITERATURE, MEASURES, summarise
from otwarp.operators.task import OUTCOMES

COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#999999")
"""Okabe and Ito's, which colour-blind people tell apart."""
WORDS = {"without": "no haptics", "with": "haptics", "no response": "haptics,\narm alone"}
"""Conditions in words."""

ABOVE: Any = {"loc": "lower left", "bbox_to_anchor": (-0.05, 1.0), "ncols": 2, "fontsize": 8, "frameon": False}
"""Legends stand above their panels, where they cover nothing."""


def draw(folder: Folder, file: Path) -> Path:
    """Draw outcomes, contact force and differences beside the literature's.

    Args:
        folder: The study.
        file: Gets the picture, PNG, SVG or PDF by its ending.

    Raises:
        InputError: Nothing computed yet, or an ending that is none of these.
    """
    if file.suffix not in (".png", ".svg", ".pdf"):
        raise InputError(f"--plot is {file}; allowed: a file that ends with .png, .svg or .pdf")
    found, arrays = summarise(folder), folder.read()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.6, 4.4), layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=(1.1, 1.1, 1.5))
    conditions = list(found["success"])
    _outcomes(axes[0], found, conditions)
    _contact(axes[1], arrays, conditions)
    _differences(axes[2], found)
    figure.suptitle(f"{found['operators']:,} simulated operators, the same with and without haptics", fontsize=10)
    with written(file) as part:
        figure.savefig(part, dpi=160)
    return file


def _outcomes(axis: Any, found: dict[str, Any], conditions: list[str]) -> None:
    """Stacked shares of outcomes, with the interval of the deliveries."""
    base = np.zeros(len(conditions))
    at = np.arange(len(conditions))
    for said, color in zip(OUTCOMES.values(), COLORS, strict=True):
        share = np.array([found["outcomes"][c][said] for c in conditions]) / found["operators"]
        if share.any():
            axis.bar(at, share, bottom=base, color=color, width=0.6, label=said)
        base += share
    rates = [found["success"][c] for c in conditions]
    middle = np.array([r["value"] for r in rates])
    ends = np.abs(np.array([[r["low"] for r in rates], [r["high"] for r in rates]]) - middle)
    axis.errorbar(at, middle, ends, fmt="none", ecolor="black", capsize=4, lw=1)
    axis.set_xticks(at, [WORDS[c] for c in conditions])
    axis.set_ylim(0, 1)
    axis.set_ylabel("share of simulated trials")
    axis.legend(**ABOVE)


def _contact(axis: Any, arrays: dict[str, np.ndarray], conditions: list[str]) -> None:
    """Distribution functions of the mean contact force."""
    for n, condition in enumerate(conditions):
        row = np.sort(arrays["contact_mean"][n])
        row = row[np.isfinite(row)]
        share = np.arange(len(row) + 1) / max(len(row), 1)
        axis.step(np.concatenate([row[:1], row]), share, where="post", color=COLORS[n],
                  linestyle="--" if n == 2 else "-", label=WORDS[condition].replace("\n", " "))  # fmt: skip
    axis.set_xlabel("mean contact force on the cell [pN]", fontsize=9)
    axis.set_ylabel("share of simulated operators below")
    axis.set_ylim(0, 1)
    axis.legend(**ABOVE)


def _differences(axis: Any, found: dict[str, Any]) -> None:
    """Standardised differences of the study and of meta-analyses."""
    compared = found["compared"].get("with − without")
    rows: list[tuple[str, Any, str]] = []
    if compared is not None:
        rows.append(("success, simulated", {"value": compared["g of success"]}, COLORS[0]))
        rows += [
            (f"{MEASURES[n][0]}, simulated", compared["g"][n], COLORS[0])
            for n in ("contact_mean", "contact_peak", "distance_mean")
            if n in compared["g"]
        ]
        if "time" in compared["g where both delivered"]:
            rows.append(("time where both delivered, simulated", compared["g where both delivered"]["time"], COLORS[0]))
    rows.append(("success, the paper's 10 + 10 people", {"value": found["paper"]["g of success"]}, COLORS[1]))
    rows += [(f"{name}, people", found["literature"][name], COLORS[4]) for name in LITERATURE]
    for n, (_, row, color) in enumerate(rows):
        if row["value"] is None:
            continue
        axis.plot(row["value"], -n, "o", color=color)
        if row.get("low") is not None:
            axis.plot([row["low"], row["high"]], [-n, -n], color=color)
    axis.axvline(0.0, color="black", lw=0.8)
    axis.set_yticks(-np.arange(len(rows)), [name for name, *_ in rows], fontsize=8)
    axis.set_xlabel("Hedges' g; above 0: better with haptics")
