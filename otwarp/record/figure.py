"""`figure.png`: where things went, how hard they were pressed, and how far the robots were from their traps.

Everything is read from `run.nc`, so the figure can be made again: `otwarp.record.draw("out/run")`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.files import written
from otwarp.record.footprint import outlines
from otwarp.record.read import Run, read_run
from otwarp.scene.transforms import rotate

ROBOT_COLOURS = ("#2460a7", "#d9822b", "#3d8b6d", "#7a5195")
CELL_COLOUR, OTHER_COLOUR, FORCE_COLOUR, WARNING_COLOUR = "#a8325e", "#8a8f98", "#c62828", "#c62828"
OBSTACLE_FILL, OBSTACLE_EDGE, GOAL_COLOUR = "#dfe1e6", "#9aa0ab", "#2f7d46"

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"],
    "font.size": 8.5,
    "axes.linewidth": 0.7,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.solid_capstyle": "round",
}

ARROWS = 18
"""Contact-force arrows per robot along its path."""

SNAPSHOTS = 6
"""How often the robots and the cell are drawn along their paths."""

SMOOTHING = 40
"""A trace with more than five times as many frames gets a running mean over so many parts of the run."""

ARROW_SHARE = 0.065
"""Length of the largest contact-force arrow, as a share of the map."""

WIDE = 1.25
"""A map wider than this times its height goes above the time panels, otherwise beside them."""


def draw(folder: str | Path, *, world: int = 0, out: str | Path | None = None) -> Path:
    """Draw the figure of a recorded run.

    Panels: (a) paths in the x–y plane with obstacles and the contact forces on the robots; (b) contact force and
    (c) robot–trap distance over time with their warning lines. Panels that would say nothing are left out.

    Args:
        folder: Folder of the run, holding `run.nc`.
        world: Which world.
        out: PNG to write; None writes `figure.png` into the folder.

    Returns:
        The file written.

    Raises:
        InputError: No run there, or no such world.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    run = read_run(Path(folder) / "run.nc", world)
    path = Path(out) if out is not None else Path(folder) / "figure.png"
    panels = time_panels(run)
    low, high = map_limits(run)
    span = high - low
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=figure_size(span, len(panels)), dpi=200, layout=ConstrainedLayoutEngine(wspace=0.05))
        FigureCanvasAgg(figure)
        axes = _axes(figure, span, [name for name, _ in panels])
        _draw_map(axes["map"], run, low, high)
        if panels:
            _letter(axes["map"], "a")
        for letter, (name, drawer) in zip("bc", panels, strict=False):
            drawer(axes[name], run)
            _letter(axes[name], letter)
            axes[name].set_xlabel("time (s)")
        with written(path) as part:
            figure.savefig(part, facecolor="white", format="png")
    return path


def time_panels(run: Run) -> list[tuple[str, Any]]:
    """Names and drawers of the panels over time that have something to show."""
    if len(run.time) < 2:
        return []
    panels = []
    if run.force[:, run.robots].any():
        panels.append(("force", _draw_force))
    if np.isfinite(run.distance).any():
        panels.append(("distance", _draw_distance))
    return panels


def map_limits(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (2,) of the map [µm]: paths, goal, and the obstacles that are not walls around it all."""
    reach = [float((np.linalg.norm(s[:, :3], axis=1) + s[:, 3]).max()) for s in run.spheres]
    pieces = [run.position[:, n, :2] + s * reach[n] for n in range(len(reach)) for s in (-1, 1)]
    if len(run.rest):
        pieces += [run.rest[:, :2] + s * run.rest_radius[:, None] for s in (-1, 1)]
    goal = run.layout["goal"]
    if goal is not None:
        pieces += [np.array([goal["position"][:2]]) + s * goal["tolerance"] for s in (-1.0, 1.0)]
    points = np.concatenate(pieces) if pieces else np.array([[-10.0, -10.0], [10.0, 10.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    for polygon in _obstacles(run, run.time[0]) + _obstacles(run, run.time[-1]):
        size = np.ptp(polygon, axis=0).max()
        gap = np.maximum(polygon.min(axis=0) - high, low - polygon.max(axis=0)).max()
        if size < 0.5 * extent and gap < 0.15 * extent:
            low, high = np.minimum(low, polygon.min(axis=0)), np.maximum(high, polygon.max(axis=0))
    # a lone bead that hardly moves still needs some room around it
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    half = np.maximum(half, 0.33 * half.max())
    # room for the arrows, or just a margin
    half = half + (ARROW_SHARE if run.force[:, run.robots].any() else 0.03) * half.max() * 1.2
    return centre - half, centre + half


def figure_size(span: np.ndarray, panels: int) -> tuple[float, float]:
    """Width and height of the figure [inch] for a map of the given span."""
    aspect = span[0] / span[1]
    if panels == 0:
        return (5.2, 5.2 / aspect + 0.5) if aspect > 1.0 else (4.4 * aspect + 0.8, 4.8)
    if aspect > WIDE:
        return 7.2, 6.5 / aspect + 2.6
    return 3.9 * aspect + 4.0, 4.3


def _axes(figure: Any, span: np.ndarray, names: list[str]) -> dict[str, Any]:
    if not names:
        return {"map": figure.add_subplot()}
    if span[0] / span[1] > WIDE:
        heights = [6.5 * span[1] / span[0], 2.2]
        return figure.subplot_mosaic([["map"] * len(names), names], height_ratios=heights)
    widths = [3.9 * span[0] / span[1], 3.4]
    return figure.subplot_mosaic([["map", name] for name in names], width_ratios=widths)


def _letter(axes: Any, letter: str) -> None:
    axes.set_title(letter, loc="left", fontweight="bold", fontsize=10.5, pad=6)


def _obstacles(run: Run, time: float) -> list[np.ndarray]:
    """Outlines of the obstacles that reach into the layer in which the bodies moved."""
    heights = np.concatenate([run.position[:, :, 2].ravel(), run.rest[:, 2]])
    reach = run.radius.max(initial=0.0)
    low, high = (heights.min() - reach, heights.max() + reach) if len(heights) else (-np.inf, np.inf)
    return [p for o in run.layout["obstacles"] for p in outlines(o, time, low, high)]


def _draw_map(axes: Any, run: Run, low: np.ndarray, high: np.ndarray) -> None:
    from matplotlib.collections import EllipseCollection, PolyCollection

    start, end = run.time[0], run.time[-1]
    resting = {"facecolors": OBSTACLE_FILL, "edgecolors": OBSTACLE_EDGE, "linewidths": 0.7}
    axes.add_collection(PolyCollection(_obstacles(run, end), **resting, zorder=1))
    moving = [o for o in run.layout["obstacles"] if len(o["position"]["times"]) > 1]
    before = [p for o in moving for p in outlines(o, start, -np.inf, np.inf)]
    dashed = {"facecolors": "none", "edgecolors": OBSTACLE_EDGE, "linewidths": 0.7, "linestyles": (0, (3, 2))}
    axes.add_collection(PolyCollection(before, **dashed, zorder=1))
    _draw_goal(axes, run)
    if len(run.rest):
        size = 2.0 * run.rest_radius
        circles = {"units": "xy", "offsets": run.rest[:, :2], "transOffset": axes.transData}
        faces = {"facecolors": "#e9c9d5", "edgecolors": CELL_COLOUR, "linewidths": 0.25}
        axes.add_collection(EllipseCollection(size, size, np.zeros(len(size)), **circles, **faces, zorder=2))
    for n in (*run.others, *run.cells, *run.robots):
        _draw_path(axes, run, n)
    _draw_arrows(axes, run, float((high - low).max()))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x (µm)", ylabel="y (µm)")
    axes.set_aspect("equal")
    if run.worlds > 1:
        text = f"world {run.world} of {run.worlds}"
        axes.text(0.985, 0.02, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5, zorder=8)
    for spine in axes.spines.values():
        spine.set_visible(True)
    if run.robots or run.cells:
        columns = {"ncols": 4, "handlelength": 1.3, "columnspacing": 1.2, "borderaxespad": 0.3}
        axes.legend(loc="lower left", bbox_to_anchor=(0.02, 1.0), **columns)


def _colour(run: Run, n: int) -> str:
    if n in run.robots:
        return ROBOT_COLOURS[n % len(ROBOT_COLOURS)]
    return CELL_COLOUR if n in run.cells else OTHER_COLOUR


def _draw_path(axes: Any, run: Run, n: int) -> None:
    """The path of a body, with the body itself drawn at a few moments, the last one darkest."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    x, y, colour = run.position[:, n, 0], run.position[:, n, 1], _colour(run, n)
    named = n in run.robots or n in run.cells
    # a gap where the body came in on another side: no line leads across the map
    jumps = np.flatnonzero(run.jumped[:, n])
    path = np.insert(run.position[:, n, :2].astype(float), jumps, np.nan, axis=0)
    axes.plot(*path.T, color=colour, lw=1.1 if named else 0.6, zorder=4, label=run.names[n] if named else None)
    moments = np.linspace(0, len(x) - 1, SNAPSHOTS if named else 2).round().astype(int)
    if np.hypot(np.ptp(x), np.ptp(y)) < 2.0 * run.radius[n]:
        moments = moments[-1:]
    for k in moments:
        centres = rotate(run.orientation[k, n], run.spheres[n][:, :3])[:, :2] + run.position[k, n, :2]
        circles = [Circle((cx, cy), r) for (cx, cy), r in zip(centres, run.spheres[n][:, 3], strict=True)]
        circles = [*_rods(run, n, k), *circles]
        face, edge = _tint(colour, 0.45 if k == moments[-1] else 0.2), _tint(colour, 1.0 if k == moments[-1] else 0.55)
        axes.add_collection(PatchCollection(circles, facecolors=[face], edgecolors=[edge], linewidths=0.5, zorder=3))


def _rods(run: Run, n: int, k: int) -> list[Any]:
    """The rods of a body in a frame, from above: rectangles, below its spheres."""
    from matplotlib.patches import Polygon

    out = []
    for rod in run.rods[n]:
        ends = rotate(run.orientation[k, n], rod[:6].reshape(2, 3))[:, :2] + run.position[k, n, :2]
        along = ends[1] - ends[0]
        side = rod[6] * np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-12)
        out.append(Polygon([ends[0] + side, ends[1] + side, ends[1] - side, ends[0] - side]))
    return out


def _tint(colour: str, share: float) -> tuple[float, ...]:
    """The colour mixed with white: opaque, so that overlapping spheres of a body stay even."""
    from matplotlib.colors import to_rgb

    return tuple(1.0 - share * (1.0 - c) for c in to_rgb(colour))


def _draw_goal(axes: Any, run: Run) -> None:
    from matplotlib.patches import Circle

    goal = run.layout["goal"]
    if goal is None:
        return
    x, y = goal["position"][:2]
    radius = run.radius[run.cells[0]] if run.cells else goal["tolerance"]
    axes.add_patch(Circle((x, y), radius, fc="none", ec=GOAL_COLOUR, lw=1.2, ls=(0, (4, 2)), zorder=5))
    axes.annotate("goal", (x, y + radius), (0, 3), textcoords="offset points", ha="center", color=GOAL_COLOUR, zorder=6)


def _draw_arrows(axes: Any, run: Run, extent: float) -> None:
    """Contact forces on the robots, averaged over the stretch of path that an arrow stands for."""
    rows = [r for r in np.array_split(np.arange(len(run.time)), min(ARROWS, len(run.time))) if len(r)]
    place = np.array([[_middle(run, r, n) for r in rows] for n in run.robots]).reshape(-1, 2)
    force = np.array([[run.force[r, n, :2].mean(axis=0) for r in rows] for n in run.robots]).reshape(-1, 2)
    size = np.linalg.norm(force, axis=1)
    largest = float(size.max(initial=0.0))
    if largest <= 0.0:
        return
    keep = size > 0.03 * largest
    key = round_number(largest)
    arrows = axes.quiver(
        *place[keep].T,
        *force[keep].T,
        angles="xy",
        scale_units="xy",
        scale=largest / (ARROW_SHARE * extent),
        width=0.0024,
        headwidth=4.0,
        headlength=4.5,
        headaxislength=4.2,
        color=FORCE_COLOUR,
        zorder=7,
    )
    text = f"contact force, {key:g} pN"
    axes.quiverkey(arrows, 0.97, 1.035, key, text, labelpos="W", coordinates="axes", fontproperties={"size": 8})


def _middle(run: Run, rows: np.ndarray, n: int) -> np.ndarray:
    """(2,) the mean place of a body in some frames; where it came in on another side among them, that of one frame."""
    if run.jumped[rows[1:], n].any():
        return run.position[rows[len(rows) // 2], n, :2]
    return run.position[rows, n, :2].mean(axis=0)


def running_mean(values: np.ndarray) -> np.ndarray | None:
    """Centred running mean of a long trace (n,), nan left out; None for a short one that needs no help."""
    if len(values) < 5 * SMOOTHING:
        return None
    half = len(values) // SMOOTHING // 2
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    low = np.maximum(np.arange(len(values)) - half, 0)
    high = np.minimum(np.arange(len(values)) + half + 1, len(values))
    number = count[high] - count[low]
    return np.where(number > 0, (total[high] - total[low]) / np.maximum(number, 1), np.nan)


def round_number(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is at most `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m for m in (1, 2, 5) if m * power <= value * (1.0 + 1e-9)) * power)


def _draw_force(axes: Any, run: Run) -> None:
    values = np.linalg.norm(run.force[:, run.robots], axis=2)
    lines = [line for line in run.layout["warning_force"] if line is not None]
    _draw_lines(axes, run, values, min(lines) if lines else None, "pN")
    axes.set_ylabel("contact force (pN)")


def _draw_distance(axes: Any, run: Run) -> None:
    values = np.where(np.isfinite(run.distance), run.distance, np.nan)
    _draw_lines(axes, run, values, run.layout["warning_distance"], "µm")
    beads = all(len(run.spheres[n]) == 1 and not len(run.rods[n]) for n in run.robots)
    axes.set_ylabel(f"{'bead' if beads else 'robot'}–trap distance (µm)")


def _draw_lines(axes: Any, run: Run, values: np.ndarray, warning: float | None, unit: str) -> None:
    for k, n in enumerate(run.robots):
        colour, mean = _colour(run, n), running_mean(values[:, k])
        if mean is None:
            axes.plot(run.time, values[:, k], color=colour, lw=0.9)
        else:
            axes.plot(run.time, values[:, k], color=_tint(colour, 0.45), lw=0.5, zorder=2)
            axes.plot(run.time, mean, color=colour, lw=1.4, zorder=4)
    top = np.nanmax(values, initial=0.0)
    if warning is not None:
        axes.axhline(warning, color=WARNING_COLOUR, lw=0.9, ls=(0, (5, 3)), zorder=3)
        place, shift = (1.0, warning), (-2, 3)
        axes.annotate(
            f"warning {warning:g} {unit}",
            place,
            shift,
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=WARNING_COLOUR,
            fontsize=7.5,
        )
        top = max(top, warning)
    axes.set(xlim=(run.time[0], run.time[-1]), ylim=(0.0, 1.18 * top or 1.0))
