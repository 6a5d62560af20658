"""Rows of a table of variants, copied into the worlds that start anew."""

from __future__ import annotations

from typing import Any

import warp as wp

from otwarp.envs.kernels.rows import copy_rows
from otwarp.laws.trap_law import FIELDS

PER_WORLD = (
    "thermal_energy", "viscosity", "speed", "shear_rate", "speed_limit", "held_range",
    *(f"{axial}{name}" for axial in ("", "axial_") for name in FIELDS),
)  # fmt: skip
"""Arrays of the model that may have a row for every world."""


class RowCopies:
    """What of a model differs between variants, and is copied for the flagged worlds from a table.

    Args:
        table: `ModelData` with a world for each of V variants.
        worlds: `ModelData` of the worlds, each with a row of its own where parameters differ.
        variants: V.
        episode: `EpisodeData`, with flags and variants.

    Attributes:
        kernels: What is launched.
    """

    def __init__(self, table: Any, worlds: Any, variants: int, episode: Any):
        self.kernels = (copy_rows,)
        self.episode = episode
        self._pairs = []
        if variants > 1:
            rows = episode.variant.shape[0]
            for name in ("medium", "flow", "traps"):
                self._pairs += _pairs(getattr(table, name), getattr(worlds, name), variants, rows)

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


def _flat(array: wp.array) -> wp.array:
    """(rows, numbers) on the same memory."""
    return array.reshape((array.shape[0], array.size // array.shape[0]))
