"""Results as a labelled table: rates with their intervals, times of what was seen and what was censored, numbers."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.damage import check_times
from otwarp.studies.rare.results import escape_table
from otwarp.studies.stopping.intervals import interval, rate_interval, survival
from otwarp.studies.stopping.looks import level_at
from otwarp.studies.stopping.search import largest_in
from otwarp.studies.store import Store


def table(store: Store) -> Any:
    """All results of a study so far, points that are not computed NaN, as an `xarray.Dataset`.

    Behind the name of a probability stand _low, _high (its interval) and _count. Behind that of a time: _events,
    _exposure [s], _rate [1/s] with _rate_low and _rate_high, events over exposure as of a constant rate (its upper end
    alone says something where nothing was seen), and _median [s] by the product limit, NaN where less than half were
    seen. A number is the mean; behind it _error, the standard error, and _deviation. Where a study asks which end came,
    a number also has its mean over the trials that each end came to, as place_x_reached, with its _error; NaN where
    none did. Trials with a fault, whose state was no longer physical, count for nothing but `faults`. A search along an
    axis has `largest`, with _low and _high. Of a study of escapes, what `otwarp.studies.rare.results` says.

    Raises:
        InputError: xarray is not installed.
    """
    xarray = _xarray()
    asked = store.asked()
    if asked.get("kind") == "escape":
        return _described(escape_table(store), asked)
    with store.reading() as raw:
        raw.load()
        dims = raw["trials"].dims
        apart = ("trials", "time_step")
        known = [n for n, v in raw.variables.items() if n not in apart and len(v.dims) == 1 and "trial" not in v.dims]
        out = xarray.Dataset(coords={n: raw[n] for n in known})
        trials, end, time = (raw[name].values for name in ("trials", "end", "end_time"))
        ran = taken(raw)
        check_times(store.results, ran & (end > 0), time)
        good = ran & (end != -1)
        out["trials"] = (dims, np.maximum(trials, 0), {"long_name": "trials"})
        out["faults"] = (dims, np.sum(ran & (end == -1), axis=-1), {"long_name": "trials with a fault"})
        n = np.sum(good, axis=-1)
        level = asked["stop"]["level"]
        for o in asked["observables"]:
            if o["kind"] == "number":
                _number(out, raw, o, good, dims)
                continue
            if o["kind"] == "choice":
                _choice(out, raw, o, choices_of(asked, o), good, level)
                continue
            came = good & (end == 1 + place_of(asked, o)) & (time <= (np.inf if o["until"] is None else o["until"]))
            if o["kind"] == "probability":
                count = np.sum(came if o["happens"] else good & ~came, axis=-1)
                _probability(out, o["name"], count, n, trials, asked["stop"])
            else:
                _time(out, o["name"], came, time, good, dims, level)
        _by_end(out, raw, asked, good, dims)
    step = asked["time step"]
    if isinstance(step, dict):
        out["time_step"] = raw["time_step"]
    out.attrs = {"scene": asked["scene"]["file"], "seed": asked["seed"]}
    out.attrs["time_step_s"] = step["least"] if isinstance(step, dict) else step
    rule = asked["stop"]
    if rule.get("rule") == "largest":
        looked = rule["of"] or next(o["name"] for o in asked["observables"] if o["kind"] == "probability")
        out.update(largest_in(out, looked, rule["probability"], str(dims[-1])))
    return _described(out, asked)


def _probability(
    out: Any, name: str, count: np.ndarray, n: np.ndarray, trials: np.ndarray, rule: dict[str, Any]
) -> None:
    """A share of `n` trials with its interval and count, the interval NaN at points that are not computed."""
    said = {"long_name": f"probability, {name}", "level": rule["level"], "method": rule["method"]}
    computed, looks = trials >= 0, rule.get("looks")
    if looks is None:
        low, high = interval(count, n, level=rule["level"], method=rule["method"])
    else:
        low, high = interval(count, n, level=level_at(looks, rule["level"], trials))
    dims = out["trials"].dims
    out[name] = (dims, count / np.where(n > 0, n, np.nan), said)
    out[f"{name}_low"] = (dims, np.where(computed, low, np.nan), said)
    out[f"{name}_high"] = (dims, np.where(computed, high, np.nan), said)
    out[f"{name}_count"] = (dims, count, {"long_name": f"trials, {name}"})


def _described(out: Any, asked: dict[str, Any]) -> Any:
    """The same table, in which ends of intervals say whose they are; and which versions computed it."""
    for name in ("stop", "scatter"):  # as JSON: netCDF has no tables among attributes
        if asked.get(name):
            out.attrs[name] = json.dumps(asked[name], ensure_ascii=False)
    out.attrs |= {f"{name}_version": version for name, version in asked.get("versions", {}).items()}
    for name in map(str, out.data_vars):
        base, _, end = name.rpartition("_")
        if end in ("low", "high") and base in out:
            whose = out[base].attrs.get("long_name", base)
            out[name].attrs["long_name"] = f"{whose}, {'lower' if end == 'low' else 'upper'} end of its interval"
    return out


def taken(raw: Any) -> np.ndarray:
    """Whether trials of a store are there: where nothing was computed, or a block is not whole, none is."""
    return np.arange(raw.sizes["trial"]) < raw["trials"].values[..., None]


def ends_of(asked: dict[str, Any]) -> list[tuple[Any, ...]]:
    """The different ends of a study's observables, in the order of their codes."""
    found: list[tuple[Any, ...]] = []
    for o in asked["observables"]:
        key = _key(o)
        if "end" in o and key not in found:
            found.append(key)
    return found


def _key(o: dict[str, Any]) -> tuple[Any, ...]:
    return o.get("end"), o.get("sha256"), repr(o.get("parameters"))


def place_of(asked: dict[str, Any], o: dict[str, Any]) -> int:
    """Which of the ends of a study an observable asks for, from 0."""
    return ends_of(asked).index(_key(o))


def _time(
    out: Any, name: str, came: np.ndarray, time: np.ndarray, good: np.ndarray, dims: tuple[str, ...], level: float
) -> None:
    """Events, exposure, the constant rate they would have, and the median."""
    events = np.sum(came, axis=-1)
    exposure = np.sum(np.where(good, time, 0.0), axis=-1, dtype=float)
    low, high = rate_interval(events, exposure, level=level)
    low = np.where(exposure > 0.0, low, np.nan)
    high = np.where(exposure > 0.0, high, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = events / exposure
    median = np.full(events.shape, np.nan)
    for at in np.ndindex(events.shape):
        if events[at]:
            times, s, _, _ = survival(time[at][good[at]], came[at][good[at]], level=level)
            below = np.flatnonzero(s <= 0.5)
            median[at] = times[below[0]] if len(below) else np.nan
    per = {"units": "1/s", "level": level}
    out[f"{name}_events"] = (dims, events, {"long_name": f"trials, {name} seen"})
    out[f"{name}_exposure"] = (dims, exposure, {"units": "s", "long_name": "time under observation"})
    out[f"{name}_rate"] = (dims, rate, per | {"long_name": f"events per time, {name}"})
    out[f"{name}_rate_low"], out[f"{name}_rate_high"] = (dims, low, per), (dims, high, per)
    out[f"{name}_median"] = (dims, median, {"units": "s", "long_name": f"median, {name}"})


def _number(out: Any, raw: Any, o: dict[str, Any], good: np.ndarray, dims: tuple[str, ...]) -> None:
    """Mean, standard error and deviation of a number over the trials."""
    mean, error, deviation = moments(raw, o, good)
    unit = {"units": o["unit"]} if o["unit"] else {}
    out[o["name"]] = (dims, mean, unit | {"long_name": f"mean, {o['name']}"})
    out[f"{o['name']}_error"] = (dims, error, unit | {"long_name": "standard error of the mean"})
    out[f"{o['name']}_deviation"] = (dims, deviation, unit | {"long_name": "standard deviation of trials"})


def moments(raw: Any, o: dict[str, Any], good: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of a number over some trials, its standard error, and the deviation of trials; NaN where there is none."""
    values = np.where(good, raw[f"{o['name']}_of_trial"].values, np.nan).astype(float)
    n = np.sum(good, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(values, axis=-1) / n
        deviation = np.sqrt(np.nansum((values - mean[..., None]) ** 2, axis=-1) / (n - 1))
        return mean, deviation / np.sqrt(n), deviation


def _by_end(out: Any, raw: Any, asked: dict[str, Any], good: np.ndarray, dims: tuple[str, ...]) -> None:
    """Means of numbers over the trials that each end came to: where a cell is when it is lost, not when it arrives."""
    which = next((o for o in asked["observables"] if o["kind"] == "choice" and not o["choices"]), None)
    if which is None:
        return
    came = _which_end(raw, names := choices_of(asked, which))
    for o in (o for o in asked["observables"] if o["kind"] == "number"):
        unit = {"units": o["unit"]} if o["unit"] else {}
        for place, name in enumerate(names):
            mean, error, _ = moments(raw, o, good & (came == place))
            out[f"{o['name']}_{name}"] = (dims, mean, unit | {"long_name": f"mean, {o['name']}, where {name}"})
            out[f"{o['name']}_{name}_error"] = (dims, error, unit | {"long_name": "standard error of the mean"})


def _which_end(raw: Any, names: tuple[str, ...]) -> np.ndarray:
    """Which of the names each trial had, the last of which is none."""
    return np.where(raw["end"].values == 0, len(names) - 1, raw["end"].values - 1)


def choices_of(asked: dict[str, Any], o: dict[str, Any]) -> tuple[str, ...]:
    """What a choice may be: what it says, or the study's ends and `none`."""
    return tuple(o["choices"]) or (*(key[0] for key in ends_of(asked)), "none")


def _choice(out: Any, raw: Any, o: dict[str, Any], names: tuple[str, ...], good: np.ndarray, level: float) -> None:
    """Of each thing that it may be its share of all trials, with its interval."""
    dims = raw["trials"].dims
    which = raw[f"{o['name']}_of_trial"].values if o["choices"] else _which_end(raw, names)
    n = np.sum(good, axis=-1)
    for place, name in enumerate(names):
        count = np.sum(good & (which == place), axis=-1)
        low, high = interval(count, n, level=level)
        said = {"long_name": f"share, {o['name']} {name}", "level": level}
        parts = {"": count / np.where(n > 0, n, np.nan), "_low": low, "_high": high}
        for part, values in parts.items():
            out[f"{o['name']}_{name}{part}"] = (dims, np.where(n > 0, values, np.nan), said)
        out[f"{o['name']}_{name}_count"] = (dims, count, {"long_name": f"trials, {o['name']} {name}"})


def _xarray() -> Any:
    try:
        import xarray
    except ImportError:
        raise InputError("tables of studies need xarray; install otwarp[studies]") from None
    return xarray


def progress(store: Store) -> dict[str, int]:
    """How far a study is: blocks, points and trials, done and in all."""
    asked = store.asked()
    with store.reading() as raw:
        trials, fault = raw["trials"].values, taken(raw) & (raw["end"].values == -1)
    shared = asked["stop"].get("budget")
    return ({} if shared is None else {"budget": shared}) | {
        "blocks": asked["blocks"],
        "blocks_done": len(store.finished()),
        "points": int(trials.size),
        "points_done": int(np.sum(trials >= 0)),
        "trials": int(np.sum(np.maximum(trials, 0))),
        "faults": int(np.sum(fault)),
    }
