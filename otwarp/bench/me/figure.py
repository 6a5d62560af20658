"""The picture of `otwarp bench me`: how much faster than the clock each scene runs, alone and many at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.bench.me.measure import MyBench
from otwarp.bench.me.table import digits
from otwarp.bench.picture import INK, pyplot, save_figure

MANY = "#e08a3c"
"""Colour of many worlds."""

HEIGHT = 0.24
"""Of a bar; scenes are 1 apart."""


def draw(bench: MyBench, file: Path) -> None:
    """Draw two bars for each scene, on a logarithmic axis, as PNG.

    Raises:
        InputError: The file cannot be written.
    """
    plt = pyplot()
    bills = bench.scenes
    figure, axes = plt.subplots(figsize=(8.0, 1.5 + 0.62 * len(bills)), layout="constrained")
    place = np.arange(len(bills), dtype=float)[::-1]
    for shift, colour, label, values in (
        (0.5, INK, "one world", [bill.factor.median for bill in bills]),
        (-0.5, MANY, "all worlds together", [bill.all_factor.median for bill in bills]),
    ):
        least = min(0.3, *(0.5 * bill.factor.median for bill in bills))
        axes.barh(
            place + 1.25 * HEIGHT * shift, np.array(values) - least, HEIGHT, left=least, color=colour, label=label
        )
        for y, value, bill in zip(place + 1.25 * HEIGHT * shift, values, bills, strict=True):
            many = f" ({bill.worlds:,} world{'' if bill.worlds == 1 else 's'})" if shift < 0.0 else ""
            axes.annotate(
                f"{digits(value)} ×{many}", (value, y), (4, 0), textcoords="offset points", va="center", fontsize=8
            )
    top = max(bill.all_factor.median for bill in bills)
    axes.set(xscale="log", xlim=(least, 60.0 * max(top, 1.0)), xlabel="simulated seconds per second")
    axes.set_yticks(place, [f"{bill.name}\n{bill.bodies:,} bod{'y' if bill.bodies == 1 else 'ies'}" for bill in bills])
    axes.axvline(1.0, color="#9aa3b2", lw=1.0, ls=":", zorder=0)
    axes.annotate("real time", (1.0, 1.0), (3, -2), xycoords=("data", "axes fraction"), textcoords="offset points",
                  va="top", fontsize=8, color="#6b7485")  # fmt: skip
    axes.grid(True, axis="x", which="major", color="#eceef2", lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    axes.set_title(bench.hardware + (", one core" if bench.kind == "cpu" else ""), fontsize=10, loc="left")
    save_figure(figure, file)
