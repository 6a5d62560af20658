"""An open USD stage and how its numbers become otwarp's: stage units to µm, time codes to seconds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.scene.check.numbers import FARTHEST
from otwarp.scene.description import Track
from otwarp.scene.read.attributes import applied_schemas
from otwarp.scene.read.crate import check_crate
from otwarp.scene.read.diagnostics import USD_ERRORS, quiet_usd, usd_reason
from otwarp.scene.read.typed import Values
from otwarp.scene.schema import register
from otwarp.scene.transforms import SHEAR_TOLERANCE, decompose
from otwarp.scene.vocabulary.values import bad

register()

SCALE_TOLERANCE = 1e-6
"""Largest relative difference of the three scales of a sphere; single-precision scales reach 1e-7."""

METRES = "metres"
"""Suffix of the scale by which a copy of a stage in metres is what the stage was."""


def open_stage(path: Path) -> Usd.Stage:
    """Open a stage; anything that is not a whole, fully composed USD file is refused.

    Raises:
        InputError: Missing file, not USD, truncated, or a reference that cannot be resolved; one line.
    """
    allowed = "must be a USD file (.usda, .usdc, .usd, .usdz)"
    if path.is_dir():
        raise InputError(f"{path}: file = a folder: {allowed}")
    if not path.is_file():
        hint = shipped.hint("scenes", path)
        raise InputError(f"{path}: there is no such file; a scene {allowed}, or the name of a shipped one{hint}")
    if not path.suffix or Sdf.FileFormat.FindByExtension(path.suffix.removeprefix(".")) is None:
        raise InputError(f"{path}: suffix = {path.suffix or '(none)'}: {allowed}")
    check_crate(path, allowed)
    with quiet_usd():
        known = Sdf.Layer.Find(str(path))
        try:
            if known and not known.dirty:
                known.Reload()
            stage = Usd.Stage.Open(str(path))
        except USD_ERRORS as error:
            raise InputError(f"{path}: contents = {usd_reason(error)}: {allowed}, whole and valid") from None
        for error in stage.GetCompositionErrors():
            raise bad(str(path), _site(error), "composition", usd_reason(error), "a reference that resolves")
    return stage


def _site(error: Any) -> str:
    return str(error.rootSite).split("<", 1)[-1].split(">", 1)[0] if hasattr(error, "rootSite") else "/"


class Source:
    """A stage that is being read.

    Attributes:
        file: What errors name.
        stage: The stage.
        unit: µm per stage unit.
        start: First time code of the run.
        rate: Time codes per second.
        values: Reads attributes, at the start unless told otherwise.
    """

    def __init__(self, stage: Usd.Stage, file: str):
        self.stage, self.file = stage, file
        if not stage.GetDefaultPrim():
            raise bad(
                file, "/", "defaultPrim", stage.GetRootLayer().defaultPrim or "(absent)", "the name of a root prim"
            )
        self.unit = self._unit()
        if UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
            raise bad(file, "/", "upAxis", UsdGeom.GetStageUpAxis(stage), "Z (beams travel along +Z)")
        self.start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else 0.0
        self.rate = stage.GetTimeCodesPerSecond()
        if not (math.isfinite(self.rate) and self.rate > 0.0):
            raise bad(file, "/", "timeCodesPerSecond", self.rate, "in (0, inf)")
        self.values = Values(file, Usd.TimeCode(self.start))
        self._cache = UsdGeom.XformCache(self.start)
        self._applied: dict[Sdf.Path, list[str]] = {}

    def _unit(self) -> float:
        if not self.stage.HasAuthoredMetadata("metersPerUnit"):
            raise bad(self.file, "/", "metersPerUnit", "(absent)", "authored, in (0, inf); 1e-6 is native")
        metres = UsdGeom.GetStageMetersPerUnit(self.stage)
        if not (math.isfinite(metres) and metres > 0.0):
            raise bad(self.file, "/", "metersPerUnit", metres, "in (0, inf); 1e-6 is native")
        return metres / 1e-6

    def bad(self, prim: Any, name: str, value: object, allowed: str) -> InputError:
        """The one-line error about an attribute of this file."""
        return bad(self.file, prim.GetPath() if isinstance(prim, Usd.Prim) else prim, name, value, allowed)

    def has(self, prim: Usd.Prim, schema: str) -> bool:
        """Whether a schema is applied, whether or not this USD's registry knows it."""
        return schema in self.applied(prim)

    def applied(self, prim: Usd.Prim) -> list[str]:
        """Names of the API schemas that are applied to a prim; looked up once."""
        path = prim.GetPath()
        if path not in self._applied:
            self._applied[path] = applied_schemas(prim)
        return self._applied[path]

    def geometry(self, prim: Usd.Prim, name: str, *, positive: bool = True) -> float:
        """A length attribute of a gprim (radius, height, size) in stage units at the start.

        Raises:
            InputError: Not a number, not finite, not positive, blocked, or changing in time.
        """
        value = float(self.values.value(prim, name, constant=True))
        if not math.isfinite(value) or value < 0.0 or (positive and value == 0.0):
            raise self.bad(prim, name, value, f"in {'(' if positive else '['}0, inf) stage units")
        return value

    def seconds(self, codes: np.ndarray) -> np.ndarray:
        """Time codes as seconds from the start of the run."""
        return (np.asarray(codes, float) - self.start) / self.rate

    def matrix(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) row-vector local-to-world matrix at the start, in stage units."""
        matrix = np.array(self._cache.GetLocalToWorldTransform(prim))
        if not np.isfinite(matrix).all():
            raise self.bad(prim, "xformOpOrder", "a transform that is not finite", "finite")
        return matrix

    def matrices(self, prim: Usd.Prim, codes: list[float]) -> np.ndarray:
        """(n, 4, 4) local-to-world matrices at several time codes, in stage units."""
        cache, out = UsdGeom.XformCache(), []
        for code in codes:
            cache.SetTime(code)
            out.append(np.array(cache.GetLocalToWorldTransform(prim)))
        stack = np.array(out)
        if not np.isfinite(stack).all():
            raise self.bad(prim, "xformOpOrder", "a transform that is not finite", "finite")
        return stack

    def relative(self, prim: Usd.Prim, ancestor: Usd.Prim) -> np.ndarray:
        """(4, 4) row-vector matrix from the prim's frame to that of an ancestor, in stage units."""
        return np.array(self._cache.ComputeRelativeTransform(prim, ancestor)[0])

    def split(self, prim: Usd.Prim, matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [µm], quaternions and scales [µm per local unit] of local-to-world matrices.

        Raises:
            InputError: A scale of zero, shear, or a place beyond `FARTHEST`.
        """
        if np.any(np.linalg.norm(matrices[:, :3, :3], axis=2) == 0.0):
            raise self.bad(prim, "xformOp:scale", 0, "nonzero")
        positions, rotations, scales, shear = decompose(matrices)
        if shear.max() > SHEAR_TOLERANCE:
            raise self.bad(prim, "xformOpOrder", "a transform with shear", "translation, rotation and scale")
        places = positions * self.unit
        if (far := np.abs(places).max(initial=0.0)) > FARTHEST:
            raise self.bad(prim, "xformOp:translate", f"{far:g} µm from the origin", f"within {FARTHEST:g} µm of it")
        return places, rotations, scales * self.unit

    def pose(self, prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), quaternion (4,) and scale (3,) at the start."""
        positions, rotations, scales = self.split(prim, self.matrix(prim)[None])
        return positions[0], rotations[0], scales[0]

    def uniform(self, prim: Usd.Prim, scale: np.ndarray) -> float:
        """The one scale of a sphere.

        Raises:
            InputError: The three differ.
        """
        sizes = np.abs(scale)
        if sizes.max() - sizes.min() > SCALE_TOLERANCE * sizes.max():
            shown = ", ".join(f"{s / self.unit:g}" for s in sizes)
            raise self.bad(prim, "xformOp:scale", f"({shown})", "uniform on a sphere")
        return float(sizes[0])


def track(times: np.ndarray, values: np.ndarray) -> Track:
    """A track through samples; a single one is a constant."""
    return Track.constant(values[0]) if len(values) == 1 else Track(times=times, values=values)


def vec3(values: np.ndarray) -> tuple[float, float, float]:
    """Three plain floats."""
    return (float(values[0]), float(values[1]), float(values[2]))


def quat(values: np.ndarray) -> tuple[float, float, float, float]:
    """Four plain floats (x, y, z, w)."""
    return (float(values[0]), float(values[1]), float(values[2]), float(values[3]))
