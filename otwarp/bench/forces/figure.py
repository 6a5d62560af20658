"""The picture of `otwarp bench forces`: error against time per step, one run or several over one another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from otwarp.bench.forces.result import Errors, ForcesBench, Row
from otwarp.bench.picture import INK, dress_panel, fill_of, finish_figure, line_of, pyplot, run_handles, save_figure

STYLES: dict[str, tuple[str, str, str]] = {
    "harmonic": ("harmonic, radial + axial", "s", "#8a8f98"),
    "isotropic": ("piecewise, isotropic", "^", "#d9822b"),
    "split": ("piecewise, radial + axial", "v", "#a8325e"),
    "bilinear": ("bilinear table", "o", "#2460a7"),
    "bicubic": ("bicubic table", "D", "#3d8b6d"),
    "exact": ("exact", "*", INK),
}
"""Label, marker and colour of each family."""

FRONT, FLOOR = "#c8ced8", "#9aa3b2"

PANELS: tuple[tuple[str, Callable[[Errors], float]], ...] = (
    ("largest error within {region:.3g} µm of the equilibrium", lambda e: e.largest),
    ("rms error where a trapped bead is", lambda e: e.thermal_rms),
)
"""What each panel shows."""


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Those (cost, error) pairs to which no other is preferable in both, by ascending cost."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


def draw_runs(runs: Sequence[ForcesBench], file: Path) -> None:
    """Draw runs of the same bead on different devices, to a temporary file that then takes the name.

    Args:
        runs: At least one.
        file: A PNG picture.

    Raises:
        InputError: The file cannot be written.
    """
    figure, panels = pyplot().subplots(1, 2, figsize=(11.0, 4.8), sharex=True, layout="constrained")
    for axes, (title, error) in zip(panels, PANELS, strict=True):
        for number, run in enumerate(runs):
            _draw_run(axes, run, error, number)
        dress_panel(axes, title=title.format(region=runs[0].region), xlabel="time per bead and step (ns)")
    panels[0].set_ylabel("error of the force / peak force")
    finish_figure(figure, _legend(runs), runs, columns=5)
    save_figure(figure, file)


def drawn_error(run: ForcesBench, row: Row, error: Callable[[Errors], float]) -> float:
    """Where the row stands: its error, or that of the exact forces it was judged by where that is larger."""
    assert row.errors is not None
    return max(error(row.errors), run.reference_error)


def _draw_run(axes: Any, run: ForcesBench, error: Callable[[Errors], float], number: int) -> None:
    """Pareto front, table families joined by lines, all markers with quartiles, and the floor without a trap."""
    line = line_of(number)
    rows = [row for row in run.rows if row.errors is not None]
    front = pareto_front([(row.cost.median, drawn_error(run, row, error)) for row in rows])
    axes.plot(*zip(*front, strict=True), drawstyle="steps-post", color=FRONT, lw=5.0, solid_capstyle="round", zorder=1)
    for row in run.rows:
        if row.errors is None:
            axes.axvline(row.cost.median, color=FLOOR, lw=1.0, ls=line, zorder=0)
    for family, (_, marker, colour) in STYLES.items():
        members = [row for row in rows if row.family == family]
        if not members:
            continue
        x, y = [row.cost.median for row in members], [drawn_error(run, row, error) for row in members]
        spread = [
            [row.cost.median - row.cost.low for row in members],
            [row.cost.high - row.cost.median for row in members],
        ]
        axes.errorbar(
            x,
            y,
            xerr=spread,
            ls=line if len(members) > 1 else "none",
            lw=1.2,
            elinewidth=0.8,
            marker=marker,
            ms=11 if marker == "*" else 6,
            color=colour,
            mfc=fill_of(number, colour),
            zorder=3,
        )
        for row, a, b in zip(members, x, y, strict=True):
            if row.tolerance is not None:
                # the two kinds of table stand side by side: label one on the left, the other on the right
                side = (-7, "right") if family == "bilinear" else (7, "left")
                axes.annotate(
                    f"{row.tolerance:.0e}".replace("e-0", "e-"),
                    (a, b),
                    xytext=(side[0], 0),
                    textcoords="offset points",
                    ha=side[1],
                    va="center",
                    fontsize=7,
                    color=colour,
                )


def _legend(runs: Sequence[ForcesBench]) -> list[Any]:
    """Handles: families, the floor, the front, and the runs if there are several."""
    from matplotlib.lines import Line2D

    found = {row.family for run in runs for row in run.rows}
    handles = [
        Line2D([], [], color=colour, marker=marker, ls="none", label=label)
        for family, (label, marker, colour) in STYLES.items()
        if family in found
    ]
    handles.append(Line2D([], [], color=FRONT, lw=5.0, label="nothing faster is more accurate"))
    if "none" in found:
        handles.append(Line2D([], [], color=FLOOR, lw=1.0, label="no trap: noise alone"))
    return handles + run_handles(runs)
