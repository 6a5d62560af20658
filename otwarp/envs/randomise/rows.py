"""What worlds that start anew take from the rows of a table of variants."""

from __future__ import annotations

from typing import Any

import warp as wp

from otwarp.device import empty
from otwarp.envs.kernels.rows import RowData
from otwarp.laws.trap_law import FIELDS
from otwarp.simulation.model import Model

PER_WORLD = (
    "thermal_energy", "viscosity", "speed", "shear_rate", "speed_limit", "held_range",
    *(f"{axial}{name}" for axial in ("", "axial_") for name in FIELDS),
)  # fmt: skip
"""Arrays of the model that may have a row for every world."""


def row_data(table: Model, worlds: Model, variants: int) -> tuple[wp.array, list[Any]]:
    """What of a model differs between variants, for `copy_rows`.

    Args:
        table: The model with a world for each of V variants.
        worlds: That of the worlds, each with a row of its own where parameters differ.
        variants: V.

    Returns:
        (P) `RowData` on the memory of both models, (0) of one variant, and what it refers to by address.
    """
    pairs: list[tuple[wp.array, wp.array]] = []
    if variants > 1:
        rows = worlds.worlds
        for name in ("medium", "flow", "traps"):
            pairs += _pairs(getattr(table.data, name), getattr(worlds.data, name), variants, rows)
        pairs += [
            (source, target)
            for source, target in zip(_force_rows(table), _force_rows(worlds), strict=True)
            if source.shape[0] == variants and target.shape[0] == rows
        ]
    data = [_row_data(*pair) for pair in pairs]
    return wp.array(data, dtype=RowData, device=worlds.device) if data else empty(0, RowData, worlds.device), data


def _row_data(source: wp.array, target: wp.array) -> Any:
    """`RowData`."""
    data = RowData()
    data.source, data.target = source, target
    return data


def _pairs(table: Any, worlds: Any, variants: int, rows: int) -> list[tuple[wp.array, wp.array]]:
    """Arrays of one struct that have a row per variant in the table and a row per world in the worlds."""
    found: list[tuple[wp.array, wp.array]] = []
    for name in PER_WORLD:
        if not hasattr(table, name):
            continue
        source, target = getattr(table, name), getattr(worlds, name)
        if source.size and source.shape[0] == variants and target.shape[0] == rows:
            found.append((_flat(source), _flat(target)))
    return found


def _force_rows(model: Model) -> list[wp.array]:
    """(rows, numbers) of each parameter of the model's forces, on their memory."""
    if not model.force_data:
        return []
    (data,) = model.force_data
    count = sum(len(force.parameters) for force in model.forces.body_forces)
    layout = data.layout.numpy()[: 2 * count].reshape(count, 2)
    ends = [*layout[1:, 0], data.value.shape[0]]
    return [data.value[a:end].reshape((n, (end - a) // n)) for (a, n), end in zip(layout.tolist(), ends, strict=True)]


def _flat(array: wp.array) -> wp.array:
    """(rows, numbers) on the same memory."""
    return array.reshape((array.shape[0], array.size // array.shape[0]))
