"""Force tables on disk: found by what they hold for, written whole or not at all, believed only if intact.

A file's name is the hash of beam, sphere, tolerance, interpolation and format version; inside are the same description
and a checksum of the numbers. A file that does not match its name, its checksum or this version is built anew.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.optics.analysis import TrapProperties
from otwarp.optics.beam import Beam
from otwarp.optics.mie import Sphere
from otwarp.optics.table import ForceTable, Interpolation, TableLevel

VERSION = 2
"""Raise it with any change of the format or of the numbers a build gives."""


def cache_folder() -> Path:
    """`OTWARP_CACHE`, or `otwarp` in the user's cache folder."""
    chosen = os.environ.get("OTWARP_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "otwarp"


def describe(beam: Beam, sphere: Sphere, tolerance: float, interpolation: str) -> str:
    """What a table holds for, as canonical JSON. The power is left out, because Q does not depend on it; the
    polarization enters by its Jones vector, so two names for one beam share a table."""
    fields = dataclasses.asdict(beam.with_power(1.0))
    fields["polarization"] = [[round(e.real, 12) + 0.0, round(e.imag, 12) + 0.0] for e in beam.jones]
    index = complex(sphere.index)
    about = {
        "version": VERSION,
        "beam": fields,
        "sphere": {"radius": sphere.radius, "index": [index.real, index.imag]},
        "tolerance": tolerance,
        "interpolation": interpolation,
    }
    return json.dumps(about, sort_keys=True)


def file_of(folder: Path, beam: Beam, sphere: Sphere, tolerance: float, interpolation: str) -> Path:
    """Where the table belongs."""
    name = hashlib.sha256(describe(beam, sphere, tolerance, interpolation).encode()).hexdigest()[:32]
    return folder / f"{name}.npz"


def load(folder: Path, beam: Beam, sphere: Sphere, tolerance: float, interpolation: Interpolation) -> ForceTable | None:
    """The cached table, or None if there is none that can be trusted."""
    about = describe(beam, sphere, tolerance, interpolation)
    try:
        path = file_of(folder, beam, sphere, tolerance, interpolation)
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        if str(arrays.pop("about")) != about or str(arrays.pop("checksum")) != _checksum(arrays):
            return None
        radius, spacing = arrays["radius"], arrays["spacing"]
        nodes = [arrays[f"node{n}"] for n in range(len(radius))]
        return ForceTable(
            beam=beam.with_power(1.0),
            sphere=sphere,
            tolerance=tolerance,
            interpolation=interpolation,
            peak=float(arrays["peak"]),
            error=float(arrays["error"]),
            properties=_properties(json.loads(str(arrays["properties"]))),
            steepest=float(arrays["steepest"]),
            levels=tuple(TableLevel(float(r), float(h), n) for r, h, n in zip(radius, spacing, nodes, strict=True)),
        )
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
        RuntimeError,
        MemoryError,
    ):
        # absent, cut short, damaged or not ours; RuntimeError: a header that says encrypted, or of an unknown kind
        return None


def save(folder: Path, table: ForceTable) -> None:
    """Write a table atomically. A folder that cannot be written to costs the cache, not the run."""
    path = file_of(folder, table.beam, table.sphere, table.tolerance, table.interpolation)
    arrays = {
        "radius": np.array([level.radius for level in table.levels]),
        "spacing": np.array([level.spacing for level in table.levels]),
        "peak": np.array(table.peak),
        "error": np.array(table.error),
        "properties": np.array(json.dumps(table.properties and dataclasses.asdict(table.properties))),
        "steepest": np.array(table.steepest),
        **{f"node{n}": level.node for n, level in enumerate(table.levels)},
    }
    about = describe(table.beam, table.sphere, table.tolerance, table.interpolation)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=folder, prefix=".", suffix=".part")
    except OSError:
        return
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, about=np.array(about), checksum=np.array(_checksum(arrays)), **arrays)
        Path(part).replace(path)
    except OSError:
        Path(part).unlink(missing_ok=True)


def _properties(fields: dict[str, Any] | None) -> TrapProperties | None:
    if fields is None:
        return None
    return TrapProperties(**{k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()})


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 over names, shapes, types and bytes."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}{value.shape}{value.dtype.str}".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()
