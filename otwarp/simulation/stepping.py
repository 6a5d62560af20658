"""Launching a step: the fused drivers over threads, the body driver as a captured graph."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import warp as wp

from otwarp.kernels.contact import Contact
from otwarp.kernels.features import MAX_BODY_CONTACTS
from otwarp.kernels.grid import place_spheres, tick
from otwarp.kernels.grid_contacts import CHUNKS, RELAXATIONS
from otwarp.kernels.grid_data import GridData, PushData
from otwarp.kernels.step import Step
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, Readout, State

STEPS_PER_LAUNCH = 20_000
"""Longest fused launch, so that an interrupt from the keyboard is answered in reasonable time."""


def usable_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load(kernel: wp.Kernel, device: wp.Device) -> None:
    """Compile and load the variant of a kernel that launches will use: one thread per block on the CPU.

    Warp keeps one binary per block size, and the one it makes by default serves CUDA alone.
    """
    kernel.module.load(device, 1 if device.is_cpu else None)


class FusedStepper:
    """Launches the `solo` or `world` kernel; on the CPU the worlds are shared out over threads.

    A world's result depends on its index, seed and step alone, so any split gives the same bits.
    """

    def __init__(self, step: Step, model: Model, state: State, control: Control, readout: Readout, threads: int | None):
        self.step, self.model = step, model
        self.parts = (state, control, readout)
        self.layout = -1
        self.views: tuple = ()
        wanted = threads or usable_cores()
        chunks = min(wanted, model.worlds) if model.device.is_cpu else 1
        edges = np.linspace(0, model.worlds, chunks + 1).astype(int)
        self.spans = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
        # compile and load once, before threads may race for it
        assert step.fused is not None
        load(step.fused, model.device)
        self.pool = ThreadPoolExecutor(chunks) if chunks > 1 else None

    def _launch(self, span: tuple[int, int], first_step: int, steps: int) -> None:
        features = self.step.features
        width = features.bodies if features.driver == "solo" else 1
        wp.launch(
            self.step.fused,
            dim=(span[1] - span[0]) * width,
            inputs=[*self.views, span[0], wp.int64(first_step), steps],
            device=self.model.device,
        )

    def _look(self) -> None:
        """Bind the arrays as they are now: one that grew from one row to one per world is another array."""
        state, control, readout = self.parts
        if self.layout != control.layout:
            self.views = (self.model.data, control.data(), state.data(), readout.data())
            self.layout = control.layout

    def advance(self, first_step: int, steps: int) -> None:
        """Take `steps` steps from `first_step`."""
        self._look()
        for start in range(first_step, first_step + steps, STEPS_PER_LAUNCH):
            count = min(STEPS_PER_LAUNCH, first_step + steps - start)
            if self.pool is None:
                self._launch(self.spans[0], start, count)
            else:
                list(self.pool.map(lambda span, s=start, n=count: self._launch(span, s, n), self.spans))

    def extra_state(self) -> dict[str, wp.array]:
        """Arrays beyond State that a checkpoint must hold: none."""
        return {}


class GridStepper:
    """Launches the body driver: one captured graph per step, on CPU and CUDA alike."""

    def __init__(self, step: Step, model: Model, state: State, control: Control, readout: Readout):
        self.step, self.model = step, model
        self.state, self.control, self.readout = state, control, readout
        self.spheres = model.data.contact.sphere.shape[0]
        self.scratch = self._allocate()
        self.push = (self._allocate_push(), self._allocate_push())
        self.table = self._grid()
        for kernel in step.kernels:
            load(kernel, model.device)
        self.place()
        self.graph, self.layout = self._capture(), control.layout

    def _allocate(self) -> GridData:
        model, f = self.model, self.step.features
        w, b, device = model.worlds, f.bodies, model.device
        data = GridData()
        data.clock = wp.zeros(1, dtype=wp.int64, device=device)
        data.linear = wp.zeros((w, b), dtype=wp.vec3, device=device)
        data.angular = wp.zeros((w, b if f.rigid else 0), dtype=wp.vec3, device=device)
        touching = b if f.contacts else 0
        data.contact = wp.zeros((w * touching, MAX_BODY_CONTACTS), dtype=Contact, device=device)
        data.count = wp.zeros((w, touching), dtype=wp.int32, device=device)
        data.crowding = wp.zeros((w, touching), dtype=wp.float32, device=device)
        data.ahead = wp.zeros((w * touching, MAX_BODY_CONTACTS), dtype=wp.float32, device=device)
        data.moving = wp.zeros((w, RELAXATIONS if f.contacts else 0), dtype=wp.int32, device=device)
        data.share = wp.zeros((w, min(CHUNKS, touching)), dtype=wp.vec2, device=device)
        placed = w * self.spheres if f.pairs else 0
        data.centre = wp.zeros(placed, dtype=wp.vec3, device=device)
        data.group = wp.zeros(placed, dtype=wp.int32, device=device)
        radii = [s.radius for body in model.scene.bodies for s in body.spheres if s.collides]
        sticky = [body.material.adhesion_range for body in model.scene.bodies if body.material.adhesion > 0.0]
        data.largest = max(radii, default=0.0)
        data.reach = max(sticky, default=0.0)
        return data

    def _allocate_push(self) -> PushData:
        w, f, device = self.model.worlds, self.step.features, self.model.device
        touching = f.bodies if f.contacts else 0
        push = PushData()
        push.linear = wp.zeros((w, touching), dtype=wp.vec3, device=device)
        push.angular = wp.zeros((w, touching if f.rigid else 0), dtype=wp.vec3, device=device)
        return push

    def _grid(self) -> wp.HashGrid | None:
        if not self.step.features.pairs:
            return None
        # about two cells per sphere: more would cost clearing, fewer would crowd the buckets
        cells = int(np.clip(2 ** np.ceil(np.log2((2.0 * self.model.worlds * self.spheres) ** (1.0 / 3.0))), 4, 256))
        return wp.HashGrid(cells, cells, cells, device=self.model.device)

    def place(self) -> None:
        """Place the spheres of the present poses and build the first grid."""
        if self.table is None:
            return
        f = self.step.features
        wp.launch(
            place_spheres,
            dim=(self.model.worlds, f.bodies),
            inputs=[self.model.data, self.state.data(), self.scratch, int(f.rigid)],
            device=self.model.device,
        )
        self._build()

    def _build(self) -> None:
        assert self.table is not None
        cell = 2.0 * self.scratch.largest + self.scratch.reach
        self.table.build(self.scratch.centre, cell, groups=self.scratch.group)

    def _one_step(self) -> None:
        model, device = self.model, self.model.device
        control, state, readout = self.control.data(), self.state.data(), self.readout.data()
        each = (model.worlds, self.step.features.bodies)
        if self.step.move_traps is not None:
            dim = (model.worlds, len(model.scene.traps))
            wp.launch(self.step.move_traps, dim=dim, inputs=[model.data, control, state, self.scratch], device=device)
        wp.launch(self.step.advance, dim=each, inputs=[model.data, control, state, self.scratch], device=device)
        if self.table is not None:
            self._build()
        if self.step.find is not None:
            table = wp.uint64(self.table.id if self.table is not None else 0)
            inputs = [model.data, state, readout, self.scratch, self.push[0], table]
            wp.launch(self.step.find, dim=each, inputs=inputs, device=device)
            inputs = [model.data, self.scratch, self.push[0]]
            wp.launch(self.step.weigh, dim=self.scratch.share.shape, inputs=inputs, device=device)
            # one thread per world on the CPU makes a sweep over a settled world free
            shares = 1 if device.is_cpu else self.step.features.bodies
            for sweep in range(RELAXATIONS):
                before, after = self.push[sweep % 2], self.push[1 - sweep % 2]
                inputs = [model.data, readout, self.scratch, before, after, sweep, shares]
                wp.launch(self.step.relax, dim=(model.worlds, shares), inputs=inputs, device=device)
        inputs = [model.data, control, state, readout, self.scratch, self.push[0]]
        wp.launch(self.step.commit, dim=each, inputs=inputs, device=device)
        wp.launch(tick, dim=1, inputs=[self.scratch], device=device)

    def _capture(self) -> wp.Graph:
        load(tick, self.model.device)
        with wp.ScopedCapture(device=self.model.device) as capture:
            self._one_step()
        assert capture.graph is not None
        return capture.graph

    def advance(self, first_step: int, steps: int) -> None:
        """Take `steps` steps from `first_step`."""
        if self.layout != self.control.layout:
            # an array of the control grew and is another one now; the graph holds the old address
            self.graph, self.layout = self._capture(), self.control.layout
        self.scratch.clock.fill_(first_step)
        if self.table is not None:
            # Warp 1.19: a captured build copies the grid's descriptor from one host variable that all grids of the
            # process share. A build outside the graph makes that variable ours again before the graph reads it;
            # `Simulation.step` waits for the device before another grid can take it.
            self._build()
        for _ in range(steps):
            wp.capture_launch(self.graph)

    def extra_state(self) -> dict[str, wp.array]:
        """Sphere centres: recomputing them in another kernel could differ in the last bit."""
        return {"centre": self.scratch.centre}
