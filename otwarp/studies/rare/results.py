"""Results of a study of escapes as a labelled table: rates, mean escape times, interfaces, and what the step does."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.studies.store import Store


def escape_table(store: Store) -> Any:
    """All results of a study of escapes so far, as an `xarray.Dataset`.

    `escape_rate` [1/s] is the mean of the runs, which has no bias; its interval (_low, _high) is Student's, of its
    logarithm. `escape_time` [s] is its inverse. Where no run has seen an escape the rate is 0 and _high a bound. `flux`
    [1/s] and `probability` (interface) are its factors, means of the runs; `interface_at` says where they are.
    `escape_rate_halved` is the rate with half the time step, `step_ratio` the one over the other with its standard
    error `step_ratio_error`.

    Args:
        store: Of the study.
    """
    import xarray

    asked = store.asked()
    level = asked["stop"]["level"]
    with store.reading() as raw:
        raw.load()
        dims = raw["trials"].dims
        known = [n for n, v in raw.variables.items() if len(v.dims) == 1 and v.dims[0] in dims and n not in _APART]
        out = xarray.Dataset(coords={n: raw[n] for n in known})
        done = raw["trials"].values >= 0
        good = done[..., None] & (raw["end"].values >= 0)
        out["trials"] = (dims, np.maximum(raw["trials"].values, 0), {"long_name": "runs"})
        out["faults"] = (
            dims,
            np.sum(done[..., None] & (raw["end"].values == -1), axis=-1),
            {"long_name": "runs with a fault"},
        )
        rate, error = mean_of_runs(raw["rate_of_trial"].values, good)
        low, high = interval_of_mean(raw["rate_of_trial"].values, good, level)
        bound = bound_of_unseen(raw, good, asked["escape"]["branches"], level)
        high = np.where(rate > 0.0, high, bound)
        per = {"units": "1/s", "level": level}
        for name, values in (("", rate), ("_low", low), ("_high", high), ("_error", error)):
            said = {"long_name": "rate of escapes" if not name else f"rate of escapes, {name[1:]}"}
            out[f"escape_rate{name}"] = (dims, np.where(done, values, np.nan), per | said)
        with np.errstate(divide="ignore"):
            for name, values in (("", rate), ("_low", high), ("_high", low)):
                said = {"units": "s", "level": level, "long_name": "mean time to an escape"}
                out[f"escape_time{name}"] = (dims, np.where(done, 1.0 / values, np.nan), said)
        out["flux"] = (dims, mean_of_runs(raw["flux_of_trial"].values, good)[0], raw["flux_of_trial"].attrs)
        probability = np.moveaxis(raw["probability_of_trial"].values, -1, 0)
        out["probability"] = (
            ("interface", *dims),
            np.stack([mean_of_runs(p, good & np.isfinite(p))[0] for p in probability]),
            raw["probability_of_trial"].attrs,
        )
        out["probability"] = out["probability"].transpose(*dims, "interface")
        for name in _OWN:
            if name in raw:  # the step was planned, all else is found
                out[name] = raw[name] if name == "time_step" else raw[name].where(raw["trials"] >= 0)
        if asked["escape"]["halved"]:
            halved_rates(out, raw, good, dims, per)
        steps = sum(np.maximum(raw[n].values, 0).sum(axis=-1) for n in raw if str(n).startswith("steps"))
        out["steps"] = (dims, np.where(done, steps, 0), {"long_name": "world-steps of the runs"})
        used = int(np.isfinite(out["interface_at"].values).sum(axis=-1).max(initial=1))
        out = out.isel(interface=slice(0, max(used, 1)))
    out.attrs = {"scene": asked["scene"]["file"], "seed": asked["seed"], "method": asked["escape"]["method"],
                 "order": asked["escape"]["order"]["name"]}  # fmt: skip
    return out


_OWN = ("basin", "interface_at", "relax", "time_step")
_APART = (*_OWN, "trials")


def halved_rates(out: Any, raw: Any, good: np.ndarray, dims: tuple[str, ...], per: dict[str, Any]) -> None:
    """The rate with half the step, and the ratio of both."""
    rate, error = out["escape_rate"].values, out["escape_rate_error"].values
    fine, fine_error = mean_of_runs(
        raw["rate_halved_of_trial"].values, good & np.isfinite(raw["rate_halved_of_trial"].values)
    )
    said = {"long_name": "rate of escapes, half the step"}
    out["escape_rate_halved"] = (dims, fine, per | said)
    out["escape_rate_halved_error"] = (dims, fine_error, per | said)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = rate / fine
        spread = ratio * np.hypot(error / rate, fine_error / fine)
    out["step_ratio"] = (dims, ratio, {"long_name": "rate over that with half the step"})
    out["step_ratio_error"] = (dims, spread, {"long_name": "standard error of the ratio"})


def mean_of_runs(values: np.ndarray, good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the last dimension where it is good, and its standard error."""
    n = np.sum(good, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.sum(np.where(good, values, 0.0), axis=-1) / n
        squares = np.sum(np.where(good, values - mean[..., None], 0.0) ** 2, axis=-1)
        return mean, np.sqrt(squares / (n - 1) / n)


def interval_of_mean(values: np.ndarray, good: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Interval of the mean of numbers above 0, over the last dimension: Student's, of its logarithm.

    Args:
        values: (…, R) independent estimates.
        good: Which of them count.
        level: Of the interval.
    """
    from scipy.special import stdtrit

    mean, error = mean_of_runs(values, good)
    n = np.sum(good, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.exp(stdtrit(np.maximum(n - 1, 1), 0.5 + 0.5 * level) * error / mean)
    return np.where(mean > 0.0, mean / factor, 0.0), np.where(mean > 0.0, mean * factor, np.nan)


def bound_of_unseen(raw: Any, good: np.ndarray, branches: int, level: float) -> np.ndarray:
    """Upper bounds of rates where no run has seen an escape: all paths of the last stages failed by chance.

    Args:
        raw: Has `probability_of_trial` (…, R, interface), NaN behind the stage that a run ended in, `flux_of_trial`.
        good: (…, R) which runs count.
        branches: Paths of a stage.
        level: Share of the studies in which the bound is above the rate, at least.
    """
    p = raw["probability_of_trial"].values
    alive = np.prod(np.where(np.isfinite(p) & (p > 0.0), p, 1.0), axis=-1)
    mean, _ = mean_of_runs(raw["flux_of_trial"].values * alive, good)
    tried = np.maximum(np.sum(good, axis=-1) * branches, 1)
    return mean * (1.0 - (1.0 - level) ** (1.0 / tried))
