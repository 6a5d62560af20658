"""Reads and writes `ot:` attributes by the vocabulary table, checking names, types and ranges.

Works on raw metadata, so that a program whose schema registry was built before otwarp came reads the same values.
"""

from __future__ import annotations

import difflib
import math
import operator
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from pxr import Sdf, Usd

from otwarp.errors import InputError
from otwarp.scene.vocabulary import SCHEMAS, Attribute, Schema
from otwarp.units import FROM_SI

INSTANCE = "__INSTANCE_NAME__"
_EXPONENT = {dimension: round(math.log10(factor)) for dimension, factor in FROM_SI.items()}


def _shift(value: float, exponent: int) -> float:
    """`value`·10^exponent rounded once from its decimal form: 1.064e-06 m is exactly 1.064 µm."""
    if exponent == 0 or not math.isfinite(value):
        return value
    return float(Decimal(repr(value)).scaleb(exponent))


def internal(value: float, dimension: str) -> float:
    """`value`, given in the SI unit of `dimension`, in internal units (correctly rounded)."""
    return _shift(float(value), _EXPONENT[dimension])


def authored(value: float, dimension: str) -> float:
    """`value`, given in the internal unit of `dimension`, in SI units (correctly rounded)."""
    return _shift(float(value), -_EXPONENT[dimension])


def mobility_shift(values: tuple[float, ...], sign: int) -> tuple[float, ...]:
    """36 geometric mobilities between 1/m, 1/m², 1/m³ and 1/µm, 1/µm², 1/µm³: sign −1 from SI, +1 to SI."""
    exponents = [6 * sign * (1 + (i >= 3) + (j >= 3)) for i in range(6) for j in range(6)]
    return tuple(_shift(float(v), e) for v, e in zip(values, exponents, strict=True))


def bad(file: str, prim: object, name: str, value: object, allowed: str) -> InputError:
    """The one-line error that names file, prim, attribute, value and what is allowed."""
    text = f"{file}: {prim}: {name} = {value}: must be {allowed}"
    return InputError(" ".join(text.split()))


def _by_name() -> dict[str, tuple[Schema, str | None, Attribute]]:
    table = {}
    for schema in SCHEMAS:
        for instance in schema.instances or (None,):
            for attribute in schema.attributes:
                table[attribute.name.replace(INSTANCE, instance or "")] = (schema, instance, attribute)
    return table


NAMES = _by_name()
APPLIED = tuple(f"{s.name}:{i}" if i else s.name for s in SCHEMAS for i in (s.instances or (None,)))


def applied_schemas(prim: Usd.Prim) -> list[str]:
    """Names of the applied schemas as composed, known to this USD's schema registry or not."""
    return list(prim.GetPrimTypeInfo().GetAppliedAPISchemas())


def check_prim(file: str, prim: Usd.Prim, applied: list[str]) -> None:
    """Refuse unknown or misspelt `ot:` names, schemas that are not applied, and wrong types.

    Raises:
        InputError: One line, with the nearest known name.
    """
    for name in applied:
        if name.startswith("Ot") and name not in APPLIED:
            raise bad(file, prim.GetPath(), "apiSchemas", name, _suggest(name, APPLIED))
    for prop in prim.GetAuthoredProperties(lambda name: name[:3].lower() == "ot:"):  # OT:trap:power is a slip too
        name = prop.GetName()
        if name not in NAMES:
            raise bad(file, prim.GetPath(), name, "(unknown attribute)", _suggest(name, NAMES))
        schema, instance, attribute = NAMES[name]
        needed = f"{schema.name}:{instance}" if instance else schema.name
        if needed not in applied:
            raise bad(file, prim.GetPath(), name, _text(prop), f"on a prim with {needed} applied")
        _check_type(file, prop, attribute)


def _suggest(name: str, known: Any) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    return f"a name of the vocabulary; did you mean {near[0]}?"


def _text(prop: Usd.Property) -> str:
    if isinstance(prop, Usd.Relationship):
        return ", ".join(str(path) for path in prop.GetTargets()) or "(no target)"
    return str(prop.Get())


def _check_type(file: str, prop: Usd.Property, attribute: Attribute) -> None:
    for spec in prop.GetPropertyStack(Usd.TimeCode.Default()):
        found = str(spec.typeName) if isinstance(spec, Sdf.AttributeSpec) else "rel"
        if found != attribute.usd_type:
            allowed = f"of type {attribute.usd_type}, {attribute.range_text()}"
            shown = f"{getattr(spec, 'default', '(targets)')} (type {found})"  # the spec's: Get() fails on a mismatch
            raise bad(file, prop.GetPrim().GetPath(), prop.GetName(), shown, allowed)
    if isinstance(prop, Usd.Attribute) and not attribute.sampled and prop.GetNumTimeSamples() > 0:
        raise bad(file, prop.GetPrim().GetPath(), prop.GetName(), "(time samples)", "constant in time")


def read_values(
    file: str, prim: Usd.Prim, schema: Schema, *, instance: str | None = None, si: bool = False
) -> dict[str, Any]:
    """Values of all attributes of one schema on one prim, by field name; defaults where nothing is authored.

    Args:
        file: Named in errors.
        prim: Where the schema is applied.
        schema: Which one.
        instance: Instance name of a multiple-apply schema.
        si: Leave values as authored instead of converting them to internal units.

    Returns:
        Field (or, for an attribute without one, the last part of its name) → value; a relationship gives the list of
        its target paths.

    Raises:
        InputError: A value out of range.
    """
    values = {}
    for attribute in schema.attributes:
        name = attribute.name.replace(INSTANCE, instance or "")
        key = attribute.field or name.rsplit(":", 1)[-1]
        if attribute.usd_type == "rel":
            relationship = prim.GetRelationship(name)
            values[key] = [str(path) for path in relationship.GetTargets()] if relationship else []
            continue
        usd = prim.GetAttribute(name)
        value = usd.Get(Usd.TimeCode.EarliestTime()) if usd and usd.HasAuthoredValue() else None
        value = attribute.default if value is None else value
        check_value(file, prim.GetPath(), name, attribute, value)
        convert = attribute.usd_type == "double" and not si
        values[key] = internal(value, attribute.dimension) if convert else value
    return values


def check_value(file: str, path: object, name: str, attribute: Attribute, value: Any) -> None:
    """Refuse a value outside the attribute's range.

    Raises:
        InputError: One line.
    """
    if attribute.usd_type == "double[]":
        good = len(value) in (0, 36) and all(math.isfinite(v) for v in value)
    elif attribute.number:
        good = attribute.low <= value <= attribute.high  # False for NaN
        good = good and not (attribute.low_open and value == attribute.low)
        good = good and not (attribute.high_open and value == attribute.high)
        good = good and (math.isfinite(value) or (attribute.infinite and value > 0.0))
        good = good or (attribute.zero and value == 0.0)
    else:
        good = not attribute.allowed or value in attribute.allowed
    if not good:
        raise bad(file, path, name, value, _allowed(attribute))


def _allowed(attribute: Attribute) -> str:
    from otwarp.scene.schema.generate import unit_text

    if not attribute.number:
        return attribute.range_text()
    lead = "" if attribute.zero else "a whole number in " if attribute.usd_type == "int" else "in "
    unit = unit_text(attribute)
    return f"{lead}{attribute.range_text()}{'' if unit == '1' else f' {unit}'}"


def author_values(
    prim: Usd.Prim, schema: Schema, values: Mapping[str, Any], *, instance: str | None = None, si: bool = False
) -> None:
    """Apply a schema to a prim and author every one of its attributes, so that no value is left to a default.

    `values` maps fields to internal units (to USD units with `si`); a relationship takes a list of paths and is
    authored only when there is one.

    Raises:
        InputError: A value that USD would round to a whole number, or could not hold.
    """
    prim.AddAppliedSchema(f"{schema.name}:{instance}" if instance else schema.name)
    for attribute in schema.attributes:
        name = attribute.name.replace(INSTANCE, instance or "")
        value = values[attribute.field or name.rsplit(":", 1)[-1]]
        if attribute.usd_type == "rel":
            if value:
                prim.CreateRelationship(name, False).SetTargets([Sdf.Path(str(path)) for path in value])
            continue
        if attribute.usd_type == "double" and not si:
            value = authored(value, attribute.dimension)
        if attribute.usd_type == "int":
            value = _whole(prim, name, attribute, value)
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(attribute.usd_type), False).Set(value)


def _whole(prim: Usd.Prim, name: str, attribute: Attribute, value: Any) -> int:
    # USD cuts 1.5 down to 1 without a word, and fails on what is beyond 32 bits.
    try:
        whole = operator.index(value)
    except TypeError:
        raise bad("SceneBuilder", prim.GetPath(), name, value, _allowed(attribute)) from None
    check_value("SceneBuilder", prim.GetPath(), name, attribute, whole)
    return whole
