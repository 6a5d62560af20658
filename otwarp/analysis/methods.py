"""All calibrations of a trajectory side by side, beside what the twin itself knows."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from otwarp.analysis.correlation import fit_autocorrelation, fit_msd
from otwarp.analysis.detector import Detector
from otwarp.analysis.likelihood import forma
from otwarp.analysis.spectrum import fit_spectrum
from otwarp.analysis.stationary import not_stationary
from otwarp.analysis.tracks import xarray
from otwarp.analysis.variance import equipartition
from otwarp.errors import InputError, PlausibilityWarning

METHODS: dict[str, Callable[..., Any]] = {
    "equipartition": equipartition,
    "power spectrum": fit_spectrum,
    "MSD": fit_msd,
    "autocorrelation": fit_autocorrelation,
    "FORMA": forma,
}
"""Calibrations by name."""

QUANTITIES = ("stiffness", "drag")


def calibrate(
    trajectory: Any,
    *,
    methods: Sequence[str] = tuple(METHODS),
    temperature: float | None = None,
    drag: float | None = None,
    detector: Detector | None = None,
    seed: int = 0,
    level: float = 0.95,
) -> Any:
    """Stiffness and drag of a trajectory by several methods, and what they are.

    Args:
        trajectory: Dataset with `displacement`, as of `load_trajectory`, or a track, as of `track`.
        methods: Names of `METHODS`.
        temperature: [K]; None: that of the trajectory.
        drag: γ where it is to be taken as known [pN·s/µm].
        detector: A synthetic detector through which the trajectory is seen first, and which the fits allow for. FORMA,
            which knows no detector, is left out with one that is not perfect.
        seed: Of the detector's noise.
        level: Of the intervals.

    Returns:
        Dataset over estimator (the methods) and axis: stiffness and drag with _low and _high, NaN where a method gives
        none (`notes` says why); `known_stiffness`, the slope of the recorded trap force, and the attribute
        `known_drag`, where the run knows them.

    Raises:
        InputError: A method that is none, an unknown temperature, something that is no track, or one not trapped.

    Warns:
        PlausibilityWarning: Traps move or the beginning has not settled; `warnings` of the result says so as well.
    """
    unknown = [m for m in methods if m not in METHODS]
    if unknown:
        raise InputError(f"method {unknown[0]!r} is none; allowed: {', '.join(METHODS)}")
    if hasattr(trajectory, "to_dataset") and not hasattr(trajectory, "data_vars"):
        trajectory = trajectory.to_dataset(name="displacement")
    if "displacement" not in getattr(trajectory, "data_vars", ()):
        raise InputError("trajectory; allowed: a Dataset with displacement (load_trajectory), or a track (see track)")
    kelvin = float(trajectory.attrs.get("temperature", math.nan)) if temperature is None else temperature
    if not 0.0 < kelvin < math.inf:
        raise InputError(f"temperature is {kelvin}; allowed: above 0, in K (older runs do not say it: give it)")
    x = trajectory["displacement"]
    seen = x if detector is None else detector.see(x, seed=seed)
    fitted = detector or Detector()
    tables, notes = _side_by_side(seen, methods, fitted, drag, {"temperature": kelvin, "level": level})
    xr = xarray()
    out = xr.concat([t.reset_coords(drop=True) for t in tables], "estimator", data_vars="all", join="outer")
    out.attrs = {"level": level, "temperature": kelvin, "notes": "; ".join(notes)}
    out.attrs |= {"known_drag": float(trajectory.attrs.get("drag", math.nan))}
    doubts = not_stationary(trajectory)
    out.attrs["warnings"] = "; ".join(doubts)
    for doubt in doubts:
        warnings.warn(f"{trajectory.attrs.get('body', 'track')}: {doubt}", PlausibilityWarning, stacklevel=2)
    slope = force_slope(trajectory)
    if slope is not None and x.attrs.get("units") != "rad":
        out["known_stiffness"] = ("axis", slope, {"units": "pN/um", "long_name": "slope of the recorded trap force"})
    return out


def _side_by_side(
    seen: Any, methods: Sequence[str], detector: Detector, drag: float | None, common: dict[str, Any]
) -> tuple[list[Any], list[str]]:
    """What each method gives, and why some give nothing.

    Raises:
        InputError: No method is left, or what a method refuses.
    """
    tables, notes = [], []
    for name in methods:
        if name == "FORMA" and not _perfect(detector):
            notes.append("FORMA left out: it knows no detector")
            continue
        options = common | ({} if name == "FORMA" else {"detector": detector})
        options |= {} if name == "equipartition" else {"drag": drag}
        try:
            one = METHODS[name](seen, **options)
            tables.append(_diagonal(one).expand_dims(estimator=[name]))
            notes += [note for note in [one.attrs.get("notes")] if note and note not in notes]
        except InputError as error:
            if name != "FORMA" or len(methods) == 1:
                raise
            notes.append(f"FORMA left out: {error}")
    if not tables:
        raise InputError(f"methods are {', '.join(methods)}; allowed: one that knows a detector")
    return tables, notes


def _perfect(detector: Detector) -> bool:
    return not (detector.exposure or detector.noise or math.isfinite(detector.cutoff))


def _diagonal(found: Any) -> Any:
    """Stiffness and drag by axis alone, of the stiffness matrix its diagonal."""
    out = xarray().Dataset(coords={"axis": found["axis"].values})
    for name in QUANTITIES:
        for key in (name, f"{name}_low", f"{name}_high"):
            values = found[key].values if key in found else np.full(out.sizes["axis"], np.nan)
            attrs = found[key].attrs if key in found else {}
            out[key] = ("axis", np.diag(values) if values.ndim == 2 else values, attrs)
    return out


def force_slope(trajectory: Any) -> np.ndarray | None:
    """(axes,) negative slope of the recorded trap force against displacement by least squares: stiffness [pN/µm].

    Exact for a harmonic trap, whatever the noise; of another one, the stiffness that fluctuations of this size see.
    None where no force was recorded.
    """
    if "trap_force" not in trajectory:
        return None
    x, f = (trajectory[name].transpose("axis", "world", "time").values for name in ("displacement", "trap_force"))
    x, f = (v - v.mean(axis=(1, 2), keepdims=True) for v in (x, f))
    return -np.sum(x * f, axis=(1, 2)) / np.sum(x * x, axis=(1, 2))
