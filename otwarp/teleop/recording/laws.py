"""Force laws as JSON and back, bit for bit: a take holds what its hands felt, tables included."""

from __future__ import annotations

import base64
import dataclasses
import sys
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core.types import TrapLaw
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw
from otwarp.haptics.force.table import ForceGrid, TableLaw


def laws_to_dict(laws: Mapping[int, Sequence[Law]]) -> dict[str, Any]:
    """Laws of traps, each law once: `laws`, a list, and `traps`, for each trap the indices of its laws.

    Raises:
        InputError: A law of another kind.
    """
    found: list[Law] = []
    traps: dict[str, list[int]] = {}
    for trap, choices in laws.items():
        row = traps[str(trap)] = []
        for law in choices:
            same = next((n for n, other in enumerate(found) if other is law or other == law), None)
            if same is None:
                same = len(found)
                found.append(law)
            row.append(same)
    return {"laws": [_law(law) for law in found], "traps": traps}


def laws_from_dict(data: Any) -> dict[int, tuple[Law, ...]]:
    """The laws that `laws_to_dict` wrote.

    Raises:
        InputError: They are none.
    """
    try:
        laws = [_read(item) for item in data["laws"]]
        return {int(trap): tuple(laws[n] for n in row) for trap, row in data["traps"].items()}
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InputError(f"force laws: cannot be read ({error!r}); allowed: as a take has them") from None


def _law(law: Law) -> dict[str, Any]:
    if isinstance(law, IsotropicLaw):
        curves = {"curve": dataclasses.asdict(law.curve)}
        return {"kind": "isotropic", **curves, "axis": law.axis, "equilibrium": law.equilibrium}
    if isinstance(law, SplitLaw):
        curves = {"radial": dataclasses.asdict(law.radial), "axial": dataclasses.asdict(law.axial)}
        return {"kind": "split", **curves, "axis": law.axis, "equilibrium": law.equilibrium}
    if isinstance(law, TableLaw):
        grids = [
            {"spacing": g.spacing, "radius": g.radius, "end": g.end, "columns": g.columns, "node": _encoded(g.node)}
            for g in law.grids
        ]
        same = ("layers", "cubic", "scale", "side", "axis")
        return {"kind": "table", "grids": grids, **{name: getattr(law, name) for name in same}}
    raise InputError(f"force law is {type(law).__name__}; allowed in a take: isotropic, split or tabulated")


def _read(data: Mapping[str, Any]) -> Law:
    values = {key: value for key, value in data.items() if key != "kind"}
    for name in ("axis", "side"):
        if name in values:
            x, y, z = values[name]
            values[name] = (x, y, z)
    for name in ("curve", "radial", "axial"):
        if name in values:
            values[name] = TrapLaw(**values[name])
    if data["kind"] == "isotropic":
        return IsotropicLaw(**values)
    if data["kind"] == "split":
        return SplitLaw(**values)
    if data["kind"] == "table":
        values["grids"] = tuple(ForceGrid(**grid | {"node": _decoded(grid["node"])}) for grid in values["grids"])
        return TableLaw(**values)
    raise ValueError(data["kind"])


def _encoded(node: array[float]) -> str:
    """float32 numbers, little-endian, as base64."""
    return base64.b64encode(_little(node).tobytes()).decode()


def _decoded(text: str) -> array[float]:
    node = array("f")
    node.frombytes(base64.b64decode(text, validate=True))
    return _little(node)


def _little(node: array[float]) -> array[float]:
    if sys.byteorder == "big":
        node = array("f", node)
        node.byteswap()
    return node
