"""Curves over a whole recording: contact load, distance of traps, speed; thinned so that every peak stays.

A plot is some hundred pixels wide. The moments of a run are cut into that many bins, and of each bin its smallest and
its largest value are kept: an event of one moment among 10⁵ is still drawn. Moments are read in blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.record.monitor import can_touch, robot_distance
from otwarp.scene import Scene
from otwarp.view.source import Moments, Source

BINS = 320
"""Bins of a curve: about a plot's pixels."""
BLOCK = 4096
"""Moments that are read at a time."""
MOST_CURVES = 6
"""Bodies or traps that get a curve each; above that the robots do, and the largest of all others makes one."""
WINDOW = 0.1
"""Time over which a speed is measured [s]: from moment to moment it would be noise alone."""
SHORT = 10
"""Windows that a recording has at least: over a short one speeds are measured over less."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """A plot over a recording.

    Attributes:
        key: Which quantity: charts of two runs with the same key are drawn into one plot.
        title: With its unit.
        names: (k,) of its curves.
        time: (n,) [s].
        values: (k, n); nan where there is none.
        lines: Names and heights of horizontal lines.
    """

    key: str
    title: str
    names: tuple[str, ...]
    time: np.ndarray
    values: np.ndarray
    lines: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class _Quantity:
    """What of moments makes a chart; `of` gives (n, k)."""

    key: str
    title: str
    names: tuple[str, ...]
    lines: tuple[tuple[str, float], ...]
    of: Callable[[Moments], np.ndarray]


def charts(source: Source) -> list[Chart]:
    """The plots of a recording; it is read once, from its start to its end."""
    wanted = [q for q in (_load(source.scene), _distance(source), _speed(source)) if q is not None]
    count = len(source.time)
    bins = min(count, BINS)
    edge = np.linspace(0, count, bins + 1).astype(int)
    low = [np.full((bins, len(q.names)), np.inf) for q in wanted]
    high = [np.full((bins, len(q.names)), -np.inf) for q in wanted]
    reach = _reach(source.time)
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        before = max(start - reach, 0)
        moments = source.moments(slice(before, stop))
        bin_of = np.searchsorted(edge, np.arange(start, stop), side="right") - 1
        for q, smallest, largest in zip(wanted, low, high, strict=True):
            values = q.of(moments)[start - before :]
            good = np.isfinite(values)
            np.minimum.at(smallest, bin_of, np.where(good, values, np.inf))
            np.maximum.at(largest, bin_of, np.where(good, values, -np.inf))
    return [
        _chart(q, *_ends(source.time, edge, smallest, largest))
        for q, smallest, largest in zip(wanted, low, high, strict=True)
    ]


def _reach(time: np.ndarray) -> int:
    """Moments of `WINDOW`."""
    if len(time) < 2:
        return 1
    wanted = round(WINDOW / max((time[-1] - time[0]) / (len(time) - 1), 1e-12))
    return max(1, min(wanted, len(time) // SHORT))


def _ends(time: np.ndarray, edge: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two points of each bin, at its first moment and at its middle; one where each bin is a moment."""
    low, high = (np.where(np.isfinite(v), v, np.nan) for v in (low, high))
    if len(edge) - 1 == len(time):
        return time, high
    middle = (edge[:-1] + edge[1:]) // 2
    at = np.stack([time[edge[:-1]], time[middle]], axis=1).ravel()
    return at, np.stack([low, high], axis=1).reshape(-1, low.shape[1])


def _chart(q: _Quantity, time: np.ndarray, values: np.ndarray) -> Chart:
    return Chart(key=q.key, title=q.title, names=q.names, time=time, values=values.T.copy(), lines=q.lines)


def _load(scene: Scene) -> _Quantity | None:
    if not scene.bodies or not can_touch(scene):
        return None
    names, pick = _chosen(scene)
    lowest = min((b.warning_force for b in scene.bodies), default=math.inf)
    lines = ((f"warning {lowest:g} pN", lowest),) if math.isfinite(lowest) else ()
    return _Quantity("load", "Contact force [pN]", names, lines, lambda m: pick(m.contact_load))


def _distance(source: Source) -> _Quantity | None:
    scene, held = source.scene, source.held
    robots = [i for i, b in enumerate(scene.bodies) if b.kind == "robot" and (held == i).any()]
    limit = scene.goal.distance_warning if scene.goal else math.inf
    lines = ((f"warning {limit:g} µm", limit),) if math.isfinite(limit) else ()
    if robots and len(robots) <= MOST_CURVES:
        traps_of = [np.flatnonzero(held == i) for i in robots]
        names = tuple(short_name(scene, i) for i in robots)

        def of_robots(m: Moments) -> np.ndarray:
            """The farthest of each robot's lit traps."""
            return robot_distance(m.trap_distance, m.trap_power, traps_of)

        return _Quantity("distance", "Robot to trap [µm]", names, lines, of_robots)
    holding = np.flatnonzero(held >= 0)
    if not len(holding):
        return None
    if len(holding) <= MOST_CURVES:
        names = tuple(scene.traps[k].prim.rsplit("/", 1)[-1].replace("_", " ") for k in holding)
        return _Quantity("distance", "Trap to sphere [µm]", names, lines, lambda m: m.trap_distance[:, holding])
    names = (f"largest of {len(holding)}",)

    def of_all(m: Moments) -> np.ndarray:
        """The largest of all."""
        far = np.where(np.isnan(m.trap_distance[:, holding]), -np.inf, m.trap_distance[:, holding])
        return far.max(axis=1, keepdims=True)

    return _Quantity("distance", "Trap to sphere [µm]", names, lines, of_all)


def _speed(source: Source) -> _Quantity | None:
    if not source.scene.bodies or len(source.time) < 2:
        return None
    names, pick = _chosen(source.scene)
    reach = _reach(source.time)
    window = f"{1e3 * (source.time[-1] - source.time[0]) / (len(source.time) - 1) * reach:.3g} ms"

    def speed(m: Moments) -> np.ndarray:
        """Way over the window, by its time; none at the start, nor where a body has come in again meanwhile."""
        out = np.full(m.position.shape[:2], np.nan)
        if len(m.time) > reach:
            way = np.linalg.norm(m.position[reach:] - m.position[:-reach], axis=2)
            out[reach:] = way / (m.time[reach:] - m.time[:-reach])[:, None]
            out[reach:][m.came_in[reach:] != m.came_in[:-reach]] = np.nan
        return pick(out)

    return _Quantity("speed", f"Speed over {window} [µm/s]", names, (), speed)


def _chosen(scene: Scene) -> tuple[tuple[str, ...], Callable[[np.ndarray], np.ndarray]]:
    """Names of curves of bodies, and what makes their (n, k) of (n, B)."""
    many = len(scene.bodies)
    if many <= MOST_CURVES:
        return tuple(short_name(scene, i) for i in range(many)), lambda values: values
    robots = [i for i, b in enumerate(scene.bodies) if b.kind == "robot"][: MOST_CURVES - 1]
    others = np.setdiff1d(np.arange(many), robots)

    def pick(values: np.ndarray) -> np.ndarray:
        """Those of the robots, and the largest of the others."""
        rest = np.where(np.isnan(values[:, others]), -np.inf, values[:, others]).max(axis=1, keepdims=True)
        return np.concatenate([values[:, robots], rest], axis=1)

    return (*(short_name(scene, i) for i in robots), f"largest of {len(others)} others"), pick


def short_name(scene: Scene, body: int) -> str:
    """Name of a body without the path to it."""
    found = scene.bodies[body]
    name = found.prim.rsplit("/", 1)[-1].replace("_", " ")
    return name if found.instance is None else f"{name} {found.instance}"


def series(parts: Sequence[Chart]) -> tuple[np.ndarray, ...]:
    """Arrays of one plot for charts of one or two runs: common times, curves, lines.

    uPlot wants one time axis and takes a nan for a number: each curve stands still where it has no value, and from its
    first one on.

    Args:
        parts: Of the same quantity.
    """
    time = np.unique(np.concatenate([part.time for part in parts])) if len(parts) > 1 else parts[0].time
    rows: list[np.ndarray] = []
    for part in parts:
        for values in part.values:
            good = np.isfinite(values)
            rows.append(np.interp(time, part.time[good], values[good]) if good.any() else np.zeros(len(time)))
    rows += [np.full(len(time), height) for _, height in parts[0].lines]
    return (time, *rows)
