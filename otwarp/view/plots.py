"""The plots of a page: charts of one run or of two, one above the other, with a cursor at the time shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.view.curves import Chart, series
from otwarp.view.theme import Theme

if TYPE_CHECKING:
    import viser

HEIGHT = 190
"""Of a plot [pixels]."""


class Plots:
    """Plots in a container of viser's panel.

    Args:
        gui: Of viser.
        place: The container.
        theme: Colours.
    """

    def __init__(self, gui: viser.GuiApi, place: Any, theme: Theme):
        self._gui, self._place, self._theme = gui, place, theme
        self._handles: list[Any] = []

    def show(self, runs: Sequence[Sequence[Chart]], names: Sequence[str], span: tuple[float, float]) -> None:
        """Draw the charts of runs, those of the same quantity together, in place of what was there.

        Args:
            runs: Charts of one run, or of two.
            names: Of the runs.
            span: First and last time of the axis [s].
        """
        for handle in self._handles:
            handle.remove()
        self._handles = []
        keys = [chart.key for run in runs for chart in run]
        for key in dict.fromkeys(keys):
            parts = [(n, chart) for n, run in enumerate(runs) for chart in run if chart.key == key]
            with self._place:
                self._handles.append(self._plot(parts, names, span))

    def _plot(self, parts: Sequence[tuple[int, Chart]], names: Sequence[str], span: tuple[float, float]) -> Any:
        theme, first = self._theme, parts[0][1]
        styles: list[Any] = [{"label": "s"}]
        for n, chart in parts:
            for k, name in enumerate(chart.names):
                look = {"stroke": theme.curves[k % len(theme.curves)], "width": 1.5, "points": {"show": False}}
                label = name if len(names) == 1 else f"{names[n]}: {name}"
                styles.append({"label": label, **look, **({"dash": (5, 4)} if n else {})})
        for name, _ in first.lines:
            styles.append(
                {"label": name, "stroke": theme.warning, "width": 1.25, "dash": (8, 5), "points": {"show": False}}
            )
        axis = {"stroke": theme.axis, "grid": {"stroke": theme.grid, "width": 1}}
        axis["ticks"] = {"stroke": theme.grid, "size": 4}
        return self._gui.add_uplot(
            series([chart for _, chart in parts]),
            series=tuple(styles),
            title=first.title,
            scales={"x": {"time": False, "range": span}, "y": {"range": heights([chart for _, chart in parts])}},
            axes=({**axis, "size": 28}, {**axis, "size": 46}),  # type: ignore[arg-type]
            legend={"show": True, "live": False},
            cursor={"drag": {"x": False, "y": False}},  # its zoom would leave the cursor behind
            height=HEIGHT,
            padding=(6, 10, 0, 0),
        )


def heights(parts: Sequence[Chart]) -> tuple[float, float]:
    """Ends of the vertical axis: zero, and above all finite values and lines."""
    top = max(float(np.nanmax(chart.values, initial=0.0)) for chart in parts)
    lines = [height for chart in parts for _, height in chart.lines]
    # a warning far above everything would press the curves onto the axis
    top = max([top, *(h for h in lines if h <= 4.0 * top)]) or max(lines, default=1.0)
    return 0.0, 1.06 * top
