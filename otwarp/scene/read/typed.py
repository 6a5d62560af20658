"""The one way in for values of USD attributes: each is there, is of the type that its schema says, or is refused.

USD hands out whatever a file holds: a text or an array where the schema says a number, the schema's fallback where a
stronger layer blocks the value (`radius = None`), and an identity where a transform op makes no sense. No other file
asks an attribute for its value.
"""

from __future__ import annotations

from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import cache
from io import StringIO
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.read.diagnostics import USD_ERRORS, usd_reason
from otwarp.scene.vocabulary.values import bad

REQUIRED: Any = object()
"""In place of what stands for an attribute that is not there or blocked: there is nothing, it is refused."""

LARGEST = 1e30
"""Largest number of geometry, in stage units: products along a path of prims must not overflow."""

SPLINE = "(a spline)"
"""What `course_text` says of an attribute that follows one; it has no time samples, and would count as constant."""

SAMPLED = "a value, or time samples, such as those of the spline at every frame"
"""What is allowed where a spline is not."""

_QUATERNIONS = (Gf.Quatd, Gf.Quatf, Gf.Quath)
_RESET, _INVERSE = "!resetXformStack!", "!invert!"
_OPS = {
    str(UsdGeom.XformOp.GetOpTypeToken(t))
    for t in vars(UsdGeom.XformOp).values()
    if isinstance(t, UsdGeom.XformOp.Type)
}


@dataclass(frozen=True)
class Values:
    """Reads the values of attributes.

    Attributes:
        file: What errors name.
        time: Time code of values that may change in time.
    """

    file: str
    time: Usd.TimeCode

    def bad(self, prim: Usd.Prim, name: str, value: object, allowed: str) -> InputError:
        """The one-line error about an attribute."""
        return bad(self.file, prim.GetPath(), name, value, allowed)

    def value(
        self,
        prim: Usd.Prim,
        name: str,
        *,
        types: tuple[str, ...] = (),
        absent: Any = REQUIRED,
        time: Usd.TimeCode | float | None = None,
        constant: bool = False,
        allowed: str = "",
    ) -> Any:
        """The value of an attribute, as USD gives it to Python.

        Args:
            prim: Whose.
            name: Its full name.
            types: Types that it may have, by their USD names; by default the one that its schema says.
            absent: What stands for a value that is nowhere authored, has no fallback or is blocked; by default that is
                refused.
            time: Time code, by default that of these values.
            constant: Refuse time samples and splines.
            allowed: What else to say of the values that it may have.

        Raises:
            InputError: A wrong type, no value, a blocked one, or one that cannot be read; a token that the schema does
                not know.
        """
        attribute, types = self._declared(prim, name, types, allowed)
        if constant and attribute and (course := course_text(attribute)):
            raise self.bad(prim, name, course, "constant in time")
        found = None
        if attribute and not attribute.GetResolveInfo().ValueIsBlocked():
            found = self._get(attribute, types, self.time if time is None else time, allowed)
        if found is not None or absent is not REQUIRED:
            return absent if found is None else found
        raise self.bad(prim, name, "None (blocked)" if attribute else "(absent)", type_text(types, allowed))

    def samples(self, prim: Usd.Prim, name: str, *, types: tuple[str, ...] = ()) -> tuple[list[float], list[Any]]:
        """Time codes of an attribute's samples and its values there; see `value`."""
        attribute, types = self._declared(prim, name, types)
        codes = list(attribute.GetTimeSamples()) if attribute else []
        found = [self._get(attribute, types, code) for code in codes]
        if any(value is None for value in found):
            raise self.bad(prim, name, "a time sample None (blocked)", type_text(types))
        return codes, found

    def _declared(
        self, prim: Usd.Prim, name: str, types: tuple[str, ...], allowed: str = ""
    ) -> tuple[Usd.Attribute, tuple[str, ...]]:
        """An attribute, valid or not, and the types that it may have, once its layers agree with them."""
        attribute = prim.GetAttribute(name)
        types = types or ((str(attribute.GetTypeName()),) if attribute else ())
        check_types(self.file, prim.GetProperty(name), types, allowed)
        return attribute, types

    def _get(
        self, attribute: Usd.Attribute, types: tuple[str, ...], time: Usd.TimeCode | float, allowed: str = ""
    ) -> Any:
        """What an attribute holds at a time, None for nothing; of one of the types, and a token that is known."""
        prim, name, allowed = attribute.GetPrim(), attribute.GetName(), type_text(types, allowed)
        try:
            with redirect_stderr(StringIO()):  # USD prints that Python has no such type, besides raising it
                found = attribute.Get(time)
        except USD_ERRORS as error:
            raise self.bad(prim, name, f"({usd_reason(error)})", allowed) from None
        if found is not None and type(found) not in _python_types(types):
            raise self.bad(prim, name, f"{found} (a {type(found).__name__})", allowed)
        tokens = attribute.GetMetadata("allowedTokens") if isinstance(found, str) else None
        if tokens and found not in tokens:
            raise self.bad(prim, name, found or "(empty)", f"one of {', '.join(tokens)}")
        return found

    def number(self, prim: Usd.Prim, name: str, **how: Any) -> float:
        """The value of an attribute that is one number, finite; see `value`."""
        return float(self._finite(prim, name, self.value(prim, name, **how)))

    def array(self, prim: Usd.Prim, name: str, *shape: int, kind: type = float, **how: Any) -> np.ndarray:
        """The value of an attribute that is an array, (n, *shape), n = 0 where there is none; finite; see `value`."""
        found = np.array(self.value(prim, name, absent=(), **how), dtype=kind).reshape(-1, *shape)
        if kind is float:
            self._finite(prim, name, found)
        return found

    def _finite(self, prim: Usd.Prim, name: str, found: Any) -> np.ndarray:
        """Numbers that geometry can be made of.

        Raises:
            InputError: One that is not, with its place in an array.
        """
        array = np.array(found, dtype=float) if not isinstance(found, _QUATERNIONS) else _components(found)
        outside = ~(np.abs(array) <= LARGEST)
        if np.any(outside):
            place = "".join(f"[{i}]" for i in np.argwhere(outside)[0])
            raise self.bad(prim, name + place, float(array[outside][0]), f"finite, within ±{LARGEST:g}")
        return array

    def check(self, prim: Usd.Prim) -> None:
        """Refuse attributes of a prim whose types are not their schemas', and transform ops that make no transform.

        Some values USD combines natively, and takes a wrong one for none: transforms, purposes, visibility.

        Raises:
            InputError: One line.
        """
        known = set(prim.GetPrimDefinition().GetPropertyNames())
        for prop in prim.GetAuthoredProperties(lambda name: name in known):
            is_attribute = prim.GetPrimDefinition().GetSpecType(prop.GetName()) == Sdf.SpecTypeAttribute
            check_types(self.file, prop, (str(prop.GetTypeName()),) if is_attribute else ("rel",))
        for name in ("visibility", "purpose") if prim.IsA(UsdGeom.Imageable) else ():
            self.value(prim, name, absent="")
        if prim.IsA(UsdGeom.Xformable):
            for op in self.value(prim, "xformOpOrder", absent=()):
                if op != _RESET:
                    self._check_op(prim, op.removeprefix(_INVERSE))

    def _check_op(self, prim: Usd.Prim, name: str) -> None:
        space, kind = (*name.split(":"), "")[:2]
        if space != "xformOp" or kind not in _OPS:
            raise self.bad(prim, "xformOpOrder", name, "names of transform ops, such as xformOp:translate")
        types = op_types(kind)
        found = self.samples(prim, name, types=types)[1] or [self.value(prim, name, types=types)]
        for value in found:
            numbers = self._finite(prim, name, value)
            if kind == "orient" and not numbers.any():
                raise self.bad(prim, name, value, "a quaternion that is not zero")


def course_text(attribute: Usd.Attribute) -> str:
    """How an attribute changes in time, as a value to be refused; empty for one that is constant."""
    return SPLINE if attribute.HasSpline() else "(time samples)" if attribute.GetNumTimeSamples() > 0 else ""


def _components(turn: Any) -> np.ndarray:
    return np.array([*turn.GetImaginary(), turn.GetReal()], dtype=float)


@cache
def _python_types(types: tuple[str, ...]) -> set[type]:
    return {type(Sdf.ValueTypeNames.Find(kind).defaultValue) for kind in types}


def op_types(kind: str) -> tuple[str, ...]:
    """Types that a transform op may have: those of its kind, `translate`, `rotateXYZ`, `scaleX`, …"""
    if kind == "transform":
        return ("matrix4d",)
    if kind == "orient":
        return ("quatd", "quatf", "quath")
    plain = kind.rstrip("XYZ")
    one = len(kind) - len(plain) == 1
    return ("double", "float", "half") if one else ("double3", "float3", "half3")


def type_text(types: tuple[str, ...], allowed: str = "") -> str:
    """What an attribute of these types may be."""
    return ", ".join(filter(None, [f"of type {' or '.join(types)}" if types else "an attribute", allowed]))


def authored_text(spec: Sdf.PropertySpec) -> str:
    """What a layer says of a property, as text; its type there is its own, so that it can always be read."""
    if isinstance(spec, Sdf.AttributeSpec):
        return str(spec.default)
    return ", ".join(map(str, spec.targetPathList.GetAddedOrExplicitItems())) or "(no target)"


def check_types(file: str, prop: Usd.Property, types: tuple[str, ...], allowed: str = "") -> None:
    """Refuse a property that a layer declares with another type; roles, `point3f` for `float3`, do not matter.

    Raises:
        InputError: Naming the value and both types.
    """
    known = [Sdf.ValueTypeNames.Find(kind).type for kind in types if kind != "rel"]
    for spec in prop.GetPropertyStack(Usd.TimeCode.Default()) if prop else ():
        is_attribute = isinstance(spec, Sdf.AttributeSpec)
        if (spec.typeName.type not in known) if is_attribute else ("rel" not in types):
            found = str(spec.typeName) if is_attribute else "rel"
            shown = f"{authored_text(spec)} (type {found})"
            raise bad(file, prop.GetPrim().GetPath(), prop.GetName(), shown, type_text(types, allowed))
