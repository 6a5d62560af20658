"""A sweep of SIMULATED operators as plain data for JSON, and as a labelled table for netCDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.operators.perception.probe import FREQUENCIES
from otwarp.operators.perception.summary import COMPARED, NUMBERS, Maps, verdict
from otwarp.operators.perception.sweep import AXES

NOTE = "simulated operators; nothing here was measured on people"

MEANINGS = {
    "success": ("share of simulated trials that deliver", "1"),
    "lost": ("share of simulated trials that lose a robot or the cell", "1"),
    **NUMBERS,
    **{f"phase_{f:g}hz": (f"phase of the force on a hand that moves at {f:g} Hz", "°") for f in FREQUENCIES},
    **{f"gain_{f:g}hz": (f"force on a hand that moves at {f:g} Hz, over the perfect one", "1") for f in FREQUENCIES},
    "sway": ("place of a hand that is held still, root mean square", "m"),
    "limit_cycles": ("share of hands that are held still and oscillate on", "1"),
    "limit_cycle_hz": ("mean frequency of these", "Hz"),
}
"""Maps that are no difference, with meaning and unit."""
ENDS = {
    "_low": ", low end of the 95 % interval",
    "_high": ", high end of the 95 % interval",
    "_minus_perfect": ", less that without errors and delay",
    "_minus_without": ", less that without haptics",
}
"""What the end of a name adds to its meaning."""


def plain(found: Maps) -> dict[str, Any]:
    """All of a sweep for JSON: a row for each cell; numbers that do not exist are None."""
    rows = []
    for cell in np.ndindex(*(len(values) for values in found.axes.values())):
        row: dict[str, Any] = {name: float(found.axes[name][n]) for name, n in zip(found.axes, cell, strict=True)}
        numbers = found.at(cell)
        row |= {name: value if np.isfinite(value) else None for name, value in numbers.items()}
        rows.append(row | {f"verdict {what}": verdict(numbers, what) for what in COMPARED})
    beside = {
        name: {key: value if np.isfinite(value) else None for key, value in row.items()}
        for name, row in found.beside.items()
    }
    return {"simulated": True, "note": NOTE, "operators": found.operators, "asked": found.asked, "cells": rows} | beside


def dataset(found: Maps) -> Any:
    """The maps as an `xarray.Dataset` over the axes, with meanings and units.

    Raises:
        InputError: xarray is not there.
    """
    try:
        import xarray
    except ImportError as error:
        raise InputError(f"--export: {error}; allowed: with pip install xarray") from None
    dims = tuple(found.axes)
    out = xarray.Dataset(
        {name: (dims, values) for name, values in found.maps.items()},
        coords=dict(found.axes),
        attrs={"note": NOTE, "operators": found.operators, "population_sha256": found.asked["population"]},
    )
    for name in map(str, out.variables):
        meaning, unit = AXES[name] if name in AXES else meaning_of(name)
        out[name].attrs = {"long_name": meaning, "units": unit}
    return out


def meaning_of(name: str) -> tuple[str, str]:
    """Meaning and unit of a map: of one of `MEANINGS`, of its difference, or of an end of its interval."""
    for end, said in ENDS.items():
        if name.endswith(end):
            meaning, unit = meaning_of(name.removesuffix(end))
            return meaning + said, unit
    return MEANINGS[name]


def export(found: Maps, file: Path) -> Path:
    """Write `dataset` as netCDF.

    Raises:
        InputError: Another ending than .nc, or xarray is not there.
    """
    if file.suffix != ".nc":
        raise InputError(f"--export is {file}; allowed: a file that ends with .nc")
    table = dataset(found)
    with written(file) as part:
        table.to_netcdf(part, engine="netcdf4")
    return file
