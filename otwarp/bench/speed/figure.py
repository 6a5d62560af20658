"""The picture of `otwarp bench speed`: a bar for every workload, peers in another colour, goals as marks."""

from __future__ import annotations

from pathlib import Path

from otwarp.bench.picture import pyplot, save_figure
from otwarp.bench.speed.result import SpeedBench
from otwarp.errors import InputError

OURS, PEERS, GOAL = "#2460a7", "#9aa3b2", "#a8325e"


def draw_speed(bench: SpeedBench, file: Path) -> None:
    """Draw to a temporary file that then takes the name.

    Raises:
        InputError: The file cannot be written, or nothing was measured.
    """
    units = list(dict.fromkeys(row.unit for row in bench.rows if row.rate is not None))
    if not units:
        raise InputError(f"--plot {file}: nothing was measured; allowed: a case that can run here")
    groups = [[row for row in bench.rows if row.unit == unit and row.rate is not None] for unit in units]
    heights = [len(group) for group in groups]
    figure, panels = pyplot().subplots(
        len(units), 1, figsize=(9.0, 1.2 + 0.28 * sum(heights) + 0.6 * len(units)), layout="constrained",
        squeeze=False, gridspec_kw={"height_ratios": heights},
    )  # fmt: skip
    for axes, unit, group in zip(panels[:, 0], units, groups, strict=True):
        for y, row in enumerate(group):
            assert row.rate is not None
            spread = [[row.rate.median - row.rate.low], [row.rate.high - row.rate.median]]
            axes.barh(y, row.rate.median, xerr=spread, color=PEERS if row.peer else OURS, height=0.7)
            if row.goal is not None:
                axes.plot([row.goal, row.goal], [y - 0.45, y + 0.45], color=GOAL, lw=2.0)
        axes.set(xscale="log", xlabel=unit, yticks=range(len(group)))
        axes.set_yticklabels([row.label for row in group], fontsize=8)
        axes.invert_yaxis()
        axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{bench.hardware}: otwarp, peers in grey, goals as red marks", fontsize=10)
    save_figure(figure, file)
