"""A bead in a trap of any force model, stepped in many worlds as a user's run is, and asked for its forces."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.rungs import Rung, TrappedBead
from otwarp.bench.timing import calls_for, elapsed
from otwarp.optics.table_cache import cache_folder, load
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.packing.optics import TrapOptics
from otwarp.simulation.simulation import Simulation

SEED = 20240607
"""Of start and probes: every run judges the models on the same points."""


class TimedRung:
    """A rung in motion, ready to be timed and to be asked for forces.

    Further arguments are those of `Simulation`.

    Attributes:
        rung: Its force model.
        sim: One bead per world.
        steps: Steps in one sample.
        build_seconds: Time its table took, None without a table or with one from the cache.
    """

    def __init__(
        self,
        bead: TrappedBead,
        rung: Rung,
        device: wp.Device,
        *,
        worlds: int,
        time_step: float,
        seconds: float,
        **settings: Any,
    ):
        scene = bead.scene(rung)
        self.rung, self.device = rung, device
        self.build_seconds = self._build(bead, device)
        how: dict = {"time_step": time_step, "threads": 1, **settings}
        self.sim = Simulation(scene, worlds=worlds, seed=SEED, device=device, **how)
        # a bead at rest at the equilibrium would make all worlds read the same cell of a table
        start = bead.thermal_points(worlds, np.random.default_rng(SEED))[:, None, :]
        self.start = device_array(start, wp.vec3, self.sim.model.place, ndim=2)
        self.rewind()
        self.steps = calls_for(self.sim.step, device, seconds)

    def _build(self, bead: TrappedBead, device: wp.Device) -> float | None:
        """Put the rung's table into the cache, from which the simulation takes it."""
        if self.rung.tolerance is None:
            return None
        held = load(cache_folder(), bead.beam, bead.sphere, self.rung.tolerance, self.rung.family)  # type: ignore[arg-type]
        if held is not None:
            return None
        begin = time.perf_counter()
        TrapOptics.of(bead.scene(self.rung), np.zeros((1, 3)), device)
        return time.perf_counter() - begin

    def rewind(self) -> None:
        """Put the beads where they started."""
        wp.copy(self.sim.state.position, self.start)

    def sample(self) -> float:
        """One measurement [ns per bead-step]."""
        self.rewind()
        taken = elapsed(lambda: self.sim.step(self.steps), self.device).on(self.device)
        return 1e9 * taken / (self.steps * self.sim.model.worlds)

    def force_at(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) force that the simulation computes for a bead at `points` (n, 3) [pN], a world for each point."""
        worlds = self.sim.model.worlds
        parts = []
        for first in range(0, len(points), worlds):
            chunk = points[first : first + worlds]
            # worlds that are left over repeat the chunk
            self.sim.set_state(position=np.resize(chunk, (worlds, 1, 3)))
            # on the CPU the array is a view of what the next chunk overwrites; astype copies
            parts.append(self.sim.readout.trap_force.numpy()[: len(chunk), 0].astype(float))
        return np.concatenate(parts)

    def table_bytes(self) -> int:
        """Memory of the table's nodes [B]."""
        return 0 if self.rung.tolerance is None else sum(t.size for t in self.sim.model.optics.tables)
