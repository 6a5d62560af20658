"""Launching the grid driver for worlds of some hundred bodies: a block of threads per world, many steps."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import warp as wp

from otwarp.kernels.core.features import WORLD_BLOCK, world_lanes
from otwarp.kernels.drivers.grid.soft import fill_slots
from otwarp.kernels.drivers.grid.turns import TURNS
from otwarp.simulation.drivers.compilation import load_kernels, usable_cores
from otwarp.simulation.drivers.grid_scratch import allocate_grid, allocate_push
from otwarp.simulation.drivers.launches import RecordedLaunch
from otwarp.simulation.drivers.stepping import StepperParts

BODY_STEPS_PER_LAUNCH = 2_000_000
"""Body-steps in one launch of a thread of a CPU, so that an interrupt from the keyboard is answered in reasonable
time; a GPU takes as many steps as that for one world."""


class BlockStepper:
    """Launches `world_of_many`; on a CPU the worlds are shared out over threads.

    A world's result depends on its index, seed and step alone, so any split gives the same bits.

    Attributes:
        captured_steps: Steps that one launch in a captured graph takes, which steps all worlds.
    """

    def __init__(self, parts: StepperParts):
        step, model = parts.step, parts.model
        assert step.fused is not None
        self.parts, self.kernel, self.model = parts, step.fused, model
        self.scratch = allocate_grid(model, parts.state)
        self.push = allocate_push(model)
        self.layout, self.launches = -1, list[RecordedLaunch]()
        cpu = model.device.is_cpu
        self.lanes = 1 if cpu else world_lanes(model.worlds, model.device.sm_count)
        self.block = 1 if cpu else WORLD_BLOCK
        self.chunks = min(parts.threads or usable_cores(), model.worlds) if cpu else 1
        self.pool = ThreadPoolExecutor(self.chunks) if self.chunks > 1 else None
        self.captured_steps = self._at_once(model.worlds)
        blocks = model.features.lanes or model.features.blocks
        load_kernels([self.kernel, *([fill_slots] if blocks else []), *parts.beside], model.device)
        if blocks:
            inputs = [model.data, self.scratch, model.features.bodies]
            wp.launch(fill_slots, dim=(model.worlds, 1), inputs=inputs, device=model.device)
        self.place()

    def place(self) -> None:
        """Have new neighbour lists made before the next step."""
        self.scratch.near.stale.fill_(1)

    def _look(self) -> None:
        """Bind the arrays as they are now: one that grew from one row to one per world is another array."""
        control = self.parts.control
        if self.layout != control.layout:
            views = [self.model.data, control.data(), self.parts.state.data(), self.parts.readout.data()]
            views += [self.scratch, self.push, self.lanes]
            # one for each thread, which changes its arguments
            self.launches = [
                RecordedLaunch(self.kernel, self.model.device, views, block_dim=self.block) for _ in range(self.chunks)
            ]
            self.layout = control.layout

    def _at_once(self, worlds: int) -> int:
        """Steps of one launch over so many worlds; on a GPU as many as for one."""
        most = (worlds if self.model.device.is_cpu else 1) * self.model.features.bodies
        return max(1, BODY_STEPS_PER_LAUNCH // most)

    def _launch(self, chunk: int, span: tuple[int, int], first_step: int, steps: int, last_step: int) -> None:
        """Steps of the worlds in a span of places, by one thread of a CPU or all of a GPU."""
        this = (span[0], wp.int64(first_step), steps, wp.int64(last_step), TURNS)
        self.launches[chunk]((span[1] - span[0], self.lanes), *this)

    def advance(self, first_step: int, steps: int, worlds: int | None = None) -> None:
        """Take `steps` steps from `first_step` in the first `worlds` worlds, or of the list of those in motion."""
        self._look()
        worlds = self.model.worlds if worlds is None else worlds
        # threads record nothing into the graph that another one captures
        pool = None if self.model.device.is_capturing else self.pool
        edges = np.linspace(0, worlds, (min(self.chunks, worlds) if pool else 1) + 1).astype(int).tolist()
        spans = list(itertools.pairwise(edges))
        last = first_step + steps
        at_once = self._at_once(edges[1])
        for start in range(first_step, last, at_once):
            count = min(at_once, last - start)
            if pool is None:
                self._launch(0, spans[0], start, count, last)
            else:
                step = partial(self._launch, first_step=start, steps=count, last_step=last)
                list(pool.map(step, itertools.count(), spans))
