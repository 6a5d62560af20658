"""A sweep of SIMULATED operators as plain data for JSON, and as a labelled table for netCDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.operators.perception.summary import COMPARED, NUMBERS, Maps, verdict
from otwarp.operators.perception.sweep import AXES

NOTE = "simulated operators; nothing here was measured on people"


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
    about = {**NUMBERS, "sway": ("place of a hand that is held still, root mean square", "m")}
    out = xarray.Dataset(
        {name: (dims, values) for name, values in found.maps.items()},
        coords=dict(found.axes),
        attrs={"note": NOTE, "operators": found.operators, "population_sha256": found.asked["population"]},
    )
    for name, (meaning, unit) in {**about, **AXES}.items():
        if name in out.variables:
            out[name].attrs = {"long_name": meaning, "units": unit}
    return out


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
