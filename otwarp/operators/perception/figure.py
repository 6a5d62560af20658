"""Maps of a sweep of SIMULATED operators over two axes, or curves over one; they say that they are simulated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.files import save_picture
from otwarp.operators.figure import COLORS
from otwarp.operators.perception.summary import COMPARED, MARGIN, Maps, as_good

PANELS = {
    "success": "deliveries, share of simulated trials",
    "contact_mean": "mean contact force on the cell [pN]",
    "force_rmse_pn": "force error, root mean square [pN]",
    "direction_error": "error of the force's direction [°]",
}
"""What is drawn, and what stands beside it."""
LABELS = {
    "delay": ("delay [ms]", 1e3),
    "depth_error": ("depth error [µm]", 1.0),
    "tilt_error": ("tilt error [°]", 1.0),
    "frame_rate": ("pictures per second", 1.0),
    "lateral_error": ("error along x and y [µm]", 1.0),
}
"""Labels of axes, and what their values are multiplied by."""
PAPER_NETWORKS = {"VGG16": 0.1194, "ResNet18": 0.0288, "ResNet50": 0.0413}
"""Depth errors of the paper's networks, root mean squares normalised to each pose's sweep."""
DEPTH_RANGE = 20.0
"""Length of such a sweep [µm]: assumed, the paper does not say it; related work sweeps ±10 µm."""
CLOSE = 0.12
"""Lines of networks nearer than this, in rows of the map, share a label."""
LETTER, GAP, WIDTH, HIGH = 0.09, 0.08, 3.7, 24
"""Width of a letter in labels of ticks, of what is free between two, of a panel [inches]; labels one above another."""
LINES: dict[str, tuple[str, Literal["-", "--"], Literal["o", "x"]]] = {
    "perfect": ("as good as no error", "-", "o"),
    "without": ("worse than no haptics", "--", "x"),
}
"""Contours, with what the cells within them are, style and mark; by intervals of 95 %, the first with a margin."""
UNITS = {"success": "", "contact_mean": " pN"}
"""Of the margins."""


def draw_maps(
    found: Maps, file: Path, *, networks: Mapping[str, float] | None = None, depth_range: float = DEPTH_RANGE
) -> Path:
    """Draw `PANELS` over the first two axes that have more than one value, or over one.

    Args:
        found: The sweep.
        file: Gets the picture, PNG, SVG or PDF by its ending.
        networks: Depth errors of networks by name [µm], drawn beside the paper's.
        depth_range: By which the paper's, which are normalised, are multiplied [µm].

    Raises:
        InputError: Another ending, or no axis with more than one value.
    """
    if file.suffix not in (".png", ".svg", ".pdf"):
        raise InputError(f"--plot is {file}; allowed: a file that ends with .png, .svg or .pdf")
    wide = [name for name, values in found.axes.items() if len(values) > 1]
    if not wide:
        raise InputError("--plot of a single cell; allowed: a sweep over one axis or more, or no --plot")
    save_picture(drawn_maps(found, wide, networks or {}, depth_range), file)
    return file


def drawn_maps(found: Maps, wide: list[str], networks: Mapping[str, float], depth_range: float) -> Any:
    """The figure of `draw_maps`, over the first two of the axes `wide`, or the only one."""
    from matplotlib.figure import Figure

    panels = [name for name in PANELS if name in found.maps]
    figure = Figure(figsize=(11.6, 8.6), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    for axis, name in zip(axes, panels, strict=False):
        if len(wide) == 1:
            _curve(axis, found, name, wide[0])
        else:
            _map(axis, found, name, wide[0], wide[1])
            if wide[1] == "depth_error":
                _mark_networks(axis, found, networks, depth_range, last=axis is axes[len(panels) - 1])
    rest = {n: v[len(v) // 2] for n, v in found.axes.items() if n not in wide[:2] and (len(v) > 1 or n == "frame_rate")}
    said = "".join(f", {LABELS[n][0]} {v * LABELS[n][1]:g}" for n, v in rest.items())
    figure.suptitle(f"{found.operators:,} simulated operators in every cell, the same in all{said}", fontsize=10)
    return figure


def _plane(found: Maps, name: str, wide: list[str]) -> np.ndarray:
    """Values over some axes, the other ones at the middle of theirs."""
    at = tuple(slice(None) if n in wide else len(v) // 2 for n, v in found.axes.items())
    return found.maps[name][at]


def _ticks(found: Maps, name: str, *, across: bool) -> tuple[list[int], list[str]]:
    """Places of the values along an axis of a map, and what they are called: as many as can be read."""
    names = [f"{v:g}" for v in found.axes[name] * LABELS[name][1]]
    wide = sum(LETTER * len(said) + GAP for said in names) / WIDTH if across else len(names) / HIGH
    step = max(1, math.ceil(wide))
    return list(range(0, len(names), step)), names[::step]


def _map(axis: Any, found: Maps, name: str, across: str, up: str) -> None:
    """A number over two axes, with the contours of what it is compared with."""
    plane = _plane(found, name, [across, up]).T
    drawn = axis.imshow(plane, origin="lower", aspect="auto", cmap="viridis", interpolation="nearest")
    if name == "success" and np.ptp(plane) == 0.0:
        drawn.set_clim(0.0, 1.0)  # about a single value there would be shares below 0 or above 1
    axis.figure.colorbar(drawn, ax=axis, label=PANELS[name] + ", simulated")
    axis.set_xticks(*_ticks(found, across, across=True))
    axis.set_yticks(*_ticks(found, up, across=False))
    axis.set(xlabel=LABELS[across][0], ylabel=LABELS[up][0])
    if name in COMPARED:
        _contours(axis, found, name, across, up)


def bounds(found: Maps, name: str, across: str, up: str) -> dict[str, np.ndarray]:
    """What is below 0 in the cells of each of `LINES`, (up, across): as good as no error, worse than no haptics."""
    sign, wide = COMPARED[name][1], [across, up]
    end = "_high" if sign > 0.0 else "_low"
    low, high = (_plane(found, f"{name}_minus_perfect{which}", wide).T for which in ("_low", "_high"))
    return {
        "perfect": np.asarray(as_good(low, high, name)),
        "without": sign * _plane(found, f"{name}_minus_without{end}", wide).T,
    }


def where_it_is(inside: np.ndarray, other: str, operators: int) -> str:
    """What the legend says of a contour that is not there; few operators show nowhere that a cell is as good."""
    if inside.all():
        return " (everywhere)"
    if inside.any():
        return ""
    return f" (nowhere shown by {operators:,} operators)" if other == "perfect" else " (nowhere)"


def _contours(axis: Any, found: Maps, name: str, across: str, up: str) -> None:
    """Marks in cells that are as good or worse, lines around these; the legend says where it is all or none.

    Its rows stand one above the other: beside each other they are wider than a panel, which shrinks to make room.
    """
    from matplotlib.lines import Line2D

    handles = []
    for (other, bound), color in zip(bounds(found, name, across, up).items(), ("white", COLORS[1]), strict=True):
        meaning, style, mark = LINES[other]
        inside = bound < 0.0
        some = inside.any() and not inside.all()
        if some and min(bound.shape) > 1:
            drawn = axis.contour(bound, levels=[0.0], colors=[color], linestyles=style, linewidths=1.8)
            drawn.set_path_effects(_outlined(3.0))
        if some:
            y, x = np.nonzero(inside)
            axis.plot(x + (0.12 if mark == "x" else -0.12), y, mark, color=color, ms=3, mew=1)
        margin = f", to {MARGIN[name]:g}{UNITS[name]}" if other == "perfect" else ""
        where = where_it_is(inside, other, found.operators)
        handles.append(Line2D([], [], color=color, linestyle=style, marker=mark, ms=4, label=meaning + margin + where))
    axis.legend(
        handles=handles, fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 1.0), facecolor="0.35", labelcolor="white",
    )  # fmt: skip


def _outlined(width: float) -> list[Any]:
    """Effects that make white legible on any colour, an outline of so many points."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground="0.25")]


def _mark_networks(axis: Any, found: Maps, networks: Mapping[str, float], depth_range: float, *, last: bool) -> None:
    """Depth errors of networks as lines across a map; those above it are named below the last one."""
    values = found.axes["depth_error"]
    all_of = {f"{n} (paper)": e * depth_range for n, e in PAPER_NETWORKS.items()} | dict(networks)
    beyond, names = [], {}
    for name, error in sorted(all_of.items(), key=lambda row: row[1]):
        if not values[0] <= error <= values[-1]:
            beyond.append(f"{name} {error:.2g} µm")
            continue
        place = float(np.interp(error, values, np.arange(len(values))))
        axis.axhline(place, color="white", lw=0.9, ls=":")
        near = next((other for other in names if abs(other - place) < CLOSE), place)
        names[near] = f"{names[near]}; {name} {error:.2g}" if near in names else f"{name} {error:.2g}"
    for place, said in names.items():
        axis.text(0.98, place, said, color="white", fontsize=6.5, va="bottom", ha="right",
                  transform=axis.get_yaxis_transform(), path_effects=_outlined(1.5))  # fmt: skip
    if last:
        said = f"Networks: the paper's depth errors times an assumed range of {depth_range:g} µm"
        said += f"; beyond the map: {', '.join(beyond)}" if beyond else ""
        axis.figure.supxlabel(said, fontsize=8)


def _curve(axis: Any, found: Maps, name: str, across: str) -> None:
    """A number over one axis, beside perfect perception and no haptics."""
    row = _plane(found, name, [across])
    x = found.axes[across] * LABELS[across][1]
    axis.plot(x, row, "o-", color=COLORS[0], ms=3, label="with these errors")
    if f"{name}_low" in found.maps:
        ends = (_plane(found, f"{name}{end}", [across]) for end in ("_low", "_high"))
        axis.fill_between(x, *ends, color=COLORS[0], alpha=0.2, lw=0)
    for (other, said), color in zip((("perfect", "no error"), ("without", "no haptics")), COLORS[1:], strict=False):
        value = found.beside[other].get(name, np.nan)
        if np.isfinite(value):
            axis.axhline(value, color=color, ls="--", lw=1, label=said)
    axis.set(xlabel=LABELS[across][0], ylabel=PANELS[name] + ", simulated")
    axis.legend(fontsize=8)
