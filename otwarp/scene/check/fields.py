"""Fields of the description against the vocabulary's rows: the types and ranges that files are held to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np

from otwarp.scene.vocabulary import Attribute, Schema
from otwarp.scene.vocabulary.attribute import INSTANCE
from otwarp.scene.vocabulary.values import bad, check, from_field


def check_fields(
    where: str,
    prim: str,
    schema: Schema,
    item: Any = None,
    *,
    instance: str = "",
    si: bool = False,
    skip: Sequence[str] = (),
    **parts: Any,
) -> None:
    """Refuse a value that a file could not say; relationships are left to `scene`.

    Args:
        where: What errors name first: a file, or `Scene`.
        prim: Path of the prim.
        schema: Whose rows.
        item: Dataclass or mapping with the fields of the schema, in internal units.
        instance: Instance name of a multiple-apply schema.
        si: Take values as they would be authored.
        skip: Fields that are judged elsewhere.
        **parts: Parts of fields, `medium` in `medium.viscosity`, that are not attributes of `item`.

    Raises:
        InputError: Naming the attribute, its value in USD's units, and what is allowed.
    """
    for row in schema.attributes:
        head, _, last = row.field.rpartition(".")
        owner = parts[head] if head in parts else getattr(item, head) if head else item
        fields = owner if isinstance(owner, Mapping) else vars(owner)
        if row.usd_type == "rel" or row.field in skip or (last not in fields and (row.optional or si)):
            continue
        value, name = fields[last], row.name.replace(INSTANCE, instance)
        if not has_type(row, value):
            raise bad(where, prim, name, f"{value!r} (a {type(value).__name__})", row.allowed_text())
        check(where, prim, name, row, value if si else from_field(row, value))


def has_type(row: Attribute, value: Any) -> bool:
    """Whether a field holds a value of the type that its row says."""
    if value is None:
        return row.none is not None or row.usd_type == "double[]"
    if row.usd_type == "bool":
        return isinstance(value, bool | np.bool_)
    if row.usd_type in ("token", "asset"):
        return isinstance(value, str)
    if row.usd_type == "int":
        return isinstance(value, Integral) and not isinstance(value, bool)
    if row.usd_type == "double":
        return is_number(value)
    several = isinstance(value, Sequence | np.ndarray) and all(is_number(v) for v in value)
    return several and len(value) == (3 if row.vector else 36)


def is_number(value: Any) -> bool:
    """Whether it is one real number, and not a truth value."""
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)
