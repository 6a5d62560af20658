"""Reads a velocity field on a regular grid from a file: NumPy `.npz`, netCDF `.nc`, VTK `.vti` or legacy VTK `.vtk`.

Numbers are in SI units (m, m/s), but for netCDF variables whose `units` say another length, of `LENGTHS`, or that per
second; a unit that is neither is refused.

- `.npz`: `x`, `y`, `z` (places of the nodes, evenly spaced), and `u`, `v`, `w` (nx, ny, nz) or `velocity`
  (nx, ny, nz, 3).
- `.nc`: variables of the same names; those of the velocity have the dimensions of x, y and z, in any order.
- `.vti`, `.vtk`: the first point array of three components, see `vtk_file`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.read.vtk_file import Field, read_image_data, read_legacy

EVEN = 1e-4
"""Largest difference of spacings of nodes that count as evenly spaced, relative to the mean."""


def read_flow_grid(path: Path) -> FlowGrid:
    """A velocity field in internal units; see the module.

    Raises:
        InputError: A file that cannot be read or is none of these, in one line.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: suffix {path.suffix!r}: must be one of {', '.join(READERS)}")
    try:
        return reader(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:  # what damaged files make of parsers is not known
        raise InputError(f"{path}: not a readable velocity field: {' '.join(str(error).split())}") from None


def _grid(axes: dict[str, np.ndarray], velocity: np.ndarray) -> FlowGrid:
    """From places [µm] and velocities [µm/s]."""
    low, spacing = [], []
    for name, places in axes.items():
        steps = np.diff(places) if places.ndim == 1 and len(places) > 1 else np.zeros(1)
        mean = float(steps.mean())
        if not (mean > 0.0 and np.abs(steps - mean).max() <= EVEN * mean):
            raise InputError(f"{name} = {places.size} places: must be 2 or more, rising by equal steps")
        low.append(float(places[0]))
        spacing.append(mean)
    return FlowGrid(low=(low[0], low[1], low[2]), spacing=(spacing[0], spacing[1], spacing[2]), velocity=velocity)


def _from_names(found: dict[str, np.ndarray]) -> FlowGrid:
    missing = [name for name in "xyz" if name not in found]
    parts = [found[name] for name in "uvw" if name in found]
    if missing or ("velocity" not in found and len(parts) < 3):
        raise InputError(f"holds {', '.join(sorted(found)) or 'nothing'}: must hold x, y, z, and u, v, w or velocity")
    velocity = found["velocity"] if "velocity" in found else np.stack(parts, axis=-1)
    axes = {name: np.asarray(found[name], dtype=float) for name in "xyz"}
    wanted = (*(len(a) for a in axes.values()), 3)
    if velocity.shape != wanted:
        raise InputError(f"velocity has shape {velocity.shape}: must be {wanted}")
    return _grid(axes, np.asarray(velocity, dtype=float))


def _npz(path: Path) -> FlowGrid:
    with np.load(path, allow_pickle=False) as table:
        return _from_names({name: 1e6 * _real(name, table[name]) for name in table.files})


def _real(name: str, values: np.ndarray) -> np.ndarray:
    """In float64, which would drop imaginary parts without a word.

    Raises:
        InputError: Complex numbers.
    """
    if values.dtype.kind == "c":
        raise InputError(f"{name} is of type {values.dtype}: must be real numbers")
    return np.asarray(values, dtype=float)


LENGTHS = {"m": 1e6, "cm": 1e4, "mm": 1e3, "um": 1.0, "nm": 1e-3}
"""Symbol of a length → µm."""

_NAMES = {"meter": "m", "centimeter": "cm", "millimeter": "mm", "micrometer": "um", "micron": "um", "nanometer": "nm"}
_SECOND = r"s(?:ec(?:onds?)?)?"
_SPEED = re.compile(rf"(.+?)\s*(?:(?:/|\bper\b)\s*{_SECOND}|[ .*·]\s*{_SECOND}\s*(?:\^|\*\*)?\s*(?:-1|⁻¹))")


def _scale(name: str, units: str) -> float:
    """What numbers of a variable in `units` are multiplied with to be in µm or µm/s; without any they are SI.

    Raises:
        InputError: Units that are no length, or of a velocity no length per second.
    """
    text, place = units.strip().replace("µ", "u").replace("μ", "u"), name in "xyz"
    if not text:
        return LENGTHS["m"]
    match = None if place else _SPEED.fullmatch(text)
    length = text if place else match[1] if match else ""
    symbol = _NAMES.get(length.lower().removesuffix("s").replace("metre", "meter"), length)
    if symbol not in LENGTHS:
        what = "a length" if place else "a length per second"
        raise InputError(f"{name}: units = {units!r}: must be {what}, in {', '.join(LENGTHS)}, or none for SI")
    return LENGTHS[symbol]


def _netcdf(path: Path) -> FlowGrid:
    import netCDF4

    with netCDF4.Dataset(path) as data:
        found, along = {}, []
        for name in (*"xyz", *"uvw", "velocity"):
            if name not in data.variables:
                continue
            variable = data.variables[name]
            values = np.ma.filled(variable[...], np.nan) * _scale(name, str(getattr(variable, "units", "")))
            if name in "xyz":
                along += variable.dimensions
            else:
                values = np.transpose(values, _order(name, variable.dimensions, along))
            found[name] = values
    return _from_names(found)


def _order(name: str, dimensions: tuple[str, ...], along: list[str]) -> list[int]:
    """Which dimensions of a variable are those of x, y and z, and behind them the others.

    Raises:
        InputError: It lacks one of them: lengths alone would not tell which of its dimensions is which.
    """
    if len(set(along)) < len(along):  # one dimension for several axes: they stand in their own order
        return list(range(len(dimensions)))
    if missing := [one for one in along if one not in dimensions]:
        raise InputError(
            f"{name} has dimensions {', '.join(dimensions)}: must have those of x, y and z, {', '.join(along)}; "
            f"{missing[0]} is missing"
        )
    order = [dimensions.index(one) for one in along]
    return [*order, *(n for n in range(len(dimensions)) if n not in order)]


def _vtk(read: Callable[[Path], Field]) -> Callable[[Path], FlowGrid]:
    """A reader of a VTK format, whose numbers are in SI units."""

    def reader(path: Path) -> FlowGrid:
        axes, velocity = read(path)
        return _grid({name: 1e6 * places for name, places in axes.items()}, 1e6 * velocity)

    return reader


READERS = {".npz": _npz, ".nc": _netcdf, ".vti": _vtk(read_image_data), ".vtk": _vtk(read_legacy)}
"""Suffix → `(path) -> FlowGrid`."""
