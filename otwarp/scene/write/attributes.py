"""Writes `ot:` attributes by the vocabulary table."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Any

from pxr import Gf, Sdf, Usd, Vt

from otwarp.scene.vocabulary import Attribute, Schema
from otwarp.scene.vocabulary.attribute import INSTANCE
from otwarp.scene.vocabulary.values import bad, check, from_field

_USD = {
    "asset": Sdf.AssetPath,
    "double[]": Vt.DoubleArray,
    "double3": lambda value: Gf.Vec3d(*value),
    "float3": lambda value: Gf.Vec3f(*value),
}


def author_values(
    prim: Usd.Prim, schema: Schema, item: Any = None, *, instance: str | None = None, si: bool = False, **parts: Any
) -> None:
    """Apply a schema to a prim and author every one of its attributes, so that no value is left to a default.

    Args:
        prim: Where.
        schema: Which one.
        item: Dataclass or mapping with the fields of the schema, in internal units.
        instance: Instance name of a multiple-apply schema.
        si: Take values as they are to be authored.
        **parts: Parts of fields, `material` in `material.adhesion`, that are not attributes of `item`.

    A relationship takes a sequence of paths and is authored only when there is one; an optional attribute is authored
    only when `item` has it.

    Raises:
        InputError: A value that USD would round to a whole number, or could not hold.
    """
    prim.AddAppliedSchema(f"{schema.name}:{instance}" if instance else schema.name)
    for attribute in schema.attributes:
        name = attribute.name.replace(INSTANCE, instance or "")
        head, _, last = attribute.field.rpartition(".")
        owner = parts[head] if head in parts else _field(item, head) if head else item
        if attribute.optional and last not in (owner if isinstance(owner, Mapping) else vars(owner)):
            continue
        value = _field(owner, last)
        if attribute.usd_type == "rel":
            if value:
                prim.CreateRelationship(name, False).SetTargets([Sdf.Path(str(path)) for path in value])
            continue
        value = value if si else from_field(attribute, value)
        if attribute.usd_type == "int":
            value = _whole(prim, name, attribute, value)
        value = _USD.get(attribute.usd_type, lambda value: value)(value)
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(attribute.usd_type), False).Set(value)


def _field(owner: Any, name: str) -> Any:
    return owner[name] if isinstance(owner, Mapping) else getattr(owner, name)


def _whole(prim: Usd.Prim, name: str, attribute: Attribute, value: Any) -> int:
    # USD cuts 1.5 down to 1 without a word, and fails on what is beyond 32 bits.
    try:
        whole = operator.index(value)
    except TypeError:
        raise bad("SceneBuilder", prim.GetPath(), name, value, attribute.allowed_text()) from None
    check("SceneBuilder", prim.GetPath(), name, attribute, whole)
    return whole
