"""When traps lost their spheres: of a recorded run, or of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.analysis.tracks import xarray
from otwarp.analysis.trajectory import open_run
from otwarp.errors import InputError
from otwarp.studies.stopping.intervals import rate_interval, survival


def escapes(path: str | Path, *, world: int | None = None, level: float = 0.95) -> Any:
    """Escapes from each trap of a recorded run, over its worlds.

    Args:
        path: Folder of the run, or its `run.nc`.
        world: Which world; None: all.
        level: Of the intervals.

    Returns:
        Dataset over trap: `events`, `exposure` [s], `rate` [1/s] of a constant hazard with _low and _high.

    Raises:
        InputError: No run, no traps that hold anything, or a run that says nothing about escapes.
    """
    names, lasted, ended = _times(path, world)
    return escape_rates(ended.sum(axis=1), lasted.sum(axis=1), names=names, level=level)


def escape_survival(path: str | Path, *, world: int | None = None, level: float = 0.95) -> Any:
    """Probability that a trap still holds its sphere, over time, all traps and worlds of a recorded run together.

    Args:
        path: Folder or file of a recorded run.
        world: The one to look at; None: all together.
        level: Of the intervals, such as 0.95.

    Returns:
        Dataset over time [s]: `survival` by the product limit (`otwarp.studies.survival`), _low and _high.

    Raises:
        InputError: As `escapes`.
    """
    _, lasted, ended = _times(path, world)
    parts = [np.append(p, p[-1]) for p in survival(lasted.ravel(), ended.ravel(), level=level)]
    parts[0][-1] = max(float(lasted.max()), parts[0][-1])
    out = xarray().Dataset(coords={"time": ("time", parts[0], {"units": "s"})}, attrs={"level": level})
    for name, values in zip(("survival", "survival_low", "survival_high"), parts[1:], strict=True):
        out[name] = ("time", values)
    return out


def _times(path: str | Path, world: int | None) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names of the traps that hold something; (traps, worlds) how long each was watched [s], and whether it escaped."""
    with open_run(path) as run:
        if "trap_body" not in run or not np.any(run["trap_body"].values >= 0):
            raise InputError(f"{path}: no trap holds anything; allowed: a run with traps that do")
        if "escape_time" not in run:
            raise InputError(f"{path}: has no escape_time; allowed: a run recorded by this version or a later one")
        held = run.isel(trap=np.flatnonzero(run["trap_body"].values >= 0))
        worlds = list(range(held.sizes["world"]))
        if world is not None and world not in worlds:
            raise InputError(f"world is {world}; allowed: 0 to {len(worlds) - 1}")
        last = held.isel(frame=-1, world=worlds if world is None else [world])
        when, names = last["escape_time"].values.T, [str(t) for t in held["trap"].values]
        begin, end = float(run["time"].values[0]), float(run["time"].values[-1])
    ended = np.isfinite(when) & (when >= begin)
    # what had escaped before a resumed run began was never watched
    lasted = np.where(ended, when, np.where(np.isfinite(when), begin, end)) - begin
    return names, lasted, ended


def study_escapes(folder: str | Path) -> Any:
    """Escapes at each point of a study that watches for them, or samples them by forward flux or splitting.

    Args:
        folder: Of the study.

    Returns:
        Dataset over the dimensions of the study: `events`, `exposure` [s], `rate` [1/s] with _low and _high at the
        study's level, NaN at points that are not computed; trials with a fault do not count. Of a study of escapes
        `runs` and `world_steps` in the place of events and exposure.

    Raises:
        InputError: No study, or none that asks for escapes.
    """
    from otwarp.studies.results import place_of
    from otwarp.studies.store import open_store

    store = open_store(Path(folder))
    asked = store.asked()
    if asked.get("kind") == "escape":
        return _sampled(store)
    o = next((o for o in asked["observables"] if o.get("end") == "escaped"), None)
    if o is None:
        raise InputError(f"{folder}: asks for no escapes; allowed: a study of trapped, lost or first_passage")
    with store.reading() as raw:
        raw.load()
        trials, end, time = (raw[name] for name in ("trials", "end", "end_time"))
        ran = (np.arange(end.shape[-1]) < trials.values[..., None]) & (end.values != -1)
        events = np.sum(ran & (end.values == 1 + place_of(asked, o)), axis=-1)
        exposure = np.sum(np.where(ran, time.values, 0.0), axis=-1, dtype=float)
        flat = escape_rates(events.ravel(), exposure.ravel(), level=asked["stop"]["level"])
        out = xarray().Dataset(coords=trials.coords, attrs=flat.attrs)
        for name in flat.data_vars:
            values = flat[name].values.reshape(events.shape).astype(float)
            out[name] = (trials.dims, np.where(trials.values > 0, values, np.nan), flat[name].attrs)
        return out


def _sampled(store: Any) -> Any:
    """The same of a study of escapes."""
    from otwarp.studies.rare.results import escape_table

    found = escape_table(store)
    names = {"trials": "runs", "steps": "world_steps"} | {f"escape_rate{n}": f"rate{n}" for n in ("", "_low", "_high")}
    out = found[list(names)].rename(names)
    return out.assign_attrs(level=found["escape_rate"].attrs["level"])


def escape_rates(events: ArrayLike, exposure: ArrayLike, *, names: list[str] | None = None, level: float = 0.95) -> Any:
    """Rates of a constant hazard, events over exposure, with exact intervals (`otwarp.studies.stopping.intervals`).

    Args:
        events: (n,) escapes seen.
        exposure: (n,) time under observation, of those that did not escape too [s].
        names: Of the n.
        level: Of the intervals.

    Returns:
        Dataset over trap: `events`, `exposure` [s], `rate` [1/s] with _low and _high.

    Raises:
        InputError: Counts or times that are negative, or a level that is none.
    """
    count, time = np.atleast_1d(np.asarray(events)), np.atleast_1d(np.asarray(exposure, dtype=float))
    low, high = rate_interval(count, time, level=level)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = count / time
    out = xarray().Dataset(coords={"trap": names or list(range(len(count)))}, attrs={"level": level})
    out["events"], out["exposure"] = ("trap", count), ("trap", time, {"units": "s"})
    for name, values in (("rate", rate), ("rate_low", low), ("rate_high", high)):
        out[name] = ("trap", values, {"units": "1/s", "level": level, "long_name": "escapes per time"})
    return out
