"""Pictures of an analysis: spectrum, displacement, correlation, calibrations side by side, work, survival."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import save_picture

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
"""Okabe and Ito's, which colour-blind people tell apart; one for an axis."""

MARKS = "osD^"

FEW = 4
"""Ordinates of a spectrum below which a point has no error bar."""

ENDINGS = (".png", ".svg", ".pdf")


def check_plot(file: Path) -> None:
    """Refuse a picture whose ending is none that can be drawn.

    Raises:
        InputError: One line.
    """
    if file.suffix not in ENDINGS:
        raise InputError(f"--plot is {file}; allowed: a file that ends with {', '.join(ENDINGS)}")


def draw_analysis(found: Mapping[str, Any], file: Path) -> Path:
    """Draw what an analysis has found, a panel for each.

    Args:
        found: Of `psd`, `msd`, `acf`, `calibration`, `work`, `survival`: the Dataset, with its model where it has one.
        file: Gets the picture, PNG, SVG or PDF by its ending.

    Raises:
        InputError: An ending that is none of these, or nothing to draw.
    """
    check_plot(file)
    panels: dict[str, Callable[[Any, Any], None]] = {
        "psd": _spectrum, "msd": _msd, "acf": _correlation, "calibration": _calibration, "work": _work,
        "survival": _survival,
    }  # fmt: skip
    shown = [name for name in panels if name in found]
    if not shown:
        raise InputError("nothing to draw; allowed: an analysis with a curve, a calibration, work or escapes")
    from matplotlib.figure import Figure

    columns = min(len(shown), 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.6 * columns + 0.6, 3.6 * rows + 0.2), layout="constrained")
    for n, name in enumerate(shown):
        axes = figure.add_subplot(rows, columns, n + 1)
        axes.spines[["top", "right"]].set_visible(False)
        panels[name](axes, found[name])
    save_picture(figure, file)
    return file


def _spectrum(axes: Any, found: Any) -> None:
    for n, axis in enumerate(found["axis"].values):
        one = found.sel(axis=axis)
        style = {"color": COLOURS[n % 4], "markersize": 3.5, "elinewidth": 0.8}
        error = np.where(found["count"].values >= FEW, one["error"].values, 0.0)  # of few ordinates it reaches to 0
        axes.errorbar(one["frequency"], one["power"], error, fmt=MARKS[n % 4], label=str(axis), **style)
        if "model" in one:
            axes.plot(one["frequency"], one["model"], color=COLOURS[n % 4], lw=1.2)
    unit = found["power"].attrs["units"].replace("um2", "µm²")
    axes.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel=f"power ({unit})")
    axes.legend(frameon=False, title="power spectrum")


def _msd(axes: Any, found: Any) -> None:
    _curve(axes, found, "msd", "mean squared displacement (µm²)")
    axes.set(xscale="log", yscale="log")
    _no_minor_labels(axes)


def _no_minor_labels(axes: Any) -> None:
    """Labels of powers of ten alone: within a decade the others lie over each other."""
    from matplotlib.ticker import NullFormatter

    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())


def _correlation(axes: Any, found: Any) -> None:
    _curve(axes, found, "autocorrelation", "autocorrelation (µm²)")
    axes.axhline(0.0, color="#9aa0ab", lw=0.7)


def _curve(axes: Any, found: Any, name: str, label: str) -> None:
    for n, axis in enumerate(found["axis"].values):
        one = found.sel(axis=axis)
        axes.plot(one["lag"], one[name], MARKS[n % 4], color=COLOURS[n % 4], markersize=3.5, label=str(axis))
        if "model" in one:
            axes.plot(one["lag"], one["model"], color=COLOURS[n % 4], lw=1.2)
    axes.set(xlabel="lag (s)", ylabel=label)
    axes.legend(frameon=False)


def _calibration(axes: Any, found: Any) -> None:
    methods = [str(m) for m in found["estimator"].values]
    names = [str(a) for a in found["axis"].values]
    rows = np.arange(len(methods))[::-1]
    for n, axis in enumerate(names):
        one = found.sel(axis=axis)
        value, low, high = (one[f"stiffness{end}"].values for end in ("", "_low", "_high"))
        at = rows + 0.16 * (0.5 * (len(names) - 1) - n)
        good = np.isfinite(value) & np.isfinite(high)
        reach = [(value - low)[good], (high - value)[good]]
        axes.errorbar(
            value[good], at[good], xerr=reach, fmt=MARKS[n % 4], color=COLOURS[n % 4], markersize=4, label=axis
        )
        if "known_stiffness" in one:
            axes.axvline(float(one["known_stiffness"]), color=COLOURS[n % 4], lw=0.9, ls=(0, (4, 2)))
    axes.set_yticks(rows, methods)
    axes.set_ylim(-0.6, len(methods) - 0.1)
    axes.set_xlabel(f"stiffness ({found['stiffness'].attrs['units'].replace('um', 'µm')})")
    title = "dashed: slope of the twin's own force" if "known_stiffness" in found else None
    how = {"ncols": 3, "fontsize": 8, "title_fontsize": 8, "loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    axes.legend(frameon=False, title=title, **how)


def _work(axes: Any, found: Any) -> None:
    axes.hist(found["work"].values, bins="auto", color=COLOURS[0], alpha=0.6)
    axes.axvline(float(found["work"].mean()), color=COLOURS[0], lw=1.2, label="mean work")
    low, middle, high = (float(found[f"free_energy{end}"]) for end in ("_low", "", "_high"))
    axes.axvspan(max(low, axes.get_xlim()[0]), high, color=COLOURS[1], alpha=0.25, lw=0)
    axes.axvline(middle, color=COLOURS[1], lw=1.2, label="ΔF (Jarzynski)")
    axes.set(xlabel="work (pN µm)", ylabel="worlds")
    axes.legend(frameon=False)


def _survival(axes: Any, found: Any) -> None:
    t, s, low, high = (found[name].values for name in ("time", "survival", "survival_low", "survival_high"))
    axes.fill_between(t, low, high, step="post", color=COLOURS[0], alpha=0.25, linewidth=0)
    axes.step(t, s, where="post", color=COLOURS[0])
    axes.set(xlabel="time (s)", ylabel="P(not escaped yet)", ylim=(-0.03, 1.03))
