"""Point sets and forces as CSV files with columns x_um,y_um,z_um and Qx,Qy,Qz."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written

POINT_COLUMNS = ("x_um", "y_um", "z_um")
FORCE_COLUMNS = ("Qx", "Qy", "Qz")

FARTHEST = 200.0
"""Distance from the focus [µm] of a point: an exact force costs nodes in proportion, and has died out by then."""


def read_points(path: Path) -> np.ndarray:
    """Read sphere centres relative to the focus, (n, 3) µm; other columns are ignored.

    Raises:
        InputError: No such file, a missing column, an entry that is not a finite number, or a point beyond `FARTHEST`.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            missing = [c for c in POINT_COLUMNS if c not in (reader.fieldnames or [])]
            if missing:
                raise InputError(f"{path}: column {missing[0]} is missing; allowed: {', '.join(POINT_COLUMNS)}")
            rows = [_point(path, reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "not a CSV file"
        raise InputError(f"points file {path} cannot be read: {reason}") from error
    return np.array(rows, dtype=float).reshape(-1, 3)


def _point(path: Path, line: int, row: dict[str, str | None]) -> list[float]:
    point = [_number(path, line, column, row[column]) for column in POINT_COLUMNS]
    distance = math.hypot(*point)
    if distance > FARTHEST:
        raise InputError(
            f"{path}: line {line}, the point is {distance:.4g} µm from the focus; allowed: up to {FARTHEST:g} µm"
        )
    return point


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = float("nan")
    if text is None:
        raise InputError(f"{path}: line {line} ends before column {column}; allowed: {', '.join(POINT_COLUMNS)}")
    if not math.isfinite(value):
        raise InputError(f"{path}: line {line}, column {column} is {text!r}; allowed: a finite number")
    return value


def write_forces(path: Path, points: np.ndarray, force: np.ndarray) -> None:
    """Write points and forces with all digits, to a temporary file that then takes the name.

    Raises:
        InputError: The file cannot be written.
    """
    with written(path, f"forces file {path}") as part, part.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*POINT_COLUMNS, *FORCE_COLUMNS])
        writer.writerows([[repr(float(v)) for v in (*p, *q)] for p, q in zip(points, force, strict=True)])
