"""Pictures of studies: a map with its contour and the width of its intervals, curves with bands, survival."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.studies.intervals import survival
from otwarp.studies.results import place_of, table
from otwarp.studies.store import Store


def draw(store: Store, file: Path, *, name: str | None = None) -> Path:
    """Draw an observable of a study of one or two dimensions; more dimensions are drawn at the middle of the others.

    Args:
        file: Gets the picture, PNG, SVG or PDF by its ending.
        name: Of the observable; None: the first.

    Raises:
        InputError: No such observable, nothing computed yet, or an ending that is none of these.
    """
    if file.suffix not in (".png", ".svg", ".pdf"):
        raise InputError(f"--plot is {file}; allowed: a file that ends with .png, .svg or .pdf")
    asked = store.asked()
    names = [o["name"] for o in asked["observables"]]
    chosen = names[0] if name is None else name
    if chosen not in names:
        raise InputError(f"observable {chosen!r} is none of the study; allowed: {', '.join(names)}")
    found = table(store)
    if not np.any(found["trials"].values):
        raise InputError(f"{store.folder}: no point is computed yet; allowed: a study that has run")
    kind = next(o["kind"] for o in asked["observables"] if o["name"] == chosen)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    dims = [d for d in found["trials"].dims if found.sizes[d] > 1]
    shown = found.isel({d: found.sizes[d] // 2 for d in dims[2:]})
    if kind == "time" and not dims:
        _survival(figure, store, asked, chosen)
    elif len(dims) >= 2:
        _map(figure, shown, chosen, kind, dims[:2])
    else:
        _curve(figure, shown, chosen, kind, dims)
    with written(file) as part:
        figure.savefig(part, dpi=160)
    return file


def _label(found: Any, name: str) -> str:
    about = found[name].attrs
    unit = f" [{about['units']}]" if about.get("units") else ""
    return f"{about.get('long_name', name)}{unit}"


def _shown(found: Any, name: str, kind: str) -> tuple[Any, Any, Any, str]:
    """Values, lower and upper ends, and what they are."""
    if kind == "probability":
        return found[name], found[f"{name}_low"], found[f"{name}_high"], _label(found, name)
    if kind == "time":
        rate = f"{name}_rate"
        return found[rate], found[f"{rate}_low"], found[f"{rate}_high"], _label(found, rate)
    value, error = found[name], found[f"{name}_error"]
    return value, value - 2.0 * error, value + 2.0 * error, _label(found, name)


def _coordinate(found: Any, dim: str) -> tuple[np.ndarray, str, bool]:
    """Numbers along a dimension, their label, and whether equal factors lie between them."""
    if dim not in found.coords or found[dim].dtype.kind not in "fiu":
        return np.arange(found.sizes[dim]), dim, False
    x = np.asarray(found[dim].values, dtype=float)
    steps = np.diff(x)
    log = bool(len(x) > 2 and np.all(x > 0.0) and not np.allclose(steps, steps[0], rtol=1e-3) and np.all(steps > 0.0))
    return x, _label(found, dim), log


def _map(figure: Any, found: Any, name: str, kind: str, dims: list[str]) -> None:
    value, low, high, text = _shown(found, name, kind)
    (y, y_text, y_log), (x, x_text, x_log) = (_coordinate(found, d) for d in dims)
    axes = figure.add_subplot()
    ends = {"vmin": 0.0, "vmax": 1.0} if kind == "probability" else {}
    order = np.argsort(x), np.argsort(y)
    z = value.transpose(*dims).values[np.ix_(order[1], order[0])]
    mesh = axes.pcolormesh(x[order[0]], y[order[1]], z, cmap="cividis", shading="nearest", **ends)
    figure.colorbar(mesh, ax=axes, label=text)
    if kind == "probability" and np.nanmin(z) < 0.5 < np.nanmax(z):
        lines = axes.contour(x[order[0]], y[order[1]], z, levels=[0.5], colors="white", linewidths=1.6)
        axes.clabel(lines, fmt="0.5")
    axes.set(xlabel=x_text, ylabel=y_text)
    if x_log:
        axes.set_xscale("log")
    if y_log:
        axes.set_yscale("log")
    widest = float(np.nanmax(0.5 * (high - low).values))
    trials = found["trials"].values
    axes.set_title(f"{int(trials.sum()):,} trials; intervals ±{widest:.2g} or narrower", fontsize=9)


def _curve(figure: Any, found: Any, name: str, kind: str, dims: list[str]) -> None:
    value, low, high, text = _shown(found, name, kind)
    axes = figure.add_subplot()
    x, x_text, log = _coordinate(found, dims[0]) if dims else (np.zeros(1), "", False)
    order = np.argsort(x)
    v, a, b = (np.atleast_1d(np.asarray(part.values, dtype=float).squeeze())[order] for part in (value, low, high))
    axes.fill_between(x[order], a, b, color="#0072b2", alpha=0.25, linewidth=0)
    axes.plot(x[order], v, "o-", color="#0072b2", markersize=3)
    axes.set(xlabel=x_text, ylabel=text)
    if kind == "probability":
        axes.set_ylim(-0.03, 1.03)
    if log:
        axes.set_xscale("log")
    axes.set_title(f"{int(found['trials'].values.sum()):,} trials", fontsize=9)


def _survival(figure: Any, store: Store, asked: dict[str, Any], name: str) -> None:
    with store.read() as raw:
        end, time = raw["end"].values.ravel(), raw["end_time"].values.ravel()
    good = end >= 0
    o = next(o for o in asked["observables"] if o["name"] == name)
    level = asked["stop"]["level"]
    t, s, low, high = survival(time[good], end[good] == 1 + place_of(asked, o), level=level)
    axes = figure.add_subplot()
    axes.fill_between(t, low, high, step="post", color="#0072b2", alpha=0.25, linewidth=0)
    axes.step(t, s, where="post", color="#0072b2")
    axes.set(xlabel="time [s]", ylabel=f"P(no {name.replace('_', ' ')} yet)", ylim=(-0.03, 1.03))
    axes.set_title(f"{int(good.sum()):,} trials, band {100 * level:g} %", fontsize=9)
