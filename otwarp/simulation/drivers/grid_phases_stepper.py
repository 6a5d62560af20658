"""Launching worlds of some hundred bodies in phases, on GPUs: their contacts by a team of threads for each world."""

from __future__ import annotations

import warp as wp

from otwarp.kernels.core.features import world_lanes
from otwarp.kernels.drivers.grid.phases import TEAM_BLOCK, GridPhases
from otwarp.simulation.drivers.grid_scratch import allocate_grid, allocate_push
from otwarp.simulation.drivers.stepping import PhaseGraphs, StepperParts

TEAM_LANES = 32
"""Threads of a team at least: a world has some tens of entries."""


def places_for(moving: int | None, worlds: int) -> int:
    """Places over which steps are launched where so many of all `worlds` are in motion; None: all of them.

    A power of two, or all: so graphs are few, and less than half of their places are empty.
    """
    return worlds if moving is None else min(1 << (max(moving, 1) - 1).bit_length(), worlds)


class GridPhasesStepper(PhaseGraphs):
    """Launches the phases of `by_world`; a world's result depends on its index, seed and step alone.

    Attributes:
        lanes: Threads of the team of a world.
        block: Threads of a block of teams.
    """

    def __init__(self, parts: StepperParts):
        model = parts.model
        assert isinstance(parts.step.phases, GridPhases)
        self.phases = parts.step.phases
        self.scratch, self.push = allocate_grid(model, parts.state), allocate_push(model)
        device = model.device
        self.lanes = 1 if device.is_cpu else world_lanes(model.worlds, device.sm_count, least=TEAM_LANES)
        self.block = 1 if device.is_cpu else max(self.lanes, TEAM_BLOCK)
        super().__init__(parts)
        self.place()

    def place(self) -> None:
        """Have new neighbour lists made before the next step."""
        self.scratch.near.stale.fill_(1)

    def _take_steps(self, steps: int) -> None:
        phases, worlds = self.phases, self.places
        bodies, elements = (worlds, self.features.bodies), (worlds, self.scratch.near.elements)
        found = (worlds, max(elements[1], self.features.traps if self.features.speed_limits else 0))
        data, control, state, readout = self.model.data, self.control.data(), self.state.data(), self.readout.data()
        grid, push = self.scratch, self.push
        for _ in range(steps):
            self.launch(phases.refer, elements, data, state, grid)
            self.launch(phases.list, elements, data, state, grid)
            self.launch(phases.advance, bodies, data, control, state, grid)
            self.launch(phases.find, found, data, control, state, readout, grid, push)
            self._settle(0)
            if phases.correct is not None:
                self.launch(phases.correct, bodies, data, control, state, grid, push)
                self._settle(1)
            self.launch(phases.commit, bodies, data, control, state, readout, grid, push)
            self.launch(phases.let_in, worlds, data, state, readout, grid)

    def _settle(self, again: int) -> None:
        """Solve the contacts of a stage."""
        views = self.model.data, self.state.data(), self.readout.data(), self.scratch, self.push
        self.launch(self.phases.settle, (self.places, self.lanes), *views, self.lanes, again, block=self.block)

    def advance(self, first_step: int, steps: int, worlds: int | None = None) -> None:
        """Take `steps` steps from `first_step` in all worlds, or in those of the list of worlds in motion."""
        self.places = places_for(worlds, self.model.worlds)
        elements = self.places, self.scratch.near.elements
        span = wp.int64(first_step), wp.int64(first_step + steps)
        self.launch(self.phases.start, elements, self.model.data, self.state.data(), self.scratch, *span)
        self.replay(steps)
