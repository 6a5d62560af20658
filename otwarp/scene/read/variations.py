"""Scenes that differ from a file in some attributes: a stage, opened once, and read anew for every set of values."""

from __future__ import annotations

import difflib
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.read.diagnostics import USD_ERRORS, quiet_usd
from otwarp.scene.read.load import read_stage
from otwarp.scene.read.source import open_stage
from otwarp.scene.scene import Scene
from otwarp.scene.vocabulary import SCHEMAS
from otwarp.scene.vocabulary.attribute import INSTANCE, Attribute

_LENGTHS = ("radius", "height", "size", "extent")
"""Attributes of USD's shapes that are lengths in stage units."""


class Variations:
    """A stage that stays as it is in its file, and whose attributes are given other values above it.

    Args:
        file: A scene.

    Raises:
        InputError: It is none.
    """

    def __init__(self, file: Path):
        self.file = file
        self.stage = open_stage(file)
        self.micrometres = UsdGeom.GetStageMetersPerUnit(self.stage) / 1e-6
        self._reading = threading.Lock()

    def __reduce__(self) -> tuple[type[Variations], tuple[Path]]:
        """Another process opens the file anew."""
        return Variations, (self.file,)

    def unit(self, path: str) -> str:
        """The unit of an attribute's values for `scene`: that of the vocabulary, µm of a place or shape, degrees of
        a turn, or none.

        Raises:
            InputError: There is no such attribute.
        """
        name = self._attribute(path).GetName()
        row = vocabulary_row(name)
        if row is not None:
            return "" if row.unit == "1" else row.unit
        if name.startswith("xformOp:rotate"):
            return "deg"
        return "µm" if name in _LENGTHS or name.startswith("xformOp:translate") else ""

    def scene(self, values: Mapping[str, Any]) -> Scene:
        """The scene with other values of some attributes, in the units of `unit`; threads have the stage in turn.

        Args:
            values: Path, such as `/World/bead/sphere.radius`, → number, word or three numbers.

        Raises:
            InputError: A value that the attribute cannot have, or a scene that cannot be accepted.
        """
        with self._reading:  # devices of a study ask side by side, and there is one layer for all
            fields = read_stage(self.varied(values), file=str(self.file))
            self.stage.GetSessionLayer().Clear()
        return Scene(**fields, file=self.file, overrides=dict(values))

    def varied(self, values: Mapping[str, Any]) -> Usd.Stage:
        """The stage with other values of some attributes in its session layer, until it is asked for others.

        Args:
            values: As of `scene`.

        Raises:
            InputError: A value that the attribute cannot have.
        """
        over = self.stage.GetSessionLayer()
        over.Clear()
        with Usd.EditContext(self.stage, over):
            for path, value in values.items():
                self._set(path, value)
        return self.stage

    def _set(self, path: str, value: Any) -> None:
        attribute = self._attribute(path)
        name = attribute.GetName()
        value = value.item() if isinstance(value, np.generic) else value
        with quiet_usd():
            try:
                if self.unit(path) == "µm" and vocabulary_row(name) is None:
                    value = np.asarray(value, dtype=float) / self.micrometres
                    value = value.item() if value.ndim == 0 else value
                if np.ndim(value) == 1:
                    vector = Gf.Vec3f if attribute.GetTypeName().cppTypeName.endswith("f") else Gf.Vec3d
                    value = vector(*map(float, value))
                if attribute.GetTypeName() == Sdf.ValueTypeNames.Int and float(value).is_integer():
                    value = int(value)
                taken = attribute.Clear() and attribute.Set(value)
            except (TypeError, ValueError, *USD_ERRORS):
                taken = False
        if not taken:
            raise InputError(f"{self.file}: {path} = {value}: must be a value of type {attribute.GetTypeName()}")

    def _attribute(self, path: str) -> Usd.Attribute:
        prim_path, _, name = path.partition(".")
        prim = self.stage.GetPrimAtPath(prim_path) if Sdf.Path.IsValidPathString(prim_path) else None
        if not prim:
            known = [str(p.GetPath()) for p in self.stage.Traverse()]
            raise InputError(f"{self.file}: {path}: there is no prim {prim_path}{nearest(prim_path, known)}")
        attribute = prim.GetAttribute(name) if name else None
        if not attribute:
            known = [a.GetName() for a in prim.GetAttributes()]
            raise InputError(
                f"{self.file}: {path}: {prim_path} has no attribute {name or '(none)'}{nearest(name, known)}"
            )
        return attribute


def nearest(name: str, known: list[str]) -> str:
    """`; did you mean …?` where a known name is like this one, else what there is."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(sorted(known)[:12])}" if known else ""


def vocabulary_row(name: str) -> Attribute | None:
    """What the vocabulary says of an attribute with that USD name, or None of one that is none of otwarp's."""
    for schema in SCHEMAS:
        for row in schema.attributes:
            if name in {row.name.replace(INSTANCE, instance) for instance in (schema.instances or ("",))}:
                return row
    return None
