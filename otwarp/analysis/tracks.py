"""Tracks: labelled positions over time, as all of the analysis takes them, and the checks that they must pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError

FEWEST = 32
"""Samples per world of a track that says anything."""

UNEVEN = 0.55
"""Largest deviation of a sample from even times, in intervals.

A recorded run takes the steps that are nearest to its frames' times. Jitter of standard deviation s changes
correlations of relaxation rate κ by (κ·s)²: 0.25 % for κ·s = 0.05.
"""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks as plain numbers, with what is needed to label results.

    Attributes:
        values: (axes, worlds, n).
        interval: Between samples [s].
        start: Time of the first sample [s].
        axes: Names of the axes.
    """

    values: np.ndarray
    interval: float
    start: float
    axes: list[str]

    @property
    def duration(self) -> float:
        """Of one world [s]."""
        return self.interval * self.values.shape[-1]


def xarray() -> Any:
    """The package, or an error that says which extra brings it."""
    try:
        import xarray as package
    except ImportError:
        raise InputError("the analysis of runs needs xarray; install otwarp[analysis]") from None
    return package


def track(position: ArrayLike, interval: float, *, axes: str = "xyz") -> Any:
    """A measured or simulated track, labelled.

    Args:
        position: (n,), (n, axes) or (worlds, n, axes) [µm]; worlds are repeats with the same parameters.
        interval: Between samples [s].
        axes: A letter for each axis.

    Returns:
        DataArray with the dimensions world, time, axis.

    Raises:
        InputError: Another shape, or an interval that is none.
    """
    x = np.asarray(position, dtype=float)
    x = x[:, None] if x.ndim == 1 else x
    x = x[None] if x.ndim == 2 else x
    if x.ndim != 3 or x.shape[2] > len(axes):
        raise InputError(f"position has shape {np.shape(position)}; allowed: (n,), (n, axes) or (worlds, n, axes)")
    if not 0.0 < interval < np.inf:
        raise InputError(f"interval is {interval}; allowed: above 0, in s")
    coordinates = {"world": np.arange(x.shape[0]), "time": interval * np.arange(x.shape[1])}
    coordinates["axis"] = np.array(list(axes[: x.shape[2]]))
    out = xarray().DataArray(x, dims=("world", "time", "axis"), coords=coordinates, attrs={"units": "um"})
    out["time"].attrs["units"] = "s"
    return out


def labelled(values: np.ndarray, interval: float, like: Tracks, *, start: float = 0.0) -> Any:
    """(axes, worlds, n) numbers as a track with the axes of another."""
    out = track(np.moveaxis(values, 0, -1), interval, axes="?" * len(like.axes))
    return out.assign_coords(axis=like.axes, time=("time", start + out["time"].values, {"units": "s"}))


def tracks_of(x: Any, *, least: int = FEWEST) -> Tracks:
    """The numbers of a track, checked.

    Args:
        x: DataArray with the dimension `time`, evenly spaced, and perhaps `world` and `axis`.
        least: Samples per world that are needed.

    Raises:
        InputError: Another thing, too few samples, uneven ones, or numbers that are not finite.
    """
    dims = getattr(x, "dims", None)
    if dims is None or "time" not in dims or not set(dims) <= {"world", "time", "axis"}:
        raise InputError("track; allowed: a DataArray with the dimension time, and perhaps world and axis (see track)")
    for name in ("world", "axis"):
        x = x if name in dims else x.expand_dims({name: [0] if name == "world" else ["x"]})
    values = np.ascontiguousarray(x.transpose("axis", "world", "time").values, dtype=float)
    time = np.asarray(x["time"].values, dtype=float)
    if len(time) < least:
        raise InputError(f"track has {len(time)} samples; allowed: {least} or more")
    if not np.all(np.isfinite(values)) or not np.all(np.isfinite(time)):
        raise InputError("track has samples that are not finite; allowed: finite positions and times")
    interval = (time[-1] - time[0]) / (len(time) - 1)
    late = np.abs(time - time[0] - interval * np.arange(len(time)))
    if not interval > 0.0 or not np.all(late <= UNEVEN * interval):
        raise InputError(
            f"track has samples that are up to {late.max():.3g} s away from even times; allowed: {UNEVEN:g} of an "
            f"interval, {UNEVEN * interval:.3g} s"
        )
    if np.any(np.ptp(values, axis=-1) == 0.0):
        raise InputError("track does not move; allowed: one that fluctuates")
    return Tracks(values, float(interval), float(time[0]), [str(a) for a in np.atleast_1d(x["axis"].values)])
