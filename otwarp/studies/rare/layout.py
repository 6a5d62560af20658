"""How runs share worlds and numbers: one run is the same bits wherever and beside whatever it is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.rare.basin import LIVES

STAGES = 192
"""Interfaces of a run, or rounds of splitting, at most."""

PILOT = 1000
"""Branches of a pilot, at least: with fewer it could not tell whether a distribution still changes."""

SLOTS = 2 * (LIVES + STAGES)
"""Blocks of numbers that a run has: for every life and stage, with the whole step and with the halved one."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Runs side by side in one ensemble: run g has the worlds from g·branches on.

    Attributes:
        seed: Of the study.
        runs: (G) number of each among all runs of the study.
        branches: Worlds of each.
        stride: Numbers of each in a block of its numbers, the same for all runs of a study.
        halved: Whether with half the time step.
    """

    seed: int
    runs: np.ndarray
    branches: int
    stride: int
    halved: bool = False

    def worlds(self, g: int) -> np.ndarray:
        """(branches) indices of the worlds of run g."""
        return np.arange(g * self.branches, (g + 1) * self.branches)

    def numbers(self, worlds: np.ndarray, slot: np.ndarray | int) -> np.ndarray:
        """Numbers of the trials in worlds, in one of their runs' blocks."""
        g, i = np.divmod(worlds, self.branches)
        block = np.asarray(slot) + (SLOTS // 2 if self.halved else 0)
        return ((self.runs[g].astype(np.int64) * SLOTS + block) * self.stride + i).astype(np.uint32)

    def of_life(self, worlds: np.ndarray, life: np.ndarray) -> np.ndarray:
        """Numbers in the basin."""
        return self.numbers(worlds, life)

    def of_stage(self, worlds: np.ndarray, stage: int) -> np.ndarray:
        """Numbers in a stage.

        Raises:
            InputError: There are too many.
        """
        if stage >= STAGES:
            raise InputError(f"an escape takes {stage} stages and more; allowed: up to {STAGES}, or an order parameter "
                             "that grows on the way to an escape")  # fmt: skip
        return self.numbers(worlds, LIVES + stage)

    def random(self, g: int, stage: int) -> np.random.Generator:
        """What is drawn on the host for a stage of run g."""
        counter = [0, stage, int(self.runs[g]), int(self.halved)]
        return np.random.Generator(np.random.Philox(key=[self.seed, 2**32 + 1], counter=counter))


def spread(count: int, wanted: int, random: np.random.Generator) -> np.ndarray:
    """(wanted) of `count` things, each as often as any other but for one, in a random order."""
    return np.resize(random.permutation(count), wanted)
