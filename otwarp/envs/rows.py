"""Rows of a table of variants, copied into the worlds that start anew."""

from __future__ import annotations

from typing import Any

import warp as wp

from otwarp.envs.kernels.rows import copy_rows
from otwarp.laws.trap_law import FIELDS
from otwarp.simulation.model import Model

PER_WORLD = (
    "thermal_energy", "viscosity", "speed", "shear_rate", "speed_limit", "held_range",
    *(f"{axial}{name}" for axial in ("", "axial_") for name in FIELDS),
)  # fmt: skip
"""Arrays of the model that may have a row for every world."""


class RowCopies:
    """What of a model differs between variants, and is copied for the flagged worlds from a table.

    Args:
        table: The model with a world for each of V variants.
        worlds: That of the worlds, each with a row of its own where parameters differ.
        variants: V.
        episode: `EpisodeData`, with flags and variants.

    Attributes:
        kernels: What is launched.
    """

    def __init__(self, table: Model, worlds: Model, variants: int, episode: Any):
        self.kernels = (copy_rows,)
        self.episode = episode
        self._pairs = []
        if variants > 1:
            rows = episode.variant.shape[0]
            for name in ("medium", "flow", "traps"):
                self._pairs += _pairs(getattr(table.data, name), getattr(worlds.data, name), variants, rows)
            self._pairs += [
                (source, target)
                for source, target in zip(_force_rows(table), _force_rows(worlds), strict=True)
                if source.shape[0] == variants and target.shape[0] == rows
            ]

    def launch(self) -> None:
        """Copy the rows of the flagged worlds."""
        for source, target in self._pairs:
            wp.launch(
                copy_rows, dim=target.shape[0], inputs=[self.episode.flags, self.episode.variant, source, target],
                device=target.device,
            )  # fmt: skip


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
