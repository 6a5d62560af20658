"""The central figure: error against run time per simulated relaxation time, one panel for each observable."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.bench.integrators.cases import PLAIN
from otwarp.bench.integrators.observables import PANELS, bound_of
from otwarp.bench.integrators.result import WANTED, IntegratorsBench, Line
from otwarp.bench.picture import INK, dress_panel, fill_of, finish_figure, line_of, pyplot, run_handles, save_figure

STYLES: dict[str, tuple[str, str]] = {
    "eulerMaruyama": ("o", "#8a8f98"),
    PLAIN: ("X", "#c9a27a"),
    "leimkuhlerMatthews": ("^", "#d9822b"),
    "heun": ("D", "#2460a7"),
    "exponential": ("s", "#3d8b6d"),
}
"""Marker and colour of each integrator."""

VARIANTS: dict[str, tuple[str, str]] = {
    "harmonic": ("v", "#a8325e"),
    "piecewise": ("P", "#a8325e"),
    "bilinear-1e-3": ("<", "#a8325e"),
    "bicubic-1e-3": (">", "#a8325e"),
    "bicubic-1e-4": ("p", "#a8325e"),
    "float32": ("1", INK),
    "float32, fast_math": ("2", INK),
    "float64": ("3", INK),
}
"""Marker and colour of force models and precisions, at their default steps."""

TITLES = {
    "variance": "variances ⟨x² + y²⟩ and ⟨δz²⟩",
    "correlation": "correlations after a relaxation time",
    "escape": "mean escape time",
}

LEAST = 1e-4
"""Errors are not drawn below."""


def draw_integrators(runs: Sequence[IntegratorsBench], file: Path) -> None:
    """Draw runs of the same bead on different devices, to a temporary file that then takes the name.

    Args:
        runs: At least one.
        file: A PNG picture.

    Raises:
        InputError: The file cannot be written.
    """
    figure, panels = pyplot().subplots(
        1, len(PANELS), figsize=(14.0, 5.4), sharex=True, sharey=True, layout="constrained"
    )
    for axes, panel in zip(panels, PANELS, strict=True):
        axes.axhline(100.0 * WANTED, color="#c8ced8", lw=3.0, zorder=0)
        for number, run in enumerate(runs):
            for line in run.lines:
                _draw_line(axes, line, panel, number)
            _mark_default(axes, run, panel)
        dress_panel(axes, title=TITLES[panel], xlabel="run time per bead and relaxation time γ/k (ns)")
    panels[0].set_ylabel("relative error (%)")
    finish_figure(figure, _legend(runs), runs, columns=6)
    save_figure(figure, file)


def drawn(line: Line, panel: str) -> list[tuple[float, float, float, bool]]:
    """(time [ns], size of the error, its standard error, whether it is a bound) at every step where it was measured."""
    out = []
    for point in line.points:
        found = point.panel(panel)
        if found is not None:
            size, bound = bound_of(found)
            out.append((line.time(point.product), max(size, LEAST), found.error, bound))
    return out


def error_at(line: Line, panel: str, product: float) -> float | None:
    """Size of the error at any step, log–log between the measured ones; None outside of them."""
    rows = sorted(drawn(line, panel))
    here = line.time(product)
    if not rows or not rows[0][0] <= here <= rows[-1][0]:
        return None
    time, error = np.log(np.array([row[:2] for row in rows])).T
    return float(np.exp(np.interp(np.log(here), time, error)))


def _draw_line(axes: Any, line: Line, panel: str, number: int) -> None:
    marker, colour = STYLES.get(line.name) or VARIANTS.get(line.name, (".", INK))
    rows = drawn(line, panel)
    if not rows:
        return
    fill = fill_of(number, colour)
    if len(rows) > 1:
        # a line through bounds would show what was not seen
        sizes = [np.nan if r[3] else 100.0 * r[1] for r in rows]
        axes.plot([r[0] for r in rows], sizes, ls=line_of(number), lw=1.2, color=colour, zorder=2)
    for seen in (True, False):
        chosen = [r for r in rows if r[3] != seen]
        if not chosen:
            continue
        t, e, s = [r[0] for r in chosen], [100.0 * r[1] for r in chosen], [100.0 * r[2] for r in chosen]
        # a bound hangs from its marker; the arrow's length means nothing
        bars = s if seen else [0.3 * v for v in e]
        look: dict[str, Any] = {"ls": "none", "elinewidth": 0.8, "color": colour, "ms": 6, "zorder": 3}
        axes.errorbar(t, e, yerr=bars, uplims=not seen, marker=marker, mfc=fill, alpha=1.0 if seen else 0.45, **look)


def _mark_default(axes: Any, run: IntegratorsBench, panel: str) -> None:
    """A ring where otwarp steps by itself."""
    line = run.line(run.default)
    error = error_at(line, panel, run.default_product)
    if error is not None:
        time = line.time(run.default_product)
        axes.plot([time], [100.0 * error], marker="o", ms=15, mfc="none", mec=INK, mew=1.4, ls="none", zorder=4)


def _legend(runs: Sequence[IntegratorsBench]) -> list[Any]:
    """Handles: cases, the default, what is wanted, and the runs."""
    from matplotlib.lines import Line2D

    labels = {line.name: line.label for run in runs for line in run.lines}
    looks = {**STYLES, **VARIANTS}
    handles = []
    for name, label in labels.items():
        marker, colour = looks.get(name, (".", INK))
        style = "-" if name in STYLES else "none"
        handles.append(Line2D([], [], color=colour, marker=marker, ls=style, lw=1.2, label=label))
    ring = {"marker": "o", "ms": 11, "mfc": "none", "mec": INK, "ls": "none"}
    handles.append(Line2D([], [], label="the default at its own step", **ring))
    handles.append(Line2D([], [], color="#c8ced8", lw=3.0, label=f"{100.0 * WANTED:g} %"))
    return handles + run_handles(runs)
