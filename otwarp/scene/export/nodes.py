"""Matrices at several times → position, rotation and scale of a node of glTF, and how they change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.scene.read.typed import Values
from otwarp.scene.transforms import decompose

STILL = 1e-9
"""Samples that differ by less, relative to the largest, do not move."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions (n, 3), quaternions (n, 4) in (x, y, z, w) and scales (n, 3) at n times.

    Matrices with shear, which no node can have, lose it.
    """

    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray

    @staticmethod
    def of(matrices: np.ndarray, shown: np.ndarray | None = None) -> Motion:
        """From row-vector matrices (n, 4, 4); what is not `shown` (n,) has no size."""
        place, turn, size, _ = decompose(matrices)
        flat = ~np.isfinite(turn).all(axis=1) | (np.abs(size).min(axis=1) == 0.0)
        turn[flat] = (0.0, 0.0, 0.0, 1.0)
        return Motion(place, turn, size if shown is None else size * shown[:, None])

    def parts(self) -> dict[str, np.ndarray]:
        """What moves a node, by glTF's names."""
        return {"translation": self.translation, "rotation": self.rotation, "scale": self.scale}

    def first(self) -> dict[str, list[float]]:
        """Properties of the node at the first time, where they are not the default."""
        usual = {"translation": [0.0] * 3, "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0] * 3}
        rows = {name: rows[0].tolist() for name, rows in self.parts().items()}
        return {name: row for name, row in rows.items() if row != usual[name]}

    def moving(self) -> dict[str, np.ndarray]:
        """The parts that change."""
        return {
            name: rows
            for name, rows in self.parts().items()
            if np.ptp(rows, axis=0).max() > STILL * max(np.abs(rows).max(), 1e-300)
        }


def local_matrices(prim: Usd.Prim, codes: list[float]) -> np.ndarray:
    """(n, 4, 4) row-vector matrices of a prim in the frame of the one above it; (1, 4, 4) if it does not move."""
    xformable = UsdGeom.Xformable(prim)
    if not xformable:
        return np.eye(4)[None]
    times = codes if xformable.TransformMightBeTimeVarying() else codes[:1]
    return np.array([np.array(xformable.GetLocalTransformation(code)) for code in times])


def shown(values: Values, prim: Usd.Prim, codes: list[float]) -> np.ndarray:
    """(n,) or, if that does not change, (1,): 1 where a prim is not invisible, else 0."""
    if not prim.IsA(UsdGeom.Imageable):
        return np.ones(1)
    visibility = UsdGeom.Imageable(prim).GetVisibilityAttr()
    times = codes if visibility.ValueMightBeTimeVarying() else codes[:1]
    return np.array([float(values.value(prim, "visibility", time=code) != UsdGeom.Tokens.invisible) for code in times])
