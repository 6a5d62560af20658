"""Pictures of studies of escapes: rates with their intervals over one axis and what the step does, or a map."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.studies.axes import spoken

COLOUR, BESIDE = "#0072b2", "#d55e00"
"""Of the rate, and of what is compared with it: told apart by colour-blind people, too."""


def draw_escapes(figure: Any, found: Any) -> None:
    """Draw a table of escapes into an empty figure: over one or two of its dimensions, at the middle of the others.

    Args:
        figure: Of matplotlib.
        found: The table; of one point, the probabilities to come to its interfaces are drawn.
    """
    over = found["trials"].dims
    dims = [str(d) for d in over if found.sizes[d] > 1]
    found = found.isel({d: found.sizes[d] // 2 for d in dims[2:]} | {d: 0 for d in over if found.sizes[d] == 1})
    if not dims:
        _profile(figure, found)
    elif len(dims) == 1:
        _curve(figure, found, dims[0])
    else:
        _map(figure, found, dims[:2])


def _curve(figure: Any, found: Any, dim: str) -> None:
    """Mean times over one axis, and below them the rate over that with half the step."""
    x = found[dim].values
    time, low, high = (found[f"escape_time{n}"].values.ravel() for n in ("", "_low", "_high"))
    halved = "step_ratio" in found and bool(np.any(np.isfinite(found["step_ratio"].values)))
    upper = figure.add_subplot(4, 1, (1, 3) if halved else (1, 4))
    seen = np.isfinite(time)
    upper.fill_between(
        x, np.where(seen, low, np.nan), np.where(np.isfinite(high), high, np.nan), color=COLOUR, alpha=0.25, linewidth=0
    )
    upper.plot(x, np.where(seen, time, np.nan), "o-", color=COLOUR, markersize=3)
    upper.set(yscale="log", ylabel="mean time to an escape [s]")
    unseen = ~seen & np.isfinite(low)
    upper.plot(x[unseen], low[unseen], "^", color=BESIDE, markersize=5)
    upper.set_title(f"{_method(found)}: {int(found['trials'].values.max())} runs a point, "
                    f"{float(found['steps'].values.sum()):.1e} world-steps"
                    + ("; ▲ bound: none seen" if np.any(unseen) else ""), fontsize=9)  # fmt: skip
    label = _label(found, dim)
    if halved:
        lower = figure.add_subplot(4, 1, 4, sharex=upper)
        ratio, error = (found[n].values.ravel() for n in ("step_ratio", "step_ratio_error"))
        lower.axhline(1.0, color="0.6", linewidth=0.8)
        lower.errorbar(x, ratio, 2.0 * error, fmt="o", color=BESIDE, markersize=3, linewidth=1.0)
        lower.set(xlabel=label, ylabel="rate, step\nover half")
        upper.tick_params(labelbottom=False)
    else:
        upper.set_xlabel(label)


def _map(figure: Any, found: Any, dims: list[str]) -> None:
    axes = figure.add_subplot()
    time, low = (found[f"escape_time{n}"].transpose(dims[1], dims[0], ...).values for n in ("", "_low"))
    x, y = (found[d].values for d in dims)
    unseen = ~np.isfinite(time) & np.isfinite(low)
    mesh = axes.pcolormesh(x, y, np.log10(np.where(unseen, low, time)), cmap="cividis", shading="nearest")
    for row, column in np.argwhere(unseen):
        axes.text(x[column], y[row], "▲", color="white", fontsize=7, ha="center", va="center")
    if np.any(unseen):
        axes.set_title("▲ bound: none seen", fontsize=9)
    figure.colorbar(mesh, ax=axes, label="log₁₀ of the mean time to an escape [s]")
    axes.set(**{f"{letter}label": _label(found, d) for letter, d in zip("xy", dims, strict=True)})


def _label(found: Any, dim: str) -> str:
    known = found[dim].attrs
    return spoken(str(known.get("long_name", dim))) + (f" [{known['units']}]" if known.get("units") else "")


def _profile(figure: Any, found: Any) -> None:
    """Probability to come from the basin to each interface, of one point."""
    axes = figure.add_subplot()
    at, p = found["interface_at"].values.ravel(), found["probability"].values.ravel()
    here = np.isfinite(at)
    reached = np.concatenate([[1.0], np.cumprod(p[here])[:-1]])
    axes.plot(at[here], np.where(reached > 0.0, reached, np.nan), "o-", color=COLOUR, markersize=3)
    unit = found["interface_at"].attrs.get("units")
    axes.set(yscale="log", xlabel=found.attrs["order"] + (f" [{unit}]" if unit else ""))
    axes.set_ylabel("probability to come so far before the return")
    time = [float(found[f"escape_time{n}"].values) for n in ("", "_low", "_high")]
    said = f"{time[0]:.3g} s, {time[1]:.3g} to {time[2]:.3g} s"
    said = said if np.isfinite(time[0]) else f"none seen, over {time[1]:.3g} s"
    axes.set_title(f"{_method(found)}: {said}", fontsize=9)


def _method(found: Any) -> str:
    return {"forward-flux": "forward-flux sampling", "splitting": "adaptive multilevel splitting"}[
        found.attrs["method"]
    ]
