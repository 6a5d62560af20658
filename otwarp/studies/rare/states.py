"""States of worlds on the host: all that a path goes on from, so that it can be split in any scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.simulation.simulation import Simulation

PARTS = ("state.position", "state.orientation", "state.trap_position", "state.image", "readout.entries")
"""Arrays with a row for every world of which a state is made, by their names in a checkpoint."""


@dataclass(frozen=True, eq=False)
class States:
    """n states: with the checkpoint's digest of the scene, all that there is to know of a world but its noise.

    Attributes:
        parts: By the names of `PARTS`, (n, …) rows.
        clock: (n) int64 steps since each path began; time samples of traps and obstacles go by it.
        order: (n) order parameters.
        escaped: (n) whether the sphere had been lost when the state was kept: such a path has crossed everything.
    """

    parts: dict[str, np.ndarray]
    clock: np.ndarray
    order: np.ndarray
    escaped: np.ndarray

    def __len__(self) -> int:
        return len(self.clock)

    def __getitem__(self, which: np.ndarray) -> States:
        parts = {name: rows[which] for name, rows in self.parts.items()}
        return States(parts, self.clock[which], self.order[which], self.escaped[which])

    def put(self, which: np.ndarray, other: States) -> States:
        """The same with some of them replaced."""
        out = dataclasses.replace(
            self,
            parts={name: rows.copy() for name, rows in self.parts.items()},
            clock=self.clock.copy(),
            order=self.order.copy(),
            escaped=self.escaped.copy(),
        )
        for name, rows in out.parts.items():
            rows[which] = other.parts[name]
        out.clock[which], out.order[which], out.escaped[which] = other.clock, other.order, other.escaped
        return out

    @classmethod
    def joined(cls, several: Sequence[States]) -> States:
        """All of them, in this order."""
        first = several[0]
        parts = {name: np.concatenate([s.parts[name] for s in several]) for name in first.parts}
        clock, order, escaped = (
            np.concatenate([getattr(s, n) for s in several]) for n in ("clock", "order", "escaped")
        )
        return cls(parts, clock, order, escaped)


def read(sim: Simulation, worlds: np.ndarray, order: np.ndarray, escaped: np.ndarray) -> States:
    """The states of some worlds, by their indices, copied to the host."""
    arrays = sim.arrays()
    parts = {name: arrays[name].numpy()[worlds].copy() for name in PARTS}
    return States(parts, sim.episodes.step.numpy()[worlds].copy(), order, escaped)


def write(sim: Simulation, worlds: np.ndarray, states: States, numbers: np.ndarray) -> None:
    """Put worlds into states, one each; they go on from there with the noise of trials of these numbers."""
    count = sim.model.worlds
    chosen = np.zeros(count, dtype=bool)
    chosen[worlds] = True
    trials = np.zeros(count, dtype=np.uint32)
    trials[worlds] = numbers
    # nothing measured and no escape; the poses follow, with the bits that were kept
    sim.reset(chosen, number=trials)
    arrays = sim.arrays()
    for name, rows in {**states.parts, "episodes.step": states.clock}.items():
        kept = arrays[name].numpy().copy()
        kept[worlds] = rows
        arrays[name].assign(kept)
