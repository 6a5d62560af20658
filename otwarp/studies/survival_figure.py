"""Survival curves of a study: the share of trials in which something has not come yet, over time, with bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.axes import spoken
from otwarp.studies.results import place_of, taken
from otwarp.studies.stopping.intervals import interval, rate_interval, survival
from otwarp.studies.store import Store

CURVES = 6
"""Points along one axis that have curves, at most."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Survival at a point.

    Attributes:
        label: Which point, by its value along the axis; empty of one alone.
        events, trials: How many trials ended so, and how many there were.
        exposure: Time under observation [s].
        time: [s], from 0 to when the last trial was watched.
        share, low, high: S just after each, and its interval.
    """

    label: str
    events: int
    trials: int
    exposure: float
    time: np.ndarray
    share: np.ndarray
    low: np.ndarray
    high: np.ndarray


def curves_of(store: Store, name: str, where: dict[str, int]) -> list[Curve]:
    """Survival at one point, or at some along one axis.

    Args:
        store: Of the study.
        name: A time of it, whose event ends the curve; trials that ended otherwise are censored.
        where: Places along its dimensions; of the others, the last one longer than 1 is the axis along which points
            have curves, and the rest are taken at their middles.

    Raises:
        InputError: Nothing is computed there.
    """
    asked = store.asked()
    with store.reading() as raw:
        raw.load()
        free = [str(d) for d in raw["trials"].dims if d not in where and raw.sizes[d] > 1]
        rest = {str(d): raw.sizes[d] // 2 for d in raw["trials"].dims if d not in where and d not in free[-1:]}
        part = raw.isel(where | rest)
        points = (-1, part.sizes["trial"])
        good = taken(part) & (part["end"].values >= 0)
        came = part["end"].values == 1 + place_of(asked, next(o for o in asked["observables"] if o["name"] == name))
        time, level = part["end_time"].values, asked["stop"]["level"]
        along = free[-1] if free else None
        good, came, time = (v.reshape(points) for v in (good, came, time))
        known = np.flatnonzero(good.any(axis=-1))
        if not len(known):
            raise InputError(f"{store.folder}: no point is computed there yet; allowed: another point, or more blocks")
        chosen = known[np.unique(np.linspace(0, len(known) - 1, CURVES).round().astype(int))]
        found = []
        for n in chosen.tolist():
            label = "" if along is None else _spelled(part, along, n)
            t, e = time[n][good[n]].ravel(), came[n][good[n]].ravel()
            found.append(Curve(label, int(np.sum(e)), len(t), float(t.sum(dtype=float)), *_whole(t, e, level)))
    return found


def _spelled(part: Any, along: str, n: int) -> str:
    """A value of an axis, with its unit."""
    if along not in part.coords:
        return f"{along} {n}"
    value, unit = part[along].values[n], part[along].attrs.get("units", "")
    return f"{value:.4g} {unit}" if part[along].dtype.kind in "fiu" else str(value)


def _whole(time: np.ndarray, ended: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Survival up to the last time at which a trial was watched; of nothing seen the bound that counts allow."""
    last = float(time.max())
    if not np.any(ended):
        low, _ = interval(len(time), len(time), level=level)
        return np.array([0.0, last]), np.ones(2), np.full(2, float(low)), np.ones(2)
    t, s, low, high = (np.append(part, part[-1]) for part in survival(time, ended, level=level))
    t[-1] = max(last, t[-1])
    return t, s, low, high


def draw_survival(axes: Any, store: Store, name: str, where: dict[str, int], colors: Sequence[str]) -> int:
    """Draw survival curves with their bands; the number of trials that they are of.

    Args:
        axes: Of matplotlib.
        store, name, where: As for `curves_of`.
        colors: One for each curve, in turn.
    """
    asked = store.asked()
    level = asked["stop"]["level"]
    curves = curves_of(store, name, where)
    for n, c in enumerate(curves):
        color, label = colors[n % len(colors)], c.label
        if not c.events:
            bound = float(rate_interval(0, c.exposure, level=level)[1])
            label = f"{label}: none in {c.trials:,} trials, < {bound:.2g} 1/s".removeprefix(": ")
        axes.fill_between(c.time, c.low, c.high, step="post", color=color, alpha=0.25, linewidth=0)
        axes.step(c.time, c.share, where="post", color=color, label=label, linestyle="-" if c.events else "--")
    axes.set(xlabel="time [s]", ylabel=f"P(no {name.replace('_', ' ')} yet)", ylim=(-0.03, 1.03))
    axes.set_xlim(left=0.0)
    axes.set_title(f"band {100 * level:g} %", fontsize=9)
    if any(c.label or not c.events for c in curves):
        axes.legend(
            fontsize=8, title=_axis(store, where), title_fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0)
        )
    return sum(c.trials for c in curves)


def _axis(store: Store, where: dict[str, int]) -> str | None:
    """The name of the axis along which curves are drawn."""
    with store.reading() as raw:
        free = [d for d in raw["trials"].dims if d not in where and raw.sizes[d] > 1]
        if not free:
            return None
        along = str(free[-1])
        return spoken(str(raw[along].attrs.get("long_name", along) if along in raw else along))
