"""Attributes of the built-in forces that act on a body: one row serves robots (`ot:body:`) and cells (`ot:cell:`)."""

from __future__ import annotations

from dataclasses import replace

from otwarp.scene.vocabulary.attribute import Attribute

FORCES: tuple[Attribute, ...] = (
    Attribute(
        "ot:body:externalForce",
        (0.0, 0.0, 0.0),
        "force",
        "[0, 1e-06]",
        optional=True,
        field="forces.external_force",
        per_world=("external_force",),
        doc="Constant force at the centre of diffusion, in world coordinates.",
    ),
)
"""Rows named `ot:body:…`, optional, with a field `forces.…`; see `otwarp.scene.vocabulary`."""


def for_cells(rows: tuple[Attribute, ...]) -> tuple[Attribute, ...]:
    """The same rows with the names that cells give them."""
    return tuple(replace(row, name=row.name.replace("ot:body:", "ot:cell:")) for row in rows)
