"""Distribution functions of the picture of a study begin at 0 and end at 1, under a label that fits."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from otwarp.operators.figure import _contact


def test_distribution_functions_begin_at_0() -> None:
    figure = Figure(figsize=(3.4, 4.0), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axis = figure.add_subplot()
    _contact(axis, {"contact_mean": np.array([[3.0, 1.0, 2.0, 5.0], [0.5, 0.2, 0.4, 0.3]])}, ["without", "with"])
    for line, least in zip(axis.lines, (1.0, 0.2), strict=True):
        x, y = (np.asarray(v) for v in line.get_data())
        assert (x[0], y[0], y[-1]) == (least, 0.0, 1.0) and np.all(np.diff(y) == 0.25)
    canvas.draw()
    assert axis.xaxis.label.get_window_extent().width <= axis.bbox.width
