"""Launching the drivers of few bodies: one kernel for many steps, or on a GPU a graph of the phases of some steps."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.types import ModelData, StepTimes
from otwarp.kernels.drivers.lane_groups import threads_for
from otwarp.kernels.drivers.world_phases import tick
from otwarp.kernels.step import Step
from otwarp.simulation.drivers.compilation import load_kernels, usable_cores
from otwarp.simulation.drivers.launches import RecordedLaunch
from otwarp.simulation.drivers.world_scratch import allocate_world, spread_of
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, Readout, State

STEPS_PER_LAUNCH = 20_000
"""Longest fused launch, so that an interrupt from the keyboard is answered in reasonable time."""


@dataclass(frozen=True, eq=False)
class StepperParts:
    """What a stepper launches, and on what.

    Attributes:
        step: The kernels of the step.
        model, state, control, readout: What they read and change.
        threads: On the CPU, most threads that share the worlds; None: as many as there are cores.
        beside: Kernels that are loaded along with those of the step.
    """

    step: Step
    model: Model
    state: State
    control: Control
    readout: Readout
    threads: int | None = None
    beside: Sequence[wp.Kernel] = ()


class FusedStepper:
    """Launches the `solo` or `world` kernel; on the CPU the worlds are shared out over threads.

    A world's result depends on its index, seed and step alone, so any split gives the same bits.

    Attributes:
        captured_steps: Steps that one launch in a captured graph takes.
    """

    captured_steps = STEPS_PER_LAUNCH

    def __init__(self, parts: StepperParts):
        step, model = parts.step, parts.model
        self.parts, self.step, self.model = parts, step, model
        self.layout = -1
        self.launches: list[RecordedLaunch] = []
        self.chunks = min(parts.threads or usable_cores(), model.worlds) if model.device.is_cpu else 1
        # once, before threads may race for it
        assert step.fused is not None
        self.kernel = step.fused
        load_kernels([self.kernel, *parts.beside], model.device)
        self.block = 1 if model.device.is_cpu else step.fused.module.options["block_dim"]
        self.pool = ThreadPoolExecutor(self.chunks) if self.chunks > 1 else None
        self.spread, self.scratch = 1, None
        if step.features.driver == "world":
            self.spread = spread_of(model.worlds, model.device)
            rows = self.chunks if model.device.is_cpu else model.worlds
            self.scratch = allocate_world(step.features, rows, model.place)

    def _room(self, chunk: int) -> list[Any]:
        """Arguments that only the `world` kernel takes: a thread of a CPU steps its worlds in one row, in turn."""
        if self.scratch is None:
            return []
        return [self.scratch, self.spread, chunk if self.model.device.is_cpu else -1]

    def _launch(self, chunk: int, span: tuple[int, int], first_step: int, steps: int) -> None:
        features = self.step.features
        worlds = span[1] - span[0]
        threads = worlds * features.bodies if features.driver == "solo" else worlds
        last = (span[0], wp.int64(first_step), steps)
        if features.lanes:
            self.launches[chunk](threads_for(threads), *last, worlds)
        else:
            self.launches[chunk](threads * self.spread, *last)

    def _look(self) -> None:
        """Bind the arrays as they are now: one that grew from one row to one per world is another array."""
        control = self.parts.control
        if self.layout != control.layout:
            views = (self.model.data, control.data(), self.parts.state.data(), self.parts.readout.data())
            # one for each thread, which changes its arguments
            self.launches = [
                RecordedLaunch(self.kernel, self.model.device, [*views, *self._room(chunk)], block_dim=self.block)
                for chunk in range(self.chunks)
            ]
            self.layout = control.layout

    def advance(self, first_step: int, steps: int, worlds: int | None = None) -> None:
        """Take `steps` steps from `first_step` in the first `worlds` worlds, or of the list of those in motion."""
        self._look()
        worlds = self.model.worlds if worlds is None else worlds
        # threads record nothing into the graph that another one captures
        pool = None if self.model.device.is_capturing else self.pool
        for start in range(first_step, first_step + steps, STEPS_PER_LAUNCH):
            count = min(STEPS_PER_LAUNCH, first_step + steps - start)
            if pool is None:
                self._launch(0, (0, worlds), start, count)
            else:
                edges = np.linspace(0, worlds, min(self.chunks, worlds) + 1).astype(int).tolist()
                spans = itertools.pairwise(edges)
                list(pool.map(lambda c, span, s=start, n=count: self._launch(c, span, s, n), itertools.count(), spans))

    def place(self) -> None:
        """Take note that the state is another one: nothing here remembers it."""


STEPS_PER_GRAPH = 16
"""Steps in the longer of the graphs: launching one takes longer than a step of few worlds."""


class PhaseGraphs(ABC):
    """Steps of a driver in phases: graphs of one step and of some, replayed.

    Args:
        parts: What is launched, and on what.
        beside: Kernels that are loaded along with the phases.

    Attributes:
        places: Worlds over which the next steps are launched, or places in the list of those in motion.
        captured_steps: Steps that one launch of each phase in a captured graph takes.
    """

    captured_steps = 1

    def __init__(self, parts: StepperParts, *beside: Any):
        step = parts.step
        assert step.phases is not None
        self.model, self.features = parts.model, step.features
        self.state, self.control, self.readout = parts.state, parts.control, parts.readout
        load_kernels([*step.phases.all, *beside, *parts.beside], parts.model.device)
        self.places, self.layout = parts.model.worlds, -1
        self.graphs: dict[tuple[int, int], wp.Graph] = {}

    def launch(self, kernel: Any, dim: int | tuple[int, int], *inputs: object, block: int | None = None) -> None:
        """Launch a kernel over `dim` threads, in blocks of `block` or of what it was compiled for; nothing for None."""
        if kernel is not None:
            block = block or kernel.module.options["block_dim"]
            wp.launch(kernel, dim=dim, inputs=inputs, device=self.model.device, block_dim=block)

    @abstractmethod
    def _take_steps(self, steps: int) -> None:
        """Launch so many steps."""

    def _capture(self, steps: int) -> wp.Graph:
        with wp.ScopedCapture(device=self.model.device) as capture:
            self._take_steps(steps)
        assert capture.graph is not None
        return capture.graph

    def replay(self, steps: int) -> None:
        """Take so many steps by graphs, or as a part of one that a user captures."""
        if self.model.device.is_capturing:
            self._take_steps(steps)
            return
        if self.layout != self.control.layout:
            # an array of the control grew and is another one now; the graphs hold the old address
            self.graphs, self.layout = {}, self.control.layout
        for length, times in ((STEPS_PER_GRAPH, steps // STEPS_PER_GRAPH), (1, steps % STEPS_PER_GRAPH)):
            which = length, self.places
            if times and which not in self.graphs:
                self.graphs[which] = self._capture(length)
            for _ in range(times):
                wp.capture_launch(self.graphs[which])


class PhasedStepper(PhaseGraphs):
    """Launches the phases of the `world` driver."""

    def __init__(self, parts: StepperParts):
        step, model = parts.step, parts.model
        self.phases: Any = step.phases  # of the float64 form, another class
        self.bodies = step.features.bodies
        self.team = step.features.team if model.device.is_cuda else 1
        self.scratch = allocate_world(step.features, model.worlds, model.place)
        self.clock = wp.zeros(1, dtype=wp.int64, device=model.device)
        super().__init__(parts, tick)
        self.looked = step.features.traps + model.data.obstacles.shape.size
        self.looks = self._room_for_looks() if self.phases.look is not None else {}

    def _room_for_looks(self) -> dict[str, dict[str, Any]]:
        """What key frames say at the times of the steps of a graph, by the struct and the name that they have there."""
        data, place = self.model.data, self.model.place
        times = place.typed(StepTimes)()
        times.first = wp.zeros(1, dtype=wp.int64, device=place.device)
        times.per_second = wp.float64(1.0 / self.model.time_step)
        rows, obstacles = STEPS_PER_GRAPH + 1, data.obstacles.shape.size

        def room(columns: int, dtype: Any) -> wp.array:
            return wp.zeros((rows, columns), dtype=place.typed(dtype), device=place.device)

        return {
            "traps": {"step_times": times, "step_value": room(self.features.traps, wp.vec4)},
            "obstacles": {
                "step_times": times,
                "step_position": room(obstacles, wp.vec3),
                "step_rotation": room(obstacles, wp.quat),
            },
        }

    def _data(self) -> Any:
        """The kernels' view of the model, with this stepper's own room: others may step the same model."""
        if not self.looks:
            return self.model.data
        data = self.model.place.typed(ModelData)()
        data.assign(self.model.data)
        for struct, fields in self.looks.items():
            for name, value in fields.items():
                setattr(getattr(data, struct), name, value)
        return data

    def _take_steps(self, steps: int) -> None:
        """Launch steps from where the clock stands, and turn it on."""
        phases, worlds = self.phases, self.model.worlds
        team = worlds * self.team
        each = (self.bodies, team)
        settling = team if phases.settled_together else worlds
        data, state, readout = self._data(), self.state.data(), self.readout.data()
        free = (data, self.control.data(), state, readout, self.scratch, self.clock)
        touch = (data, state, readout, self.scratch, self.clock)
        for ahead in range(steps):
            if ahead % STEPS_PER_GRAPH == 0:
                rows = min(steps - ahead, STEPS_PER_GRAPH) + 1
                self.launch(phases.look, (rows, self.looked), data, self.clock, ahead)
            self.launch(phases.predict, each, *free, ahead)
            self.launch(phases.find, team, *free, ahead)
            self.launch(phases.settle, settling, *touch, ahead, 0)
            if phases.correct is not None:
                self.launch(phases.correct, each, *free, ahead)
                self.launch(phases.settle, settling, *touch, ahead, 1)
            self.launch(phases.finish, team, *free, ahead)
        self.launch(tick, 1, self.clock, steps)

    def advance(self, first_step: int, steps: int, worlds: int | None = None) -> None:
        """Take `steps` steps from `first_step` in all worlds, or in those of the list of worlds in motion."""
        self.clock.fill_(first_step)
        self.replay(steps)
        self.launch(
            self.phases.report, self.model.worlds, self.model.data, self.readout.data(), self.scratch, self.clock
        )

    def place(self) -> None:
        """Take note that the state is another one: nothing here remembers it."""
