"""Force tables on disk, by `otwarp.cache`: under a hash of beam, sphere, tolerance, interpolation and version."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from otwarp import cache
from otwarp.cache import cache_folder
from otwarp.laws.table import Interpolation
from otwarp.optics.analysis import TrapProperties
from otwarp.optics.beam import Beam
from otwarp.optics.mie import Particle
from otwarp.optics.table import ForceTable, TableLevel

__all__ = ["cache_folder", "describe", "file_of", "load", "save"]

VERSION = 2
"""Raise it with any change of the format or of the numbers a build gives."""


def describe(beam: Beam, sphere: Particle, tolerance: float, interpolation: str) -> str:
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


def file_of(folder: Path, beam: Beam, sphere: Particle, tolerance: float, interpolation: str) -> Path:
    """Path of the cached table of a beam, sphere, tolerance and interpolation."""
    return cache.file_of(folder, describe(beam, sphere, tolerance, interpolation))


def load(
    folder: Path, beam: Beam, sphere: Particle, tolerance: float, interpolation: Interpolation
) -> ForceTable | None:
    """The cached table, or None if there is none that can be trusted; read once as long as its file is the same."""
    about = describe(beam, sphere, tolerance, interpolation)
    try:
        seen = cache.file_of(folder, about).stat()
    except OSError:
        return None
    return _read(folder, about, (seen.st_mtime_ns, seen.st_size), beam, sphere, tolerance, interpolation)


@functools.lru_cache(maxsize=4)
def _read(
    folder: Path,
    about: str,
    seen: tuple[int, int],
    beam: Beam,
    sphere: Particle,
    tolerance: float,
    interpolation: Interpolation,
) -> ForceTable | None:
    """The table of a file that was `seen` with a time and a size; tables never change."""
    arrays = cache.load(folder, about)
    if arrays is None:
        return None
    try:
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
    except (ValueError, KeyError, TypeError, MemoryError):  # intact, but not a table as this version writes it
        return None


def save(folder: Path, table: ForceTable) -> None:
    """Write a table atomically. A folder that cannot be written to costs the cache, not the run."""
    arrays = {
        "radius": np.array([level.radius for level in table.levels]),
        "spacing": np.array([level.spacing for level in table.levels]),
        "peak": np.array(table.peak),
        "error": np.array(table.error),
        "properties": np.array(json.dumps(table.properties and dataclasses.asdict(table.properties))),
        "steepest": np.array(table.steepest),
        **{f"node{n}": level.node for n, level in enumerate(table.levels)},
    }
    cache.save(folder, describe(table.beam, table.sphere, table.tolerance, table.interpolation), arrays)


def _properties(fields: dict[str, Any] | None) -> TrapProperties | None:
    if fields is None:
        return None
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
    return TrapProperties(**values)
