"""What took long to compute, on disk: found by what it holds for, written whole or not at all, believed only if intact.

A file's name is the hash of a description; inside are the same description, the arrays, and a checksum of the arrays.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np


def cache_folder() -> Path:
    """`OTWARP_CACHE`, or `otwarp` in the user's cache folder."""
    chosen = os.environ.get("OTWARP_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "otwarp"


def file_of(folder: Path, about: str) -> Path:
    """Where the arrays belong that are described by `about`."""
    return folder / f"{hashlib.sha256(about.encode()).hexdigest()[:32]}.npz"


def load(folder: Path, about: str) -> dict[str, np.ndarray] | None:
    """The arrays described by `about`, or None if there are none that can be trusted."""
    try:
        with file_of(folder, about).open("rb") as file, np.load(file, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        intact = str(arrays.pop("about")) == about and str(arrays.pop("checksum")) == _checksum(arrays)
        return arrays if intact else None
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


def save(folder: Path, about: str, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays atomically. A folder that cannot be written to costs the cache, not the run."""
    path = file_of(folder, about)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=folder, prefix=".", suffix=".part")
    except OSError:
        return
    try:
        with os.fdopen(handle, "wb") as file:
            named: dict[str, Any] = {"about": np.array(about), "checksum": np.array(_checksum(arrays)), **arrays}
            np.savez(file, **named)
        Path(part).replace(path)
    except OSError:
        Path(part).unlink(missing_ok=True)


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 over names, shapes, types and bytes."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}{value.shape}{value.dtype.str}".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()
