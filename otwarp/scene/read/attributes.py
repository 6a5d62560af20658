"""Reads `ot:` attributes by the vocabulary table, checking names, types and ranges.

Works on raw metadata, so that a program whose schema registry was built before otwarp came reads the same values.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from typing import Any

from pxr import Usd

from otwarp.scene.read.typed import REQUIRED, SAMPLED, SPLINE, Values, authored_text, check_types, course_text
from otwarp.scene.vocabulary import SCHEMAS, Attribute, Schema
from otwarp.scene.vocabulary.attribute import INSTANCE
from otwarp.scene.vocabulary.values import bad, check, to_field


def by_name(schemas: Sequence[Schema]) -> dict[str, tuple[Schema, str | None, Attribute]]:
    """Full USD name of every attribute → its schema, the instance if any, and the attribute."""
    table = {}
    for schema in schemas:
        for instance in schema.instances or (None,):
            for attribute in schema.attributes:
                table[attribute.name.replace(INSTANCE, instance or "")] = (schema, instance, attribute)
    return table


NAMES = by_name(SCHEMAS)
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
            text = authored_text(prop.GetPropertyStack(Usd.TimeCode.Default())[0])
            raise bad(file, prim.GetPath(), name, text, f"on a prim with {needed} applied")
        _check_type(file, prop, attribute)


def _suggest(name: str, known: Any) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    return f"a name of the vocabulary; did you mean {near[0]}?"


def _check_type(file: str, prop: Usd.Property, attribute: Attribute) -> None:
    check_types(file, prop, (attribute.usd_type,), attribute.range_text())
    course = course_text(prop) if isinstance(prop, Usd.Attribute) else ""
    if course and not attribute.sampled:
        raise bad(file, prop.GetPrim().GetPath(), prop.GetName(), course, "constant in time")
    if course == SPLINE:
        raise bad(file, prop.GetPrim().GetPath(), prop.GetName(), course, SAMPLED)


def read_values(
    file: str, prim: Usd.Prim, schema: Schema, *, instance: str | None = None, si: bool = False
) -> dict[str, Any]:
    """Values of the attributes of one schema on one prim, by field; defaults where nothing is authored.

    Args:
        file: Named in errors.
        prim: Where the schema is applied.
        schema: Which one.
        instance: Instance name of a multiple-apply schema.
        si: Leave values as authored instead of converting them to internal units.

    Returns:
        Field → value; a relationship gives the tuple of its target paths, and an optional attribute that is not
        authored is left out. `part` picks what belongs to one dataclass.

    Raises:
        InputError: A value out of range.
    """
    read, values = Values(file, Usd.TimeCode.EarliestTime()), {}
    for attribute in schema.attributes:
        name = attribute.name.replace(INSTANCE, instance or "")
        if attribute.usd_type == "rel":
            relationship = prim.GetRelationship(name)
            values[attribute.field] = tuple(map(str, relationship.GetTargets())) if relationship else ()
            continue
        value = _authored(read, prim, name, attribute)
        if value is None and attribute.optional:
            continue
        value = attribute.default if value is None else value
        check(file, prim.GetPath(), name, attribute, value)
        values[attribute.field] = value if si else to_field(attribute, value)
    return values


def _authored(read: Values, prim: Usd.Prim, name: str, attribute: Attribute) -> Any:
    """The authored value, None where there is none; a blocked one only where leaving it out has a meaning."""
    usd = prim.GetAttribute(name)
    if not usd or not (usd.HasAuthoredValue() or usd.GetResolveInfo().ValueIsBlocked()):
        return None
    absent = None if attribute.optional else REQUIRED
    allowed = f"{attribute.range_text()}, or not authored"
    return read.value(prim, name, types=(attribute.usd_type,), absent=absent, allowed=allowed)


def part(values: Mapping[str, Any], name: str = "") -> dict[str, Any]:
    """Of `read_values`, what fills one part of the description: `material` of a body; without a name, itself."""
    lead = f"{name}." if name else ""
    return {
        field.removeprefix(lead): value
        for field, value in values.items()
        if field.startswith(lead) and "." not in field.removeprefix(lead)
    }
