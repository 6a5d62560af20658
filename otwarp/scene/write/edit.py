"""A stage that is edited: things are added, moved, deleted, given a path; undone; and saved as a file of its own.

Edits stand in a layer over the file, which is never written. Each is judged by reading the scene as it would be saved:
one that could not be loaded leaves everything as it was.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt

from otwarp.errors import InputError
from otwarp.scene.description import Body, Goal, Obstacle, Trap
from otwarp.scene.read.source import open_stage
from otwarp.scene.read.typed import Values
from otwarp.scene.scene import Scene
from otwarp.scene.write.builder import SceneBuilder
from otwarp.scene.write.export import export_layer
from otwarp.scene.write.poses import DIGITS

SUFFIX = "edited"
"""Of the transform op by which a prim is moved that has no place of its own to change."""
MICROMETRE = 1e-6
SAME_UNIT = 1e-9
"""Relative difference of `metersPerUnit` from a micrometre that is none."""


class StageEditor:
    """Edits of one scene.

    Args:
        file: The scene.

    Raises:
        InputError: It cannot be loaded, its unit is not the micrometre, or its default prim is not at the origin.
    """

    def __init__(self, file: str | Path):
        self.file = Path(file)
        Scene.load(self.file)
        self._stage = open_stage(self.file)
        self._values = Values(str(self.file), Usd.TimeCode.EarliestTime())
        unit = UsdGeom.GetStageMetersPerUnit(self._stage)
        if abs(unit / MICROMETRE - 1.0) > SAME_UNIT:
            raise InputError(f"{file}: metersPerUnit = {unit:g}: must be 1e-06, for a scene that is edited")
        self.root = str(self._stage.GetDefaultPrim().GetPath())
        place = UsdGeom.XformCache().GetLocalToWorldTransform(self._stage.GetDefaultPrim())
        if place != Gf.Matrix4d(1.0):
            raise InputError(
                f"{file}: {self.root} is transformed: must stand at the origin, for a scene that is edited"
            )
        self._edits = self._stage.GetSessionLayer()
        self._edits.timeCodesPerSecond = self._stage.GetTimeCodesPerSecond()  # else its time samples are stretched
        self._stage.SetEditTarget(self._edits)
        self._undo: list[str] = []
        self._folder = tempfile.TemporaryDirectory(prefix="otwarp-edit-")
        self._numbers = itertools.count()
        try:
            self.scene = self._read()
            """As it is now; its file is a copy that lives as long as this object."""
        except BaseException:
            self.close()
            raise
        self.saved = True
        """Whether there is nothing that was not saved."""

    def close(self) -> None:
        """Remove the copies."""
        self._folder.cleanup()

    @property
    def undoable(self) -> int:
        """How many edits can be undone."""
        return len(self._undo)

    def add(self, item: Trap | Body | Obstacle | Goal) -> None:
        """Add something at the path `item.prim`.

        Raises:
            InputError: The path is taken, or the scene with it could not be loaded.
        """
        self.author([item.prim], lambda builder: builder.add(item))

    def author(self, prims: Sequence[str], write: Callable[[SceneBuilder], object]) -> None:
        """Add what is written by a builder, as one edit.

        Args:
            prims: Paths of what is added.
            write: Adds it to a `SceneBuilder` whose root is that of the scene.

        Raises:
            InputError: A path is taken, or the scene with it could not be loaded.
        """
        taken = [prim for prim in prims if self._stage.GetPrimAtPath(prim)]
        if taken:
            raise InputError(f"{taken[0]}: path is taken; must be a new one")

        def work() -> None:
            """Author it in a stage of its own, and copy what came of it."""
            builder = SceneBuilder(root=self.root)
            write(builder)
            layer = builder.stage.GetRootLayer()
            looks = Sdf.Path(self.root).AppendChild("Looks")
            found = layer.GetPrimAtPath(looks)
            for path in (*map(Sdf.Path, prims), *(child.path for child in (found.nameChildren if found else ()))):
                if not self._stage.GetPrimAtPath(path):
                    self._copy(layer, path, path)

        self._edit(work)

    def duplicate(self, prims: Sequence[str], by: Sequence[float]) -> list[str]:
        """Add copies of prims with all that they have, moved; among them a trap holds the copy of what it held.

        No hand moves a copied trap: the hands have theirs.

        Args:
            prims: Paths.
            by: In the world [µm].

        Returns:
            Paths of the copies, beside their originals.

        Raises:
            InputError: The scene could not be loaded with them.
        """
        names: dict[str, str] = {}
        for prim in prims:
            names[prim] = self._beside(prim, set(names.values()))

        def work() -> None:
            """Copy, let traps hold the copies, and move."""
            flat = self._flat(None)
            for old, new in names.items():
                self._copy(flat, Sdf.Path(old), Sdf.Path(new))
            for trap in [t for t in self.scene.traps if t.prim in names]:
                copy = self._stage.GetPrimAtPath(names[trap.prim])
                held = Sdf.Path(trap.holds) if trap.holds is not None else Sdf.Path()
                for old, new in names.items():
                    if not held.isEmpty and held.HasPrefix(Sdf.Path(old)):
                        copy.GetRelationship("ot:trap:holds").SetTargets([held.ReplacePrefix(old, new)])
                if trap.hand != "none":
                    copy.GetAttribute("ot:trap:hand").Set("none")
            for new in names.values():
                self._move(self._stage.GetPrimAtPath(new), np.array([float(x) for x in by]))

        self._edit(work)
        return list(names.values())

    def move(self, prims: Iterable[str | tuple[str, int]], by: Sequence[float]) -> None:
        """Move prims, or instances of a point instancer, by the same way.

        Args:
            prims: Paths, or (path of the instancer, index).
            by: In the world [µm]; of something that moves along time samples, all of them.

        Raises:
            InputError: The scene could not be loaded then.
        """
        way = np.array([float(x) for x in by])

        def work() -> None:
            """One after the other."""
            for name in prims:
                if isinstance(name, tuple):
                    self._move_instance(*name, way)
                else:
                    self._move(self._stage.GetPrimAtPath(name), way)

        self._edit(work)

    def delete(self, name: str | tuple[str, int]) -> None:
        """Take a prim out of the scene, or an instance; traps that were to hold it hold nothing then.

        Raises:
            InputError: The scene could not be loaded then, as one whose goal names it.
        """

        def work() -> None:
            """Switched off, whatever layer or reference it comes from."""
            if isinstance(name, tuple):
                instancer = UsdGeom.PointInstancer(self._stage.GetPrimAtPath(name[0]))
                ids = self._values.value(instancer.GetPrim(), "ids", absent=None)
                instancer.DeactivateId(int(ids[name[1]]) if ids else name[1])
                return
            gone = Sdf.Path(name)
            for trap in self.scene.traps:
                if trap.holds is not None and Sdf.Path(trap.holds).HasPrefix(gone):
                    self._stage.GetPrimAtPath(trap.prim).GetRelationship("ot:trap:holds").SetTargets([])
            self._stage.GetPrimAtPath(gone).SetActive(False)

        self._edit(work)

    def path(self, trap: str, places: Sequence[Sequence[float]], speed: float) -> float:
        """Have a trap go from where it starts through places, in straight lines.

        Args:
            trap: Its path.
            places: (n, 3) in the world [µm].
            speed: [µm/s].

        Returns:
            Time at which it arrives [s].

        Raises:
            InputError: No places, two that are the same, a speed that is not above 0, or the scene could not be loaded.
        """
        start = next((t.position.at(0.0) for t in self.scene.traps if t.prim == trap), None)
        if start is None or not len(places):
            raise InputError(f"{trap}: path of {len(places)} places: must be a trap's, with one place or more")
        if not (math.isfinite(speed) and speed > 0.0):
            raise InputError(f"{trap}: speed = {speed:g} µm/s: must be above 0")
        points = np.vstack([start, np.asarray(places, dtype=float).reshape(-1, 3)])
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if np.any(steps <= 0.0):
            raise InputError(f"{trap}: path: two places after each other must differ")
        times = np.concatenate([[0.0], np.cumsum(steps)]) / speed

        def work() -> None:
            """Time samples of its place."""
            prim = self._stage.GetPrimAtPath(trap)
            here = self._place(prim)
            op = self._place_op(prim)
            at_first = self._values.value(prim, op.GetName(), absent=Gf.Vec3d(0.0))
            base, kind = np.array(at_first), type(at_first)
            first, rate = self._stage.GetStartTimeCode(), self._stage.GetTimeCodesPerSecond()
            op.GetAttr().Clear()
            for time, point in zip(times, points, strict=True):
                local = base + self._inward(prim, point - here)
                op.GetAttr().Set(kind(*local.tolist()), round(first + time * rate, DIGITS))
            if first + times[-1] * rate < self._stage.GetEndTimeCode():
                op.GetAttr().Set(kind(*local.tolist()), self._stage.GetEndTimeCode())  # there it stays

        self._edit(work)
        return float(times[-1])

    def undo(self) -> None:
        """Take the last edit back; nothing where there is none."""
        if self._undo:
            self._edits.ImportFromString(self._undo.pop())
            self.scene = self._read()
            self.saved = False

    def save(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the scene as a file: the whole file or none.

        Args:
            path: Where, `.usda`, `.usdc` or `.usd`; what the scene refers to stays where it is.
            replace: Whether a file that is there may be replaced.

        Raises:
            InputError: It is there and may not be replaced, cannot be written, or does not load back equal.
        """
        target = Path(path)
        if target.exists() and not replace:
            raise InputError(f"{target}: is there; must be a new file, or one that may be replaced")
        probe = target.with_name(f".{target.stem}.probe{target.suffix}")
        layer = self._flat(target.absolute().parent)
        try:
            export_layer(layer, probe)
            if Scene.load(probe) != self.scene:
                raise InputError(f"{target}: would not load back as it is shown; nothing was written")
            probe.replace(target)
        finally:
            probe.unlink(missing_ok=True)
        self.saved = True
        return target

    def free_path(self, name: str) -> str:
        """A path of that name below the root at which nothing is."""
        for n in itertools.count(1):
            path = f"{self.root}/{name}_{n}"
            if not self._stage.GetPrimAtPath(path):
                return path
        raise AssertionError("counting ends nowhere")

    def _beside(self, prim: str, others: set[str]) -> str:
        """A path like that of a prim, at which nothing is."""
        for n in itertools.count(1):
            path = f"{prim}_copy_{n}"
            if not self._stage.GetPrimAtPath(path) and path not in others:
                return path
        raise AssertionError("counting ends nowhere")

    def _copy(self, layer: Sdf.Layer, old: Sdf.Path, new: Sdf.Path) -> None:
        """A prim of a layer into the edits; what is above it is made where it is missing."""
        for parent in new.GetParentPath().GetPrefixes():
            if not self._stage.GetPrimAtPath(parent):
                self._stage.DefinePrim(parent, layer.GetPrimAtPath(parent).typeName)
        Sdf.CreatePrimInLayer(self._edits, new)
        Sdf.CopySpec(layer, old, self._edits, new)

    def _edit(self, work: Callable[[], None]) -> None:
        """Do it, read the scene; undo it where that fails."""
        before = self._edits.ExportToString()
        try:
            work()
            self.scene = self._read()
        except BaseException:
            self._edits.ImportFromString(before)
            raise
        self._undo.append(before)
        self.saved = False

    def _read(self) -> Scene:
        """The scene as it would be saved, from a file of its own: USD remembers files by their names."""
        file = Path(self._folder.name) / f"{self.file.stem}.{next(self._numbers)}.usda"
        export_layer(self._flat(None), file)
        try:
            found = Scene.load(file)
        except InputError as error:
            raise InputError(str(error).replace(str(file), str(self.file))) from None
        for old in file.parent.glob("*.usda"):
            if old != file:
                old.unlink()
        return dataclasses.replace(found, file=file)

    def _flat(self, folder: Path | None) -> Sdf.Layer:
        """The file's layers with the edits as one; its references as seen from a folder, or absolute."""

        def resolved(layer: Sdf.Layer, asset: str) -> str:
            """Where an asset is, wherever the file will lie."""
            if not asset or Sdf.Layer.IsAnonymousLayerIdentifier(asset):
                return asset
            found = layer.ComputeAbsolutePath(asset)
            if folder is None or not Path(found).is_absolute():
                return found
            try:
                near = os.path.relpath(found, folder)
            except ValueError:  # on another drive
                return found
            return near if near.startswith("..") else f"./{near}"

        return UsdUtils.FlattenLayerStack(self._stage, resolved)

    def _move(self, prim: Usd.Prim, way: np.ndarray) -> None:
        local = self._inward(prim, way)
        attribute = self._place_op(prim).GetAttr()
        for code, value in self._samples(attribute, Gf.Vec3d(0.0)):
            attribute.Set(type(value)(*np.round(np.array(value) + local, DIGITS).tolist()), code)

    def _move_instance(self, path: str, index: int, way: np.ndarray) -> None:
        instancer = UsdGeom.PointInstancer(self._stage.GetPrimAtPath(path))
        attribute = instancer.GetPositionsAttr()
        world = UsdGeom.XformCache().GetLocalToWorldTransform(instancer.GetPrim())
        local = np.array(world.GetInverse().TransformDir(Gf.Vec3d(*way.tolist())))
        for code, value in self._samples(attribute, Vt.Vec3fArray()):
            places = np.array(value)
            places[index] += local
            attribute.Set(type(value).FromNumpy(places), code)

    def _samples(self, attribute: Usd.Attribute, absent: object) -> list[tuple[Usd.TimeCode | float, Any]]:
        """Time codes and values of an attribute, all read before one is written, which would hide the others."""
        prim, name = attribute.GetPrim(), attribute.GetName()
        codes, found = self._values.samples(prim, name)
        if codes:
            return list(zip(codes, found, strict=True))
        default = Usd.TimeCode.Default()
        return [(default, self._values.value(prim, name, absent=absent, time=default))]

    def _place(self, prim: Usd.Prim) -> np.ndarray:
        """Where a prim is at the start [µm]."""
        cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
        return np.array(cache.GetLocalToWorldTransform(prim).ExtractTranslation())

    def _inward(self, prim: Usd.Prim, way: np.ndarray) -> np.ndarray:
        """A way in the world, as seen from a prim's parent."""
        parent = UsdGeom.XformCache(Usd.TimeCode.EarliestTime()).GetParentToWorldTransform(prim)
        return np.array(parent.GetInverse().TransformDir(Gf.Vec3d(*way.tolist())))

    def _place_op(self, prim: Usd.Prim) -> UsdGeom.XformOp:
        """The outermost transform op of a prim, which is its place; made where another comes first."""
        xformable = UsdGeom.Xformable(prim)
        ops, reset = xformable.GetOrderedXformOps(), xformable.GetResetXformStack()
        if ops and ops[0].GetOpType() == UsdGeom.XformOp.TypeTranslate and not ops[0].IsInverseOp():
            return ops[0]
        added = xformable.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble, SUFFIX)
        added.Set(Gf.Vec3d())
        xformable.SetXformOpOrder([added, *ops], reset)
        return added
