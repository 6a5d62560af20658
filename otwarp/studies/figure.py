"""Pictures of studies: maps with contours and the width of intervals, curves with bands, choices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import save_picture
from otwarp.studies.axes import spoken
from otwarp.studies.contours import equal_factors
from otwarp.studies.rare.figure import draw_escapes
from otwarp.studies.results import choices_of, table
from otwarp.studies.stopping.intervals import errors_to_the_ends
from otwarp.studies.store import Store
from otwarp.studies.survival_figure import draw_survival

COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999")
"""Okabe and Ito's, which colour-blind people tell apart; more things than these share them."""

TRACED = 6
"""Values along both axes of a map from which on a contour is drawn: on fewer it shows the grid."""

DECADES = 30.0
"""Factor between rates of a map from which on its colours go by factors."""

PANELS = 4
"""Values of a third dimension that are drawn side by side; of more, the one in the middle."""


@dataclass(frozen=True)
class Shown:
    """What is drawn: an observable, or the `largest` value of a search.

    Attributes:
        name: In the table.
        kind: As of an observable, or `largest`.
        choices: Of a choice.
        level: Of contours.
        asked: Whether somebody asked for a contour of that level.
    """

    name: str
    kind: str
    choices: tuple[str, ...] = ()
    level: float = 0.5
    asked: bool = False


def draw(
    store: Store,
    file: Path,
    *,
    name: str | None = None,
    level: float | None = None,
    survival: bool = False,
    at: Mapping[str, float] | None = None,
) -> Path:
    """Draw an observable of a study over its dimensions.

    Two dimensions make a map, a third of up to `PANELS` values several; of more, their middle values are drawn.

    Args:
        store: The study.
        file: Gets the picture, PNG, SVG or PDF by its ending.
        name: Of the observable; None: what the study searched, or the first observable.
        level: Of the contour of a probability; None: 0.5, and no word where it is nowhere.
        survival: Whether a time is drawn as survival curves, of some points along one axis, not as a rate.
        at: Name of an axis → a value of it, of which the nearest one is drawn.

    Raises:
        InputError: No such observable or axis, nothing computed yet, or an ending that is none of these.
    """
    if file.suffix not in (".png", ".svg", ".pdf"):
        raise InputError(f"--plot is {file}; allowed: a file that ends with .png, .svg or .pdf")
    asked = store.asked()
    shown = replace(_chosen(asked, name, 0.5 if level is None else level, survival), asked=level is not None)
    found = table(store)
    if not np.any(found["trials"].values):
        raise InputError(f"{store.folder}: no point is computed yet; allowed: a study that has run")
    from matplotlib.figure import Figure

    where, part = _places(found, at or {}), ""
    over = found["largest"].dims if shown.kind == "largest" else found["trials"].dims
    if shown.kind == "survival" or (shown.kind == "time" and not any(found.sizes[d] > 1 for d in over)):
        figure = Figure(figsize=(7.6, 4.2), layout="constrained")
        drawn = draw_survival(figure.add_subplot(), store, shown.name, where, COLORS)
    elif shown.kind == "escape":
        figure = Figure(figsize=(6.4, 4.6), layout="constrained")
        draw_escapes(figure, found.isel({d: [n] for d, n in where.items()}))
        drawn = 0
    else:
        found = found.isel({d: [n] for d, n in where.items() if d in over})
        drawn, known, points = int(found["trials"].sum()), int((found["trials"] > 0).sum()), found["trials"].size
        part = f", {known:,} of {points:,} points so far" if known < points else ""
        figure = _over_axes(found, shown, [str(d) for d in over])
    if drawn:
        figure.suptitle(f"{drawn:,} trials{part}", fontsize=9)
    save_picture(figure, file)
    return file


def _over_axes(found: Any, shown: Shown, over: list[str]) -> Any:
    """A picture of an observable over dimensions: curves, a map, or several."""
    from matplotlib.figure import Figure

    dims = [d for d in over if found.sizes[d] > 1]
    maps = len(dims) > 1 and shown.kind != "largest"
    panels = dims[0] if maps and len(dims) > 2 and found.sizes[dims[0]] <= PANELS else None
    beside = dims[1:] if panels else dims
    found = found.isel({d: found.sizes[d] // 2 for d in beside[2:]} | {d: 0 for d in over if found.sizes[d] == 1})
    count = found.sizes[panels] if panels else 1
    wide = maps and shown.kind == "probability" and not panels
    figure = Figure(figsize=(3.1 + 3.3 * (2 * wide or count), 4.2), layout="constrained")
    if not maps:
        _curves(figure.add_subplot(), found, shown, beside)
    elif shown.kind == "choice":
        _choices(figure, _sheets(found, panels), shown, beside[:2])
    else:
        _maps(figure, _sheets(found, panels), shown, beside[:2], width=wide)
    return figure


def _places(found: Any, at: Mapping[str, float]) -> dict[str, int]:
    """Places along dimensions of the values that are nearest to those wanted.

    Raises:
        InputError: No such axis.
    """
    numbers = {str(d): found[d] for d in found["trials"].dims if d in found.coords and found[d].dtype.kind in "fiu"}
    out = {}
    for name, value in at.items():
        named = [d for d, values in numbers.items() if name in (d, values.attrs.get("long_name"))]
        if not named:
            raise InputError(f"--at has the axis {name!r}; allowed: {', '.join(numbers) or 'none, the study has none'}")
        out[named[0]] = int(np.argmin(np.abs(numbers[named[0]].values - value)))
    return out


def _chosen(asked: dict[str, Any], name: str | None, level: float, survival: bool) -> Shown:
    """What is to be drawn."""
    kinds = {o["name"]: o["kind"] for o in asked["observables"]}
    if survival:
        times = [o for o, kind in kinds.items() if kind == "time"]
        if name not in (None, *times) or not times:
            raise InputError(f"--survival of {name or 'this study'}; allowed: a time, such as first_passage: "
                             f"{', '.join(times) or 'it has none'}")  # fmt: skip
        return Shown(name or times[0], "survival")
    if asked["stop"].get("rule") == "largest":
        kinds = {"largest": "largest"} | kinds
    chosen = next(iter(kinds)) if name is None else name
    if chosen not in kinds:
        raise InputError(f"observable {chosen!r} is none of the study; allowed: {', '.join(kinds)}")
    if not 0.0 < level < 1.0:
        raise InputError(f"contour is {level}; allowed: a probability above 0 and below 1")
    said = next((o for o in asked["observables"] if o["name"] == chosen and o["kind"] == "choice"), None)
    return Shown(chosen, kinds[chosen], choices_of(asked, said) if said else (), level)


def _sheets(found: Any, panels: str | None) -> list[tuple[str, Any]]:
    """Titles and tables of the panels."""
    if panels is None:
        return [("", found)]
    about, x = found[panels].attrs if panels in found.coords else {}, _coordinate(found, panels)[0]
    label = spoken(str(about.get("long_name", panels)))
    return [(f"{label} = {v:g} {about.get('units', '')}", found.isel({panels: n})) for n, v in enumerate(x)]


def _label(found: Any, name: str) -> str:
    about = found[name].attrs
    unit = f" [{about['units']}]" if about.get("units") else ""
    return f"{about.get('long_name', name)}{unit}"


def _values(found: Any, shown: Shown) -> tuple[Any, Any, Any, str]:
    """Values, lower and upper ends, and what they are."""
    name = f"{shown.name}_rate" if shown.kind == "time" else shown.name
    if shown.kind != "number":
        return found[name], found[f"{name}_low"], found[f"{name}_high"], _label(found, name)
    value = found[name]
    reach = errors_to_the_ends(found["trials"] - found["faults"]) * found[f"{name}_error"]
    return value, value - reach, value + reach, _label(found, name)


def _unseen(shown: Shown, value: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where all trials were censored, so that of a rate a bound alone is known."""
    return (value == 0.0) & np.isfinite(high) if shown.kind == "time" else np.zeros(np.shape(value), dtype=bool)


def _coordinate(found: Any, dim: str) -> tuple[np.ndarray, str, bool]:
    """Numbers along a dimension, their label, and whether equal factors lie between them."""
    if dim not in found.coords or found[dim].dtype.kind not in "fiu":
        return np.arange(found.sizes[dim], dtype=float), dim, False
    x, about = np.asarray(found[dim].values, dtype=float), found[dim].attrs
    unit = f" [{about['units']}]" if about.get("units") else ""
    return x, spoken(str(about.get("long_name", dim))) + unit, equal_factors(x)


def _scaled(axes: Any, found: Any, dims: list[str], *, last: bool = True) -> None:
    """Label the axes of a map, the first dimension upwards, and space them by factors where values are."""
    (_, y_text, y_log), (_, x_text, x_log) = (_coordinate(found, d) for d in dims)
    axes.set(xlabel=x_text, ylabel=y_text if last else "")
    if x_log:
        _by_factors(axes.xaxis)
    if y_log:
        _by_factors(axes.yaxis)


def _by_factors(axis: Any) -> None:
    """Space an axis by factors, with numbers as people write them at 1, 2, 5, 10, …"""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def _sorted(found: Any, value: Any, dims: list[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y and z of a map, both axes rising."""
    y, x = (_coordinate(found, d)[0] for d in dims)
    order = np.argsort(y), np.argsort(x)
    return x[order[1]], y[order[0]], value.transpose(*dims).values[np.ix_(*order)]


def _maps(figure: Any, sheets: list[tuple[str, Any]], shown: Shown, dims: list[str], *, width: bool) -> None:
    """Heat maps; of a probability with the contour, the band it may lie in, and half the width of its intervals."""
    axes = np.atleast_1d(figure.subplots(1, 2 if width else len(sheets), sharey=True))
    values = [_values(found, shown) for _, found in sheets]
    text = values[0][3]
    unseen = [_unseen(shown, value.values, high.values) for value, _, high, _ in values]
    seen = any(np.any(np.isfinite(value.values) & ~none) for none, (value, *_) in zip(unseen, values, strict=True))
    if not seen and any(np.any(none) for none in unseen):  # bounds are all that is known
        values, text = [(high, low, high, t) for _, low, high, t in values], f"none seen: upper end of {text}"
        unseen = [np.zeros_like(none) for none in unseen]
    ends = (0.0, 1.0) if shown.kind == "probability" else _range([v[0].values for v in values])
    norm, marked = _norm(shown, ends, [v[0].values for v in values])
    mesh = None
    for place, (title, found), (value, low, high, _), none in zip(axes, sheets, values, unseen, strict=False):
        x, y, z = _sorted(found, value, dims)
        for row, column in np.argwhere(_sorted(found, value.copy(data=none), dims)[2]):
            place.text(x[column], y[row], "▼", color=marked, fontsize=6, ha="center", va="center")
            title = "▼ none seen"
        mesh = place.pcolormesh(x, y, z, cmap="cividis", shading="nearest", norm=norm)
        if shown.kind == "probability":
            parts = [_sorted(found, part.where(np.isfinite(value)), dims)[2] for part in (value, low, high)]
            title = title or _contours(place, x, y, parts, shown)
        _scaled(place, found, dims, last=place is axes[0])
        place.set_title(title, fontsize=9)
    figure.colorbar(mesh, ax=axes[0] if width else axes, label=text)
    if width:
        figure.get_layout_engine().set(wspace=0.06)  # the label of the left map's colours is none of the right map's
        value, low, high, _ = values[0]
        x, y, z = _sorted(sheets[0][1], (0.5 * (high - low)).where(np.isfinite(value)), dims)
        mesh = axes[1].pcolormesh(x, y, z, cmap="Greys", shading="nearest", vmin=0.0)
        _scaled(axes[1], sheets[0][1], dims, last=False)
        figure.colorbar(mesh, ax=axes[1], label="half the width of the interval")


def _norm(shown: Shown, ends: tuple[float | None, float | None], maps: list[np.ndarray]) -> tuple[Any, str]:
    """The scale of colours, rates by factors where they are decades apart; and the colour of marks where none is."""
    from matplotlib.colors import LogNorm, Normalize

    if shown.kind != "time":
        return Normalize(*ends), "white"
    above = np.concatenate([v[np.isfinite(v) & (v > 0.0)] for v in maps])
    if len(above) and above.max() > DECADES * above.min():
        return LogNorm(float(above.min()), float(above.max())), "0.4"
    return Normalize(0.0, ends[1]), "white"


def _contours(place: Any, x: np.ndarray, y: np.ndarray, parts: list[np.ndarray], shown: Shown) -> str:
    """Draw the contour of a probability, and those of the ends of its interval; what they are, for a title."""
    if min(len(x), len(y)) < TRACED:
        return ""
    level, traced = shown.level, False
    for p, style in zip(parts, ("solid", "dotted", "dotted"), strict=True):
        if np.nanmin(p) < level < np.nanmax(p):
            lines = place.contour(x, y, p, levels=[level], colors="white", linewidths=1.4, linestyles=style)
            traced = traced or any(len(line) for line in lines.allsegs[0])
    if traced:
        return f"line: P = {level:g}, dotted: by the ends of intervals"
    return f"no contour: P is nowhere {level:g}" if shown.asked else ""


def _range(values: list[np.ndarray]) -> tuple[float | None, float | None]:
    """Least and largest of several maps, so that one scale serves all; None where nothing is known."""
    known = np.concatenate([v[np.isfinite(v)] for v in values])
    return (float(known.min()), float(known.max())) if len(known) else (None, None)


def _choices(figure: Any, sheets: list[tuple[str, Any]], shown: Shown, dims: list[str]) -> None:
    """What came most often, in its colour, the paler the smaller its share; blank where nothing did."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    colors = np.array([to_rgb(COLORS[n % len(COLORS)]) for n in range(len(shown.choices))])
    axes = np.atleast_1d(figure.subplots(1, len(sheets), sharey=True))
    came = np.zeros(len(shown.choices), dtype=bool)
    for place, (title, found) in zip(axes, sheets, strict=True):
        parts = [_sorted(found, found[f"{shown.name}_{c}"], dims) for c in shown.choices]
        share = np.nan_to_num(np.stack([z for _, _, z in parts]))
        came |= np.any(share > 0.0, axis=(1, 2))
        first, most = share.argmax(axis=0), share.max(axis=0)[..., None]
        x, y, _ = parts[0]
        place.pcolormesh(x, y, 1.0 - most * (1.0 - colors[first]), shading="nearest")
        _scaled(place, found, dims, last=place is axes[0])
        place.set_title(title, fontsize=9)
    named = [(n.replace("_", " "), c) for n, c, there in zip(shown.choices, colors, came, strict=True) if there]
    figure.legend(
        handles=[Patch(color=c, label=n) for n, c in named],
        loc="outside right upper",
        title=f"{shown.name.replace('_', ' ')};\npale: less often",
        fontsize=8,
    )


def _curves(axes: Any, found: Any, shown: Shown, dims: list[str]) -> None:
    """Curves with bands: over the last dimension, one for each value of the one before it; or one point."""
    if shown.kind == "choice":
        rows = [
            (c, found[f"{shown.name}_{c}"], found[f"{shown.name}_{c}_low"], found[f"{shown.name}_{c}_high"])
            for c in shown.choices
        ]
        text = f"share of trials, {shown.name.replace('_', ' ')}"
    else:
        value, low, high, text = _values(found, shown)
        rows = [("", value, low, high)]
        if len(dims) > 1:
            numbers, title, _ = _coordinate(found, dims[0])
            rows = [
                (f"{title}: {v:g}", *(p.isel({dims[0]: n}) for p in (value, low, high))) for n, v in enumerate(numbers)
            ]
    x, x_text, log = _coordinate(found, dims[-1]) if dims else (np.zeros(1), "", False)
    order, bounds = np.argsort(x), False
    for n, (label, *parts) in enumerate(rows):
        v, a, b = (np.atleast_1d(np.asarray(p.values, dtype=float).squeeze())[order] for p in parts)
        color = COLORS[n % len(COLORS)]
        unseen = _unseen(shown, v, b)
        v = np.where(unseen, np.nan, v)
        axes.fill_between(x[order], a, np.where(np.isfinite(b), b, v), color=color, alpha=0.25, linewidth=0)
        axes.plot(x[order], v, "o-", color=color, markersize=3, label=label)
        axes.plot(x[order][unseen], b[unseen], "v", color=color, markersize=5)
        bounds |= bool(np.any(unseen))
    axes.set(xlabel=x_text, ylabel=text)
    if len(rows) > 1:
        axes.legend(fontsize=8)
    if shown.kind in ("probability", "choice"):
        axes.set_ylim(-0.03, 1.03)
    elif shown.kind == "time":
        axes.set_ylim(bottom=0.0)
    if bounds:
        axes.set_title("▼ bound: none seen", fontsize=9)
    if log:
        _by_factors(axes.xaxis)
        if shown.kind == "largest":
            _by_factors(axes.yaxis)
