"""Authors positions and rotations as double-precision transform ops, at rest or time-sampled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from otwarp.scene.description import Track

DIGITS = 9
"""Decimals of what is computed rather than given (a time code, a rod's pose, the turn of a camera): finer than
anything they mean, and coarse enough that every processor writes the same text."""

_DOUBLE = UsdGeom.XformOp.PrecisionDouble


def rounded(values: np.ndarray) -> np.ndarray:
    """To `DIGITS` decimals, without negative zeros."""
    return np.round(values, DIGITS) + 0.0


def _quat(q: Any) -> Gf.Quatd:
    return Gf.Quatd(float(q[3]), float(q[0]), float(q[1]), float(q[2]))


def _vector(v: Any) -> Gf.Vec3d:
    return Gf.Vec3d(*(float(x) for x in v))


def author_pose(
    prim: Usd.Prim,
    position: Sequence[float] | np.ndarray,
    orientation: Sequence[float] | np.ndarray | None,
    scale: Sequence[float] | None = None,
) -> None:
    """Author translate, orient (x, y, z, w) and scale in place of what was there; None leaves an op out."""
    xformable = UsdGeom.Xformable(prim)
    xformable.ClearXformOpOrder()
    xformable.AddTranslateOp(_DOUBLE).Set(_vector(position))
    if orientation is not None:
        xformable.AddOrientOp(_DOUBLE).Set(_quat(orientation))
    if scale is not None:
        xformable.AddScaleOp(_DOUBLE).Set(_vector(scale))


def author_tracks(
    prim: Usd.Prim,
    rate: float,
    position: Track,
    orientation: Track | Sequence[float],
    scale: Sequence[float] | None = None,
) -> None:
    """Author a pose whose position and orientation may follow time samples; `rate` is time codes per second."""
    first = orientation.values[0] if isinstance(orientation, Track) else orientation
    author_pose(prim, position.values[0], first, scale)
    translate, orient = UsdGeom.Xformable(prim).GetOrderedXformOps()[:2]
    _samples(translate, rate, position, _vector)
    if isinstance(orientation, Track) and orientation.animated:
        _samples(orient, rate, orientation, _quat)


def _samples(op: UsdGeom.XformOp, rate: float, track: Track, convert: Any) -> None:
    if len(track.times) < 2:
        return
    op.GetAttr().Clear()
    for time, value in zip(track.times, track.values, strict=True):
        op.Set(convert(value), round(float(time) * rate, DIGITS))
