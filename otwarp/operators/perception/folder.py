"""A sweep of SIMULATED operators on disk: a study's folder, and `probes.npz`, the answers of hands without people."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from otwarp.files import claimed, written
from otwarp.operators.folder import Folder, arrays_of, create, run_study
from otwarp.operators.perception.sweep import Sweep

PROBES = "probes.npz"
"""File of the probes, in the folder."""


def run_sweep(
    sweep: Sweep, path: Path, *, device: str | None = None, progress: Callable[[int, int], None] | None = None
) -> Folder:
    """Compute a sweep, or go on with it: probes first, then the trials, chunk by chunk.

    Args:
        sweep: What is asked.
        path: Its folder.
        device: Where; None for the best available.
        progress: Called with parts done and in all, after each; the probes are one.

    Raises:
        InputError: The folder holds something else, or another process works in it.
        OSError: The disk is full.
    """
    folder = create(path, sweep)
    probed = int(sweep.repeats > 0)
    if probed and not (path / PROBES).exists():
        with claimed(path, "runs this study; allowed: one at a time"):
            found = sweep.probe(device=device)
            with written(path / PROBES) as part, part.open("wb") as file:
                np.savez_compressed(file, **found)  # type: ignore[arg-type]

    def told(done: int, count: int) -> None:
        """Parts of the trials among all."""
        if progress is not None:
            progress(done + probed, count + probed)

    if probed:
        told(0, sweep.chunks)
    run_study(sweep, path, device=device, progress=told)
    return folder


def is_sweep(folder: Folder) -> bool:
    """Whether the folder holds a sweep."""
    return "perception" in folder.asked()


def probes_of(folder: Folder) -> dict[str, np.ndarray]:
    """What `Sweep.probe` gave; empty where nothing was probed.

    Raises:
        InputError: The file cannot be read.
    """
    file = folder.path / PROBES
    return arrays_of(file) if file.exists() else {}
