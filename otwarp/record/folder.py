"""What is found in the folder of a run: whether its numbers are whole, whether it ended early, and what it was."""

from __future__ import annotations

import json
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning

NUMBERS, SUMMARY = "run.nc", "summary.json"
ALLOWED = "allowed: the folder, run.usda or run.nc of a run that otwarp has recorded"


def mapped(file: Path) -> Any:
    """The numbers of a run, mapped into memory and never read as a whole: a `scipy.io.netcdf_file`.

    Raises:
        InputError: It was cut off, its times break off, or it is no netCDF-3 file.
    """
    from scipy.io import netcdf_file

    raw = file.open("rb")
    try:
        if raw.read(3) != b"CDF":
            raise InputError(f"{file}: is no netCDF-3 file; {ALLOWED}")
        raw.seek(0)
        data = netcdf_file(raw, mmap=True)
    except (ValueError, IndexError, TypeError, AssertionError) as error:
        raw.close()
        if isinstance(error, InputError):
            raise
        why = str(error)
        with warnings.catch_warnings():  # what was mapped so far complains when it goes
            warnings.simplefilter("ignore", RuntimeWarning)
            traceback.clear_frames(error.__traceback__)
        raise InputError(f"{file}: was cut off, or is no netCDF file ({why}); allowed: a whole copy") from None
    if "time" in data.variables:
        time = np.array(data.variables["time"].data, dtype=float)
        broken = np.flatnonzero(~np.isfinite(time) | (np.diff(time, prepend=-np.inf) <= 0.0))
        if len(broken):
            data.close()
            raise InputError(
                f"{file}: was cut off: from frame {broken[0]} of {len(time)} on its times are none; "
                "allowed: a whole copy"
            )
    return data


def check_run(file: Path) -> None:
    """Refuse the numbers of a run that were cut off, and warn of a run that ended early.

    A file that is not netCDF-3 is left to who reads it.

    Args:
        file: A `run.nc`.

    Raises:
        InputError: It is not there, or was cut off.

    Warns:
        PlausibilityWarning: `summary.json` beside it says that the run did not finish.
    """
    if not file.is_file():
        raise InputError(f"{file.parent}: holds no {file.name}; allowed: the folder of a recorded run")
    with file.open("rb") as raw:
        ours = raw.read(3) == b"CDF"
    if ours:
        mapped(file).close()
    warn_early(file.parent)


def warn_early(folder: Path) -> None:
    """Warn of a run that ended early, or has not ended.

    Warns:
        PlausibilityWarning: `summary.json` in the folder says so.
    """
    said = early_end(folder)
    if said:
        warnings.warn(said, PlausibilityWarning, stacklevel=3)


def early_end(folder: Path) -> str:
    """How far a run came that did not finish, in one line; empty for one that did, or whose summary is not there."""
    about = _summary(folder)
    status, done = str(about.get("status", "finished")), _done(folder, about)
    if status == "finished" or not isinstance(done, int | float):
        return ""
    asked = about.get("asked_s")
    of = f"{done:.4g} of {asked:.4g} s" if isinstance(asked, int | float) else f"{done:.4g} s"
    if status == "running":
        return f"{folder}: the run was killed, or still goes on: it has at least {of}"
    return f"{folder}: the run ended early, after {of} ({status.removeprefix('stopped: ')})"


def earlier_run(folder: Path) -> str:
    """What a run in the folder was: scene, worlds, duration; empty where none is."""
    if not (folder / NUMBERS).is_file() and not (folder / SUMMARY).is_file():
        return ""
    about = _summary(folder)
    worlds, done = about.get("worlds"), _done(folder, about)
    told = [str(about["scene"])] if about.get("scene") else []
    told += [f"{worlds} world{'' if worlds == 1 else 's'}"] if isinstance(worlds, int) else []
    told += [f"{done:.4g} s"] if isinstance(done, int | float) else []
    return ", ".join(told) or "without a summary"


def _done(folder: Path, about: dict[str, Any]) -> Any:
    """Simulated time of a run [s]; one that is running writes frames more often than its summary."""
    if about.get("status") != "running" or not (folder / NUMBERS).is_file():
        return about.get("duration_s")
    try:
        data = mapped(folder / NUMBERS)
    except InputError:
        return about.get("duration_s")
    time = np.array(data.variables["time"].data, dtype=float)
    data.close()
    return float(time[-1] - time[0]) if len(time) else 0.0


def _summary(folder: Path) -> dict[str, Any]:
    """What `summary.json` says; nothing where it is not there, or is something else."""
    try:
        said = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return said if isinstance(said, dict) else {}
