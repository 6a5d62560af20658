"""How a prim moves: its transform at time codes close enough that straight lines between them will do.

Tracks are interpolated linearly (rotations: linearly and normalised), but USD interpolates the values of transform
ops: a rotation of 270° between two samples is 27 keys here, and a prim off the axis of a turning parent goes round.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.scene.read.source import Source
from otwarp.scene.read.typed import SAMPLED, SPLINE
from otwarp.scene.transforms import continuous, decompose

LARGEST_TURN = 10.0
"""Rotation between two keys [degrees]."""

CHORD = 1e-3
"""Largest distance of a straight line between two keys from the path [µm]; thermal motion in traps is ten times it."""

TURN_ERROR = 1e-3
"""Largest error of a quaternion component halfway between two keys."""

_FINEST = 2.0**-12
"""Shortest piece of an interval between two authored samples."""

_Type = UsdGeom.XformOp
_EULER = {getattr(_Type, f"TypeRotate{axes}") for axes in ("X", "Y", "Z", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")}
_STRAIGHT = {_Type.TypeTranslate, *(t for n in "XYZ" if (t := getattr(_Type, f"TypeTranslate{n}", None)) is not None)}


def motion(source: Source, prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """World transform of a prim over time.

    Returns:
        Times [s] from the start of the run (n,), positions [µm] (n, 3), quaternions (n, 4) with continuous signs, and
        scales [µm per local unit] (n, 3). n = 1 for a prim without time samples.

    Raises:
        InputError: A transform that follows a spline, is not finite, has shear, or a scale of zero.
    """
    ops, codes = _sampled_ops(source, prim)
    if len(codes) < 2:
        codes = codes or [source.start]
        poses = source.split(prim, source.matrices(prim, codes))
        return source.seconds(np.array(codes)), *poses
    authored = np.array(codes)
    if all(op.GetOpType() in _STRAIGHT for op in ops):
        return source.seconds(authored), *source.split(prim, source.matrices(prim, codes))
    matrix_ops = any(op.GetOpType() == _Type.TypeTransform for op in ops)
    ends = source.split(prim, source.matrices(prim, codes))

    def poses_at(wanted: np.ndarray) -> tuple[np.ndarray, ...]:
        """Poses at the wanted time codes, as `source.split` gives them."""
        matrices = source.matrices(prim, wanted.tolist())
        if matrix_ops:
            scale = ends[2][np.searchsorted(authored, wanted, side="right") - 1] / source.unit
            matrices = _rigid(matrices, scale)
        return source.split(prim, matrices)

    pieces = np.maximum(1, np.ceil(_turns(source, ops, codes) / LARGEST_TURN - 1e-9)).astype(int)
    keys = np.concatenate([[authored[0]], *(np.linspace(a, b, n + 1)[1:] for a, b, n in _intervals(authored, pieces))])
    return _refined(source, keys, poses_at, authored)


def _intervals(codes: np.ndarray, pieces: np.ndarray) -> list[tuple[float, float, int]]:
    return list(zip(codes[:-1].tolist(), codes[1:].tolist(), pieces.tolist(), strict=True))


def _refined(
    source: Source, keys: np.ndarray, poses_at: Callable[[np.ndarray], tuple[np.ndarray, ...]], authored: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Halve every interval whose middle is off the straight line, until none is."""
    finest = _FINEST * float(np.diff(authored).min())
    poses = poses_at(keys)
    fresh = np.ones(len(keys) - 1, dtype=bool)  # intervals that have not been looked at
    while fresh.any():
        left = np.flatnonzero(fresh)
        middle = 0.5 * (keys[left] + keys[left + 1])
        between = poses_at(middle)
        off = _off(poses, between, left) & (keys[left + 1] - keys[left] > finest)
        place = left[off] + 1
        keys = np.insert(keys, place, middle[off])
        poses = tuple(np.insert(p, place, m[off], axis=0) for p, m in zip(poses, between, strict=True))
        halves = place + np.arange(len(place))  # where the new keys are now
        fresh = np.zeros(len(keys) - 1, dtype=bool)
        fresh[halves - 1] = fresh[halves] = True
    return source.seconds(keys), poses[0], continuous(poses[1]), poses[2]


def _off(poses: tuple[np.ndarray, ...], between: tuple[np.ndarray, ...], left: np.ndarray) -> np.ndarray:
    """Whether each middle is further from the mean of its neighbours than a track may be."""
    chord = np.linalg.norm(between[0] - 0.5 * (poses[0][left] + poses[0][left + 1]), axis=1)
    a, b = poses[1][left], poses[1][left + 1]
    mean = a + np.where((a * b).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * b
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    same = np.where((mean * between[1]).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * between[1]
    return (chord > CHORD) | (np.abs(mean - same).max(axis=1) > TURN_ERROR)


def _sampled_ops(source: Source, prim: Usd.Prim) -> tuple[list[UsdGeom.XformOp], list[float]]:
    """Transform ops with time samples that act on a prim, ancestors included, and the sorted time codes of all.

    Raises:
        InputError: One that follows a spline.
    """
    ops, codes = [], set()
    while prim and not prim.IsPseudoRoot():
        xformable = UsdGeom.Xformable(prim)
        if xformable:
            for op in xformable.GetOrderedXformOps():
                if op.GetAttr().HasSpline():
                    raise source.bad(prim, op.GetAttr().GetName(), SPLINE, SAMPLED)
                if samples := op.GetTimeSamples():
                    ops.append(op)
                    codes.update(samples)
            if xformable.GetResetXformStack():
                break
        prim = prim.GetParent()
    return ops, sorted(codes)


def _values_of(source: Source, op: UsdGeom.XformOp, codes: list[float]) -> list[Any]:
    attribute = op.GetAttr()
    return [source.values.value(attribute.GetPrim(), attribute.GetName(), time=code) for code in codes]


def _turns(source: Source, ops: list[UsdGeom.XformOp], codes: list[float]) -> np.ndarray:
    """(n - 1,) upper bound of the rotation between neighbouring time codes [degrees]."""
    total = np.zeros(len(codes) - 1)
    for op in ops:
        kind, values = op.GetOpType(), _values_of(source, op, codes)
        if kind in _EULER:
            angles = np.array(values, dtype=float).reshape(len(codes), -1)
            total += np.abs(np.diff(angles, axis=0)).sum(axis=1)
        elif kind == _Type.TypeOrient:
            q = np.array([[*v.GetImaginary(), v.GetReal()] for v in values], dtype=float)
            total += _angles(q / np.linalg.norm(q, axis=1, keepdims=True))
        elif kind == _Type.TypeTransform:
            total += _angles(decompose(np.array(values, dtype=float).reshape(-1, 4, 4))[1])
    return total


def _angles(q: np.ndarray) -> np.ndarray:
    cosine = np.abs((q[1:] * q[:-1]).sum(axis=1)).clip(0.0, 1.0)
    return np.degrees(2.0 * np.arccos(cosine))


def _rigid(matrices: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """The same matrices with the nearest rotation and the given scales (n, 3).

    USD interpolates a matrix component by component, so that a turning prim shrinks between its samples; that is an
    artefact of the file format and not the motion of a solid.
    """
    u, _, v = np.linalg.svd(matrices[:, :3, :3] / scale[:, :, None])
    out = matrices.copy()
    out[:, :3, :3] = scale[:, :, None] * (u @ v)
    return out
