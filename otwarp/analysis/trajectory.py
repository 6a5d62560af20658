"""A recorded run as the analysis wants it: one body, with the trap that holds it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.analysis.tracks import xarray
from otwarp.errors import InputError
from otwarp.record.folder import check_run

RUN = "run.nc"


def open_run(path: str | Path) -> Any:
    """The netCDF file of a recorded run, or of the folder that holds it, as a Dataset.

    Raises:
        InputError: It is none, or was cut off.

    Warns:
        PlausibilityWarning: The run ended early.
    """
    file = Path(path) / RUN if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise InputError(f"{file}: file = missing; allowed: the folder of a recorded run, or its {RUN}")
    check_run(file)
    try:
        run = xarray().open_dataset(file, engine="netcdf4")
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read ({error}); allowed: the {RUN} of a recorded run") from None
    if "frame" not in run.dims or "position" not in run or "layout" not in run.attrs:
        run.close()
        raise InputError(f"{file}: is no recorded run with bodies; allowed: the {RUN} that otwarp run wrote")
    return run


def load_trajectory(
    path: str | Path,
    *,
    body: str | None = None,
    world: int | None = None,
    start: float = 0.0,
    end: float = math.inf,
    rotation: bool = False,
) -> Any:
    """The way of a body of a recorded run, and what its traps did.

    Args:
        path: Folder of the run, or its `run.nc`.
        body: Name of the body, its path or the end of it; None: the first that a trap holds, or else the first.
        world: Which world; None: all, as repeats of one experiment.
        start, end: Part of the run that counts [s].
        rotation: Whether the displacement is that of the orientation, a rotation vector about its mean [rad], as of a
            robot whose traps hold its direction.

    Returns:
        Dataset over world, time, axis: `position`, and where traps hold the body `foci` (trap, world, time, xyz) and
        `trap_position` (their mean), `trap_force` (the sum), `work` that moving them has done on the bead [pN·µm];
        `displacement`, the position as the trap sees it, is what calibrations take. Attributes: `body`, `temperature`
        [K], NaN in a file that does not say, and `drag` [pN·s/µm], of Stokes for a lone sphere, NaN else.

    Raises:
        InputError: No run, no such body or world, or nothing left of the run.
    """
    with open_run(path) as run:
        name = _body(run, body)
        worlds = np.arange(run.sizes["world"])
        if world is not None and not 0 <= world < len(worlds):
            raise InputError(f"world is {world}; allowed: 0 to {len(worlds) - 1}")
        kept = _kept(run["time"].values, start, end)
        part = run.isel(frame=kept, world=worlds if world is None else [world])
        return _of_body(part.load(), name, rotation)


def _body(run: Any, wanted: str | None) -> str:
    names = [str(n) for n in run["body"].values]
    if wanted is None:
        held = run["trap_body"].values if "trap_body" in run else np.zeros(0, dtype=int)
        return names[next((int(b) for b in held if b >= 0), 0)]
    found = [n for n in names if n == wanted or n.endswith(f"/{wanted.strip('/')}")]
    if len(found) == 1:
        return found[0]
    said = ", ".join(names[:6]) + (" …" if len(names) > 6 else "")
    why = "is none of the run" if not found else f"is the name of {len(found)}"
    raise InputError(f"body {wanted} {why}; allowed: {said}")


def _kept(time: np.ndarray, start: float, end: float) -> np.ndarray:
    """Frames within the part; not the last one of a run that ends between frames."""
    whole = len(time)
    if whole > 3 and time[-1] - time[-2] < 0.75 * np.median(np.diff(time)):
        whole -= 1
    kept = np.flatnonzero((time[:whole] >= start) & (time[:whole] <= end))
    if len(kept) < 2:
        raise InputError(f"from {start:g} to {end:g} s are {len(kept)} frames; allowed: 2 or more of {len(time)}")
    return kept


def _of_body(run: Any, name: str, rotation: bool) -> Any:
    index = [str(n) for n in run["body"].values].index(name)
    place = run["unwrapped"] if "unwrapped" in run else run["position"]
    if "entries" in run and np.any(np.diff(run["entries"].values[..., index], axis=0)):
        raise InputError(f"body {name} has left the domain and come in again; allowed: one that stays")
    dims = ("world", "time", "axis")

    def series(values: Any) -> Any:
        return dims, np.moveaxis(np.asarray(values, dtype=float), 0, 1)

    coordinates = {"world": run["world"].values, "axis": ["x", "y", "z"]}
    coordinates["time"] = ("time", run["time"].values, {"units": "s"})
    out = xarray().Dataset(coords=coordinates)
    out["position"] = series(place.isel(body=index))
    held = np.flatnonzero(run["trap_body"].values == index) if "trap_body" in run else np.zeros(0, dtype=int)
    moved = np.zeros(3)
    if len(held):
        foci, force = run["trap_position"].isel(trap=held), run["trap_force"].isel(trap=held).values.astype(float)
        out["trap_position"] = series(foci.mean("trap"))
        out["foci"] = ("trap", "world", "time", "xyz"), np.moveaxis(foci.values.astype(float), (2, 1), (0, 1))
        out["trap_force"] = series(force.sum(axis=2))
        out["trap_power"] = dims[:2], run["trap_power"].isel(trap=held).sum("trap").values.T.astype(float)
        steps = np.diff(foci.values.astype(float), axis=0)
        work = np.sum(0.5 * (force[1:] + force[:-1]) * steps, axis=(2, 3))
        out["work"] = dims[:2], np.concatenate([np.zeros((1, work.shape[1])), np.cumsum(work, axis=0)]).T
        out["work"].attrs = {"units": "pN um", "long_name": "work of moving the traps"}
        moved = out["trap_position"].values
    out["displacement"] = dims, out["position"].values - moved
    for variable in ("position", "trap_position", "foci", "displacement"):
        if variable in out:
            out[variable].attrs["units"] = "um"
    if rotation:
        turned = rotation_vectors(np.asarray(run["orientation"].isel(body=index), dtype=float))
        out["displacement"] = series(turned)
        out["displacement"].attrs["units"] = "rad"
    spheres = json.loads(run.attrs["layout"])["spheres"]
    lone = spheres is None or len(spheres[index]) == 1
    drag = math.nan
    if "viscosity" in run.attrs and lone:
        radius = float(run["body_radius"].values[index])
        drag = math.pi * run.attrs["viscosity"] * (8.0 * radius**3 if rotation else 6.0 * radius)
    out.attrs = {
        "body": name,
        "scene": str(run.attrs.get("scene", "")),
        "temperature": float(run.attrs.get("temperature", math.nan)),
        "drag": drag,
        "traps": len(held),
    }
    return out


def rotation_vectors(quaternions: np.ndarray) -> np.ndarray:
    """(..., 3) rotation vectors [rad] from the mean of all orientations (..., 4) (x, y, z, w), in laboratory axes.

    The mean is the eigenvector of Σ q·qᵀ (Markley et al. 2007, doi:10.2514/1.28949).
    """
    from scipy.spatial.transform import Rotation

    flat = quaternions.reshape(-1, 4)
    mean = Rotation.from_quat(np.linalg.eigh(flat.T @ flat)[1][:, -1])
    return (Rotation.from_quat(flat) * mean.inv()).as_rotvec().reshape(*quaternions.shape[:-1], 3)
