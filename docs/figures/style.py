"""How the pictures look: boxes, chips, arrows, colours; and the data that a picture carries."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

IMAGES = Path(__file__).resolve().parents[1] / "images"

INK, QUIET, PAPER = "#1f2933", "#7b8794", "#ffffff"
TINTS = {
    "blue": ("#e3eefb", "#3b6fb6"),
    "green": ("#e3f4ea", "#2f8f5b"),
    "amber": ("#fdf1dc", "#b9770e"),
    "red": ("#fbe6e6", "#b84545"),
    "violet": ("#eeeafb", "#6a52b3"),
    "grey": ("#f0f2f5", "#7b8794"),
}
"""Name → (fill, edge)."""

CHIP_HEIGHT, CHIP_GAP, CHIP_LETTER = 0.26, 0.09, 0.079


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure whose axes count in inches."""
    matplotlib.rcParams["svg.hashsalt"] = "otwarp"
    figure = Figure(figsize=(width, height), facecolor=PAPER)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    return figure, axes


def box(axes: Axes, x: float, y: float, width: float, height: float, tint: str, *, dashed: bool = False) -> None:
    """A rounded box, lower left corner at (x, y)."""
    fill, edge = TINTS[tint]
    shape = f"round,pad=0,rounding_size={min(0.12, height / 3)}"
    line = (0, (4, 3)) if dashed else "solid"
    patch = FancyBboxPatch((x, y), width, height, boxstyle=shape, fc=fill, ec=edge, lw=1.2, ls=line, zorder=2)
    axes.add_patch(patch)


def text(axes: Axes, x: float, y: float, words: str, *, size: float = 9, **look: Any) -> None:
    """Words, from the left and centred on the line unless told otherwise."""
    look = {"ha": "left", "va": "center", "color": INK, "zorder": 4} | look
    axes.text(x, y, words, fontsize=size, **look)


def chips(axes: Axes, x: float, top: float, width: float, names: list[str], tint: str) -> float:
    """Small labels in rows that are filled from the left, the first row's middle at `top`; returns where they end."""
    at, row = x, top
    for name in names:
        long = CHIP_LETTER * len(name) + 0.16
        if at + long > x + width and at > x:
            at, row = x, row - CHIP_HEIGHT - CHIP_GAP
        shape = "round,pad=0,rounding_size=0.08"
        corner = (at, row - CHIP_HEIGHT / 2)
        axes.add_patch(
            FancyBboxPatch(corner, long, CHIP_HEIGHT, boxstyle=shape, fc=PAPER, ec=TINTS[tint][1], lw=0.7, zorder=3)
        )
        text(axes, at + long / 2, row - 0.01, name, size=8.2, ha="center")
        at += long + CHIP_GAP
    return row - CHIP_HEIGHT / 2 if names else top


def arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    bend: float = 0.0,
    color: str = INK,
    both: bool = False,
    width: float = 1.3,
    dashed: bool = False,
) -> None:
    """An arrow, straight or bent."""
    patch = FancyArrowPatch(
        start,
        end,
        arrowstyle="<|-|>" if both else "-|>",
        mutation_scale=11,
        connectionstyle=f"arc3,rad={bend}",
        color=color,
        lw=width,
        ls=(0, (4, 3)) if dashed else "solid",
        shrinkA=0,
        shrinkB=0,
        zorder=1,
    )
    axes.add_patch(patch)


def save(figure: Figure, name: str, data: Any) -> None:
    """Write docs/images/NAME.svg with `data` in its metadata."""
    metadata = {"Date": None, "Creator": "python -m docs.figures", "Description": json.dumps(data, ensure_ascii=True)}
    figure.savefig(IMAGES / f"{name}.svg", metadata=metadata)


def saved_data(name: str) -> Any:
    """What docs/images/NAME.svg says it shows."""
    found = re.search(r"<dc:description>(.*?)</dc:description>", (IMAGES / f"{name}.svg").read_text(), re.DOTALL)
    assert found, name
    return json.loads(
        found.group(1).replace("&quot;", '"').replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&")
    )
