"""What the pictures of the benchmarks share: their look, how runs are told apart, and how they are written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from otwarp.bench.findings import BeadFindings
from otwarp.files import written

INK = "#20304a"
"""Colour of what belongs to no family."""

LINES = ("-", "--", ":", "-.")
"""Of the runs, in turn; the markers of the first are filled."""


def pyplot() -> Any:
    """`matplotlib.pyplot`, which needs no screen."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def line_of(number: int) -> str:
    """Line style of the n-th of the runs that share a panel, counted from 0; styles repeat."""
    return LINES[number % len(LINES)]


def fill_of(number: int, colour: str) -> str:
    """Fill of the markers of the n-th run, whose edges have that colour: filled for the first run alone."""
    return colour if number == 0 else "white"


def dress_panel(axes: Any, *, title: str, xlabel: str) -> None:
    """Make a panel of error against cost: logarithmic, with a faint grid behind."""
    axes.set(xscale="log", yscale="log", xlabel=xlabel)
    axes.set_title(title, fontsize=10, loc="left")
    axes.grid(True, which="major", color="#eceef2", lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def finish_figure(figure: Any, handles: list[Any], runs: Sequence[BeadFindings], *, columns: int) -> None:
    """Put a legend of at most so many columns below, and the bead above."""
    ncols = min(columns, len(handles))
    figure.legend(handles=handles, loc="outside lower center", ncols=ncols, frameon=False, fontsize=8)
    figure.suptitle(runs[0].bead(), fontsize=10)


def run_handles(runs: Sequence[BeadFindings]) -> list[Any]:
    """Handles of the runs for a legend."""
    from matplotlib.lines import Line2D

    handles = []
    for number, run in enumerate(runs):
        name = run.hardware if run.kind == "cuda" else f"{run.hardware}, one thread"
        look: dict[str, Any] = {"ls": line_of(number), "marker": "o", "ms": 5, "mfc": fill_of(number, INK)}
        handles.append(Line2D([], [], color=INK, label=name, **look))
    return handles


def save_figure(figure: Any, file: Path) -> None:
    """Write a PNG picture to a temporary file that then takes the name, and close the figure.

    Raises:
        InputError: The file cannot be written.
    """
    try:
        with written(file, f"--plot {file}") as part:
            figure.savefig(part, dpi=160, format="png")
    finally:
        pyplot().close(figure)
