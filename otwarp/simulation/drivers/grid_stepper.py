"""Launching the grid driver: a captured graph of one step, with parts that the device takes only when needed."""

from __future__ import annotations

from typing import Any

import warp as wp

from otwarp.kernels.drivers.grid.cells import bound_cells, clear_cells, permute_slots, turn_slots
from otwarp.kernels.drivers.grid.contacts import next_sweeps, resume_sweeps
from otwarp.kernels.drivers.grid.slot_lists import sort_by_cell
from otwarp.kernels.drivers.grid.soft import fill_slots, load_slots, store_slots
from otwarp.kernels.drivers.grid.step import start_clock, tick
from otwarp.kernels.drivers.grid.turns import TURNS
from otwarp.simulation.drivers.compilation import load_kernels
from otwarp.simulation.drivers.grid_scratch import allocate_grid, allocate_push
from otwarp.simulation.drivers.stepping import StepperParts

BODY_STEPS_PER_LAUNCH = 2_000_000
"""Body-steps in one launch on the CPU, so that an interrupt from the keyboard is answered in reasonable time."""

SHARED = (start_clock, tick, next_sweeps, resume_sweeps, clear_cells, bound_cells, permute_slots, turn_slots,
          fill_slots, load_slots,
          store_slots)  # fmt: skip
"""Kernels that do not depend on the features."""


class GridStepper:
    """Launches the grid driver: one captured graph, on CPU and CUDA alike.

    On the CPU the loop over the steps of a call is part of the graph.

    Attributes:
        captured_steps: Steps that one launch of that graph takes.
    """

    def __init__(self, parts: StepperParts):
        step, model = parts.step, parts.model
        assert step.grid is not None
        self.kernels, self.model = step.grid, model
        self.state, self.control, self.readout = parts.state, parts.control, parts.readout
        self.features = step.features
        self.scratch = allocate_grid(model, parts.state)
        self.push = (allocate_push(model), allocate_push(model))
        self.elements = model.worlds * self.scratch.near.elements
        body_steps = BODY_STEPS_PER_LAUNCH if model.device.is_cpu else 1
        self.captured_steps = max(1, body_steps // (model.worlds * self.features.bodies))
        # the conditional parts of a graph need CUDA 12.4; without them they are taken in every step
        self.branches = model.device.is_cpu or wp.is_conditional_graph_supported()
        load_kernels((*step.grid.all, *SHARED, *parts.beside), model.device)
        if self.features.soft_contacts or self.features.lanes or self.features.blocks:
            self._share(fill_slots, self.features.bodies, model.data, self.scratch)
        self.place()
        self.graph, self.layout = self._capture(), self.control.layout

    def _launch(self, kernel: Any, dim: int | tuple[int, ...], *inputs: object) -> None:
        assert kernel is not None
        wp.launch(kernel, dim=dim, inputs=inputs, device=self.model.device)

    def _share(self, kernel: Any, each: int, *inputs: object) -> None:
        """Launch over all worlds and `each` items in them: one thread per item on a GPU, per world on a CPU."""
        size = each if self.model.device.is_cpu else 1
        self._launch(kernel, (self.model.worlds, each // size), *inputs, size)

    def _when(self, flag: wp.array, part) -> None:
        """Take a part of the step if the flag is set."""
        if self.branches:
            wp.capture_if(flag, on_true=part)
        else:
            part()

    def place(self) -> None:
        """Have new neighbour lists made before the next step."""
        self.scratch.near.stale.fill_(1)

    def _make_lists(self) -> None:
        data, state, grid = self.model.data, self.state.data(), self.scratch
        near = grid.near
        if self.kernels.bin is sort_by_cell:
            self._launch(sort_by_cell, self.model.worlds, grid)
            self._launch(turn_slots, 1, grid.row, grid.turn)
        elif self.features.pairs:
            self._share(self.kernels.bin, near.elements, data, state, grid)
            cells = near.start.shape[0]
            wp.utils.radix_sort_pairs(near.key, near.item, self.elements, 0, (cells - 1).bit_length())
            self._launch(clear_cells, cells, near.start, near.finish)
            self._launch(bound_cells, self.elements, near.key, self.elements, near.start, near.finish)
            if self.features.soft_contacts:
                self._launch(permute_slots, self.elements, near.item, grid.row, grid.turn, grid.place, grid.order)
                self._launch(turn_slots, 1, grid.row, grid.turn)
        self._share(self.kernels.list, near.elements, data, state, grid)

    def _sweep_pair(self) -> None:
        data, readout, grid = self.model.data, self.readout.data(), self.scratch
        for second in range(2):
            before, after = self.push[second], self.push[1 - second]
            self._share(self.kernels.relax, self.features.bodies, data, readout, grid, before, after, second)
        self._launch(next_sweeps, 1, grid)

    def _settle(self) -> None:
        grid = self.scratch
        if self.features.in_turn:
            self._take_turns(again=0)
            return
        self._launch(self.kernels.weigh, grid.share.shape, self.model.data, grid, self.push[0])
        self._sweep()

    def _settle_again(self) -> None:
        if self.features.in_turn:
            self._take_turns(again=1)
            return
        self._launch(resume_sweeps, self.model.worlds, self.scratch)
        self._sweep()

    def _take_turns(self, *, again: int) -> None:
        data, readout, grid = self.model.data, self.readout.data(), self.scratch
        self._launch(self.kernels.settle, self.model.worlds, data, readout, grid, self.push[0], again, TURNS)

    def _sweep(self) -> None:
        grid = self.scratch
        if self.branches:
            wp.capture_while(grid.unsettled, self._sweep_pair)
        else:
            for _ in range(grid.active.shape[0] // 2):
                self._sweep_pair()

    def _one_step(self) -> None:
        data, grid, kernels, f = self.model.data, self.scratch, self.kernels, self.features
        control, state, readout = self.control.data(), self.state.data(), self.readout.data()
        each = f.bodies
        if f.contacts:
            self._when(grid.near.stale, self._make_lists)
        if f.soft_contacts:
            self._share(kernels.soft, each, data, control, state, readout, grid)
            self._move_traps()
        else:
            self._share(kernels.advance, each, data, control, state, grid)
            self._move_traps()
            if f.contacts:
                self._share(kernels.find, each, data, state, readout, grid, self.push[0])
                self._when(grid.touching, self._settle)
            if kernels.correct is not None:
                self._share(kernels.correct, each, data, control, state, grid, self.push[0])
                if f.contacts:
                    self._when(grid.touching, self._settle_again)
            self._share(kernels.commit, each, data, control, state, readout, grid, self.push[0])
        if f.inlet:
            self._when(grid.outside, self._let_in)
        self._launch(tick, 1, grid)

    def _let_in(self) -> None:
        data, state, readout = self.model.data, self.state.data(), self.readout.data()
        self._launch(self.kernels.let_in, self.model.worlds, data, state, readout, self.scratch)

    def _move_traps(self) -> None:
        """From where the first stage saw them to where they are at the end of the step."""
        if self.kernels.move_traps is not None:
            dim = (self.model.worlds, self.features.traps)
            self._launch(self.kernels.move_traps, dim, self.model.data, self.control.data(), self.state.data(),
                         self.scratch)  # fmt: skip

    def _capture(self) -> wp.Graph:
        with wp.ScopedCapture(device=self.model.device) as capture:
            if self.model.device.is_cpu:
                wp.capture_while(self.scratch.left, self._one_step)
            else:
                self._one_step()
        assert capture.graph is not None
        return capture.graph

    def advance(self, first_step: int, steps: int, worlds: int | None = None) -> None:
        """Take `steps` steps from `first_step`, in all worlds."""
        if self.layout != self.control.layout:
            # an array of the control grew and is another one now; the graph holds the old address
            self.graph, self.layout = self._capture(), self.control.layout
        data, state, grid = self.model.data, self.state.data(), self.scratch
        if self.features.soft_contacts:
            self._share(load_slots, self.features.bodies, data, state, grid)
        if self.features.contacts:
            self._share(self.kernels.check, grid.near.elements, data, state, grid)
        at_once = self.captured_steps if self.model.device.is_cpu else steps
        last = first_step + steps
        for start in range(first_step, last, at_once):
            count = min(at_once, last - start)
            self._launch(start_clock, 1, grid, wp.int64(start), count, wp.int64(last))
            for _ in range(1 if self.model.device.is_cpu else count):
                wp.capture_launch(self.graph)
        if self.features.soft_contacts:
            self._share(store_slots, self.features.bodies, data, state, grid)
