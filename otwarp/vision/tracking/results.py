"""What came of a run that was tracked: errors beside the truth as a table, and `track.nc`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.files import written
from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.tracking.consistency import Consistency, consistency
from otwarp.vision.tracking.recorded import RecordedBody, Step
from otwarp.vision.tracking.shape import Shape


@dataclass(frozen=True, eq=False, kw_only=True)
class Errors:
    """How far measurements and poses are from the truth, n frames; nan where there is none.

    Attributes:
        raw, filtered: (n, 3) of the body's centre, as the source saw it and as the tracker has it [µm].
        raw_axis, filtered_axis: (n) angles between the long axes [rad].
        nees, nis: Their means per degree of freedom; None without a frame that counts.
        seen, refused: Measurements that came, and those of them that were refused as outliers.
    """

    raw: np.ndarray
    filtered: np.ndarray
    raw_axis: np.ndarray
    filtered_axis: np.ndarray
    nees: Consistency | None
    nis: Consistency | None
    seen: int
    refused: int


def errors_of(recorded: RecordedBody, shape: Shape, steps: list[Step]) -> Errors:
    """Compare the frames of a run with the truth."""
    n = len(steps)
    raw, filtered = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    axes = np.full((2, n), np.nan)
    for k, step in enumerate(steps):
        turn = rotation_matrix(recorded.orientation[k, recorded.index])
        centre = recorded.position[k, recorded.index] + turn @ (shape.arm - shape.origin)
        axis = turn @ shape.axis
        if step.seen is not None:
            place, shown = step.shown[0], rotation_matrix(step.shown[1])
            raw[k] = step.seen.position - place - shown @ (shape.arm - shape.origin)
            if step.seen.axis is not None:
                axes[0, k] = _between(step.seen.axis, shown @ shape.axis, shape.reversible)
        if step.pose is not None:
            its = rotation_matrix(step.pose.orientation)
            filtered[k] = step.pose.position + its @ (shape.arm - shape.origin) - centre
            if np.any(shape.axis):
                axes[1, k] = _between(its @ shape.axis, axis, shape.reversible)
    inside = [s for s in steps if s.degrees and math.isfinite(s.nis)]
    nis = None
    if inside:
        degrees = max(s.degrees for s in inside)
        nis = consistency([s.nis / s.degrees * degrees for s in inside], degrees)
    known = [s for s in steps[1:] if math.isfinite(s.nees)]
    nees = consistency([s.nees for s in known], known[0].freedom) if known else None
    came = [s for s in steps if s.degrees]
    return Errors(
        raw=raw, filtered=filtered, raw_axis=axes[0], filtered_axis=axes[1], nees=nees, nis=nis, seen=len(came),
        refused=sum(not s.accepted for s in came),
    )  # fmt: skip


def _between(first: np.ndarray, last: np.ndarray, reversible: bool) -> float:
    cosine = float(first @ last)
    return math.atan2(float(np.linalg.norm(np.cross(first, last))), abs(cosine) if reversible else cosine)


def rows_of(errors: Errors) -> list[tuple[str, str, str]]:
    """The table: a quantity, what the source says of it, what the tracker does."""
    rms = lambda values: math.sqrt(float(np.nanmean(np.square(values)))) if np.any(np.isfinite(values)) else math.nan  # noqa: E731
    rows = [
        (f"{name}, root mean square error [nm]", f"{1e3 * rms(errors.raw[:, k]):.3g}",
         f"{1e3 * rms(errors.filtered[:, k]):.3g}")
        for k, name in enumerate("xyz")
    ]  # fmt: skip
    if np.any(np.isfinite(errors.filtered_axis)):
        both = [f"{math.degrees(rms(v)):.3g}" for v in (errors.raw_axis, errors.filtered_axis)]
        rows.append(("axis, root mean square error [°]", both[0], both[1]))
    for name, found in (("NIS per degree of freedom", errors.nis), ("NEES per degree of freedom", errors.nees)):
        if found is not None:
            text = f"{found.mean:.3f} ± {found.error:.3f}"
            rows.append((name, text, "") if name.startswith("NIS") else (name, "", text))
    rows.append(("measurements, refused", f"{errors.seen}, {errors.refused}", ""))
    return rows


def save_track(file: Path, recorded: RecordedBody, steps: list[Step], errors: Errors, **about: Any) -> Path:
    """Write `track.nc`: what was seen, what the tracker made of it, the truth, and poses predicted between frames.

    Args:
        file: Where.
        recorded, steps, errors: The run and what came of it.
        about: Attributes of the file.

    Raises:
        InputError: The file cannot be written.
        OSError: The disk is full.
    """
    import netCDF4

    # made in memory, as netCDF writes to a full disk without saying so, or with what names no cause
    data = netCDF4.Dataset("track.nc", "w", memory=0)
    try:
        data.setncatts({"title": "track of a body through the frames of a run", "body": recorded.body, **about})
        between = [p for s in steps for p in s.between]
        sizes = {"frame": len(steps), "xyz": 3, "quaternion": 4, "pose": 6, "pose_too": 6, "prediction": len(between)}
        for name, size in sizes.items():
            data.createDimension(name, size)
        _frames(data, recorded, steps, errors)
        _poses(data, "predicted_", ("prediction",), between)
        _put(data, "predicted_time", ("prediction",), [p.time for p in between], "s", "time of a prediction")
    finally:
        made = data.close()
    with written(file, f"--out {file}") as part:
        part.write_bytes(made)
    return file


def _frames(data: Any, recorded: RecordedBody, steps: list[Step], errors: Errors) -> None:
    none = np.full(3, np.nan)
    frame = ("frame",)
    _put(data, "time", frame, [s.time for s in steps], "s", "time of a frame")
    own = recorded.index
    _put(data, "true_position", (*frame, "xyz"), recorded.position[:, own], "um", "origin of the prim, as simulated")
    _put(
        data, "true_orientation", (*frame, "quaternion"), recorded.orientation[:, own], "1", "of the prim, as simulated"
    )
    seen = [s.seen.position if s.seen is not None else none for s in steps]
    _put(data, "seen_position", (*frame, "xyz"), seen, "um", "centre of the body, as the source saw it")
    axis = [s.seen.axis if s.seen is not None and s.seen.axis is not None else none for s in steps]
    _put(data, "seen_axis", (*frame, "xyz"), axis, "1", "long axis of the body, as the source saw it")
    deviations = [np.sqrt(np.diag(s.seen.covariance)[:3]) if s.seen is not None else none for s in steps]
    _put(data, "seen_deviation", (*frame, "xyz"), deviations, "um", "standard deviation along the camera's axes")
    _poses(data, "", frame, [s.pose for s in steps])
    for name, values, units, said in (
        ("nis", [s.nis for s in steps], "1", "squared innovation over its covariance"),
        ("nis_degrees", [s.degrees for s in steps], "1", "degrees of freedom of nis"),
        ("nees", [s.nees for s in steps], "1", "squared error over its covariance"),
        ("nees_degrees", [s.freedom for s in steps], "1", "degrees of freedom of nees"),
        ("accepted", [int(s.accepted) for s in steps], "1", "whether the measurement was taken"),
        ("axis_error", errors.filtered_axis, "rad", "angle between the axes of track and truth"),
    ):
        _put(data, name, frame, values, units, said)


def _poses(data: Any, prefix: str, dimension: tuple[str], poses: list[Any]) -> None:
    for name, shape, units, said in (
        ("position", (3,), "um", "origin of the prim, by what had come in by then"),
        ("orientation", (4,), "1", "quaternion of the prim (x, y, z, w)"),
        ("covariance", (6, 6), "um, rad", "of position and of the turn in the axes of the world"),
        ("probability", (), "1", "of this hypothesis among all"),
    ):
        values = np.full((len(poses), *shape), np.nan)
        for n, pose in enumerate(poses):
            if pose is not None:
                values[n] = getattr(pose, name)
        axes = {(3,): ("xyz",), (4,): ("quaternion",), (6, 6): ("pose", "pose_too"), (): ()}[shape]
        _put(data, prefix + name, (*dimension, *axes), values, units, said)


def _put(data: Any, name: str, axes: tuple[str, ...], values: Any, units: str, said: str) -> None:
    variable = data.createVariable(name, "f8", axes, fill_value=False)
    variable.setncatts({"units": units, "long_name": said})
    variable[:] = np.asarray(values, dtype=float)
