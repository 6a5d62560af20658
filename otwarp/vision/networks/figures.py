"""Pictures of an evaluation: confusion of tilts, errors over depth, and whether the stated uncertainty is right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from otwarp.files import written
from otwarp.vision.networks.estimate import ANGLES
from otwarp.vision.networks.evaluate import Evaluation

COLORS = {"x": "#0072b2", "y": "#56b4e9", "depth": "#d55e00", "tilt": "#009e73", "yaw": "#cc79a7"}
"""Okabe and Ito's, which colour-blind people tell apart."""

MARKERS = {"x": "o", "y": "s", "depth": "^", "tilt": "D", "yaw": "v"}

BINS = 12


def draw_confusion(file: Path, evaluation: Evaluation, classes: Sequence[float]) -> bool:
    """Draw which tilts were taken for which; False where the data set has no classes."""
    from matplotlib.figure import Figure

    table = np.array(evaluation.scores.get("confusion", []), dtype=float)
    if not table.size:
        return False
    share = table / np.maximum(table.sum(1, keepdims=True), 1.0)
    side = max(3.2, 0.26 * len(classes) + 1.6)
    figure = Figure(figsize=(side + 0.8, side), layout="constrained")
    axes = figure.add_subplot()
    shown = axes.imshow(share, cmap="cividis", vmin=0.0, vmax=1.0, origin="lower")
    ticks = range(0, len(classes), max(1, len(classes) // 10))
    names = [f"{classes[n]:g}" for n in ticks]
    axes.set(xlabel="tilt as said [°]", ylabel="true tilt [°]", xticks=ticks, yticks=ticks)
    axes.set_xticklabels(names, rotation=90 if len(classes) > 8 else 0)
    axes.set_yticklabels(names)
    axes.set_title(f"{evaluation.name}: {evaluation.scores['accuracy']:.3f} right", fontsize=10)
    figure.colorbar(shown, label="share of the images of a tilt")
    _save(file, figure)
    return True


def draw_errors(file: Path, evaluation: Evaluation, names: Sequence[str]) -> bool:
    """Draw errors over depth, as they are and as the network states them; False without a pose's head."""
    from matplotlib.figure import Figure

    drawn = evaluation.errors
    if "sigma" not in drawn:
        return False
    figure = Figure(figsize=(3.0 * len(names), 2.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(names)))
    edges = np.linspace(drawn["depth"].min(), drawn["depth"].max() + 1e-9, BINS + 1)
    of = np.clip(np.digitize(drawn["depth"], edges) - 1, 0, BINS - 1)
    filled = [b for b in range(BINS) if np.any(of == b)]
    middle = [0.5 * (edges[b] + edges[b + 1]) for b in filled]
    for n, (axes, name) in enumerate(zip(panels, names, strict=True)):
        unit = math.degrees(1.0) if name in ANGLES else 1.0
        for values, style, label in ((drawn["away"], "-", "error"), (drawn["sigma"], "--", "stated")):
            rms = [unit * np.sqrt(np.mean(values[of == b, n] ** 2)) for b in filled]
            axes.plot(middle, rms, style, marker=MARKERS[name], markersize=3, color=COLORS[name], label=label)
        axes.set(xlabel="depth [µm]", ylabel=f"{name}, root mean square [{'°' if name in ANGLES else 'µm'}]")
        axes.set_ylim(bottom=0.0)
        axes.legend(frameon=False, fontsize=8)
    _save(file, figure)
    return True


def draw_calibration(file: Path, evaluation: Evaluation, names: Sequence[str]) -> bool:
    """Draw which share of errors lies within the interval of each stated probability; False without a pose's head."""
    from matplotlib.figure import Figure
    from scipy.special import erfinv

    drawn = evaluation.errors
    if "sigma" not in drawn:
        return False
    figure = Figure(figsize=(3.6, 3.4), layout="constrained")
    axes = figure.add_subplot()
    stated = np.linspace(0.05, 0.99, 25)
    away = np.abs(drawn["away"]) / drawn["sigma"]
    for n, name in enumerate(names):
        found = [np.mean(away[:, n] <= math.sqrt(2.0) * erfinv(p)) for p in stated]
        axes.plot(stated, found, color=COLORS[name], marker=MARKERS[name], markersize=3, label=name)
    axes.plot([0, 1], [0, 1], ":", color="black", linewidth=1, label="right")
    axes.set(xlabel="stated probability of an interval", ylabel="share of errors within it", xlim=(0, 1), ylim=(0, 1))
    axes.legend(frameon=False, fontsize=8)
    _save(file, figure)
    return True


def _save(file: Path, figure: object) -> None:
    with written(file, file.name) as part:
        figure.savefig(part, dpi=130, format="png")  # type: ignore[attr-defined]
