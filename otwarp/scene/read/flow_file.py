"""Reads a velocity field on a regular grid from a file: NumPy `.npz`, netCDF `.nc` or VTK image data `.vti`.

Numbers are in SI units (m, m/s), but for netCDF variables whose `units` say µm or µm/s.

- `.npz`: `x`, `y`, `z` (places of the nodes, evenly spaced), and `u`, `v`, `w` (nx, ny, nz) or `velocity`
  (nx, ny, nz, 3).
- `.nc`: variables of the same names; those of the velocity with dimensions x, y, z in any order.
- `.vti`: the first point array of three components; ascii, or base64 in place, compressed by zlib or not.
"""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.flow_grid import FlowGrid

EVEN = 1e-4
"""Largest difference of spacings of nodes that count as evenly spaced, relative to the mean."""

SUFFIXES = (".npz", ".nc", ".vti")


def read_flow_grid(path: Path) -> FlowGrid:
    """A velocity field in internal units; see the module.

    Raises:
        InputError: A file that cannot be read or is none of these, in one line.
    """
    reader = {".npz": _npz, ".nc": _netcdf, ".vti": _vti}.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: suffix {path.suffix!r}: must be one of {', '.join(SUFFIXES)}")
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
        return _from_names({name: 1e6 * np.asarray(table[name], dtype=float) for name in table.files})


_SCALES = {"um": 1.0, "µm": 1.0, "micrometer": 1.0, "um/s": 1.0, "µm/s": 1.0, "um s-1": 1.0, "mm": 1e3, "mm/s": 1e3}


def _netcdf(path: Path) -> FlowGrid:
    import netCDF4

    with netCDF4.Dataset(path) as data:
        found = {}
        for name in (*"xyzuvw", "velocity"):
            if name not in data.variables:
                continue
            variable = data.variables[name]
            values = np.ma.filled(variable[...], np.nan) * _SCALES.get(getattr(variable, "units", ""), 1e6)
            order = [variable.dimensions.index(d) for d in "xyz" if d in variable.dimensions]
            found[name] = np.transpose(values, [*order, *(n for n in range(values.ndim) if n not in order)])
    return _from_names(found)


_ALONG = "1 0 0 0 1 0 0 0 1"


def _vti(path: Path) -> FlowGrid:
    root = ElementTree.parse(path).getroot()
    image = root.find("ImageData")
    if image is None or image.get("Direction", _ALONG).split() != _ALONG.split():
        raise InputError("no ImageData along the axes: must be VTK image data without a Direction of its own")
    piece = image.find("Piece")
    arrays = [] if piece is None else [a for a in piece.iterfind("PointData/DataArray")]
    array = next((a for a in arrays if a.get("NumberOfComponents") == "3"), None)
    if piece is None or array is None:
        raise InputError("no point array of three components: must hold one, the velocity")
    extent = [int(n) for n in piece.get("Extent", image.get("WholeExtent", "")).split()]
    count = [b - a + 1 for a, b in zip(extent[::2], extent[1::2], strict=True)]
    spacing = [1e6 * float(v) for v in image.get("Spacing", "1 1 1").split()]
    start = [
        1e6 * float(v) + a * h
        for v, a, h in zip(image.get("Origin", "0 0 0").split(), extent[::2], spacing, strict=True)
    ]
    values = 1e6 * _vtk_numbers(root, array).reshape(*count[::-1], 3).transpose(2, 1, 0, 3)
    axes = {name: s + h * np.arange(n) for name, s, h, n in zip("xyz", start, spacing, count, strict=True)}
    return _grid(axes, values)


def _vtk_numbers(root: Any, array: Any) -> np.ndarray:
    """The numbers of a DataArray, as float64."""
    text = (array.text or "").split()
    how = array.get("format", "ascii")
    if how == "ascii":
        return np.array(text, dtype=float)
    if how != "binary":
        raise InputError(f"DataArray format = {how}: must be ascii or binary")
    order = "<" if root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
    head = np.dtype({"UInt64": "u8", "UInt32": "u4"}[root.get("header_type", "UInt32")]).newbyteorder(order)
    kind = np.dtype({"Float32": "f4", "Float64": "f8"}[array.get("type", "Float32")]).newbyteorder(order)
    packed = "".join(text)
    if root.get("compressor") is None:
        return np.frombuffer(base64.b64decode(packed), np.uint8)[head.itemsize :].view(kind).astype(float)
    # the header, (blocks, size, size of the last, sizes compressed …), is encoded by itself
    width = -(-head.itemsize // 3) * 4
    blocks = int(np.frombuffer(base64.b64decode(packed[:width])[: head.itemsize], head)[0])
    width = -(-(3 + blocks) * head.itemsize // 3) * 4
    sizes = np.frombuffer(base64.b64decode(packed[:width]), head)[3:].astype(int)
    body, at, raw = base64.b64decode(packed[width:]), 0, b""
    for size in sizes:
        raw += zlib.decompress(body[at : at + size])
        at += size
    return np.frombuffer(raw, kind).astype(float)
