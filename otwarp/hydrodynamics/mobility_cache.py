"""Mobilities from surface blobs on disk, by `otwarp.cache`: under a hash of geometry, accuracy and version."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from otwarp import cache as disk
from otwarp.hydrodynamics.rigid import BodyMobility, assemble

VERSION = 1
"""Raise it with any change of the numbers that a computation gives."""


def describe(
    centres: np.ndarray, radii: np.ndarray, rods: tuple[np.ndarray, np.ndarray, np.ndarray], accuracy: float
) -> str:
    """What a mobility holds for, as canonical JSON."""
    spheres = np.column_stack([centres, radii]).tolist()
    capsules = np.column_stack([rods[0], rods[1], rods[2]]).tolist()
    about = {"mobility": VERSION, "spheres": spheres, "rods": capsules, "accuracy": accuracy}
    return json.dumps(about, sort_keys=True)


def cached(
    cache: bool | Path,
    centres: np.ndarray,
    radii: np.ndarray,
    rods: tuple[np.ndarray, np.ndarray, np.ndarray],
    accuracy: float,
    compute: Callable[[], BodyMobility],
) -> BodyMobility:
    """The mobility on disk, or the one that `compute` gives, which is then kept there.

    Args:
        cache: The folder; True for `otwarp.cache.cache_folder()`, False to compute anyway and keep nothing.
        centres, radii, rods, accuracy: What it holds for; see `body_mobility`.
        compute: Called without arguments when nothing on disk can be trusted.
    """
    folder = disk.cache_folder() if cache is True else cache
    if not folder:
        return compute()
    about = describe(centres, radii, rods, accuracy)
    found = _read(disk.load(folder, about), len(radii))
    if found is None:
        found = compute()
        disk.save(folder, about, {name: np.asarray(getattr(found, name)) for name in _PARTS})
    return found


_PARTS = {"reference": (3,), "mobility": (6, 6), "flow_coupling": (), "error": (), "blobs": ()}


def _read(arrays: dict[str, np.ndarray] | None, spheres: int) -> BodyMobility | None:
    if arrays is None:
        return None
    try:
        if any(arrays[name].shape != shape for name, shape in (_PARTS | {"flow_coupling": (spheres, 6, 6)}).items()):
            return None
        return assemble(
            arrays["reference"],
            arrays["mobility"],
            arrays["flow_coupling"],
            error=float(arrays["error"]),
            blobs=int(arrays["blobs"]),
        )
    except (KeyError, ValueError, np.linalg.LinAlgError):
        return None
