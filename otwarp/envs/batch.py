"""Worlds of a task on a device: actions in, periods of control, observations, rewards and ends out, as one graph."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.envs.kernels.control import take
from otwarp.envs.kernels.judge import VerdictData
from otwarp.envs.kernels.starts import NEXT_EPISODE, StartData
from otwarp.envs.layout import Layout
from otwarp.envs.places import episode_data, limited_scene, place_data, stepped_scene
from otwarp.envs.randomise.rows import row_data
from otwarp.envs.randomise.variants import Variants
from otwarp.envs.task import Task, check_task
from otwarp.errors import InputError
from otwarp.kernels.core.types import StateData
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arguments import whole
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.simulation import Simulation

Autoreset = Literal["next", "same", "off"]
WORLDS_EACH = 64
"""Worlds of a thread on a CPU, where each thread reads all arguments of its kernel anew: some hundred numbers."""
MOST_STEPS = 100_000
"""Time steps of a period."""
SEED = 0
"""Key of all random streams: what differs between environments and episodes is the number of the trial."""


class Batch:
    """W worlds of a task.

    Args:
        task: The task.
        worlds: W.
        device: `"cpu"`, `"cuda:0"`, … or None for the best available.
        autoreset: When a world that has ended starts anew: in the period after, in the same one, or when it is told.

    Attributes:
        task, scene, layout: What was given, the scene as it is stepped, and what the numbers are.
        sim: What steps.
        actions: In: (W, A) float32, within ±1.
        episode: `EpisodeData`.
        verdict: `VerdictData`, out.
        steps: Time steps of a period.

    Raises:
        InputError: What is no task, or one that its scene does not allow.
    """

    def __init__(
        self,
        task: Task,
        worlds: int = 1,
        *,
        device: str | wp.Device | None = None,
        autoreset: Autoreset = "next",
    ):
        check_task(task)
        worlds = whole("num_envs", worlds, 1)
        self.task, self.worlds, self.device = task, worlds, pick_device(device)
        self.autoreset = autoreset
        self.scene = stepped_scene(task, task.load())
        self.layout = Layout(task, self.scene)
        variants = Variants(task, self.scene)
        table = self._table(variants)
        self.steps = self._steps(variants, table)
        self.sim = Simulation(
            self.scene, worlds=worlds, seed=SEED, device=self.device, time_step=1.0 / (task.rate * self.steps),
            parameters=variants.rows(worlds), ends=(), glides=self.layout.moves, readout=False,
        )  # fmt: skip
        model = self.sim.model
        self.episode = episode_data(self.layout, model)
        self.place, self._meshes = place_data(self.layout, model)
        self._take_traps()
        self._start = self._starts(variants, table)
        self._hands, self._numbers = self.layout.hands(self.device), self.layout.numbers(self.device)
        self.actions = wp.zeros((worlds, len(self.layout.acted)), dtype=wp.float32, device=self.device)
        self.verdict = self._verdict()
        self._judge, self._start_worlds = self.layout.kernels()
        self._load()
        # in the mode `same` no world stands still: what ends in a period starts anew in it
        every = autoreset == "same"
        self._turn = self.sim.capture(
            self.steps, before=self._before, after=self._after, every_world=every, settle=False
        )

    def _table(self, variants: Variants) -> Model:
        """The model that has a world for each variant; two where there is one, so that its rows are told apart."""
        return Model.build(
            self.scene, worlds=variants.count, device=self.device, parameters=variants.rows(variants.count)
        )

    def _steps(self, variants: Variants, table: Model) -> int:
        """Time steps of a period, no longer than the physics allows."""
        task, values = self.task, variants.rows(variants.count)
        scene = limited_scene(task, self.scene) if self.layout.moves else self.scene
        if task.action != "velocity":
            values["trap_power"] = np.full(len(scene.traps), task.power[1])
        hardest = Model.build(scene, worlds=variants.count, device=self.device, parameters=values)
        steps = math.ceil(1.0 / (task.rate * min(table.time_step, hardest.time_step)) - 1e-9)
        if steps > MOST_STEPS:
            least = task.rate * steps / MOST_STEPS
            raise InputError(f"rate of task {task.name} is {task.rate!r}, {steps} time steps of the physics a period; "
                             f"allowed: from {least:.3g} Hz on, {MOST_STEPS} steps")  # fmt: skip
        return max(1, steps)

    def _take_traps(self) -> None:
        """Let commands differ from world to world; traps of hands follow nothing but them."""
        control = self.sim.control
        for name in ("trap_position", "trap_power"):
            if getattr(control, name).shape[0] != self.worlds:
                control.widen(name)

    def _starts(self, variants: Variants, table: Model) -> Any:
        """`StartData`."""
        task, model, start = self.task, self.sim.model, StartData()
        values = table.values
        start.seed, start.variants = wp.uint32(SEED), variants.count
        start.position = device_array(variants.places(model), wp.vec3, self.device, ndim=2)
        turns = variants.orientations(model) if model.features.rigid else np.zeros((1, 0, 4))
        start.orientation = device_array(turns, wp.quat, self.device, ndim=2)
        start.focus = device_array(values["trap_position"], wp.vec3, self.device, ndim=2)
        start.power = device_array(values["trap_power"], wp.float32, self.device, ndim=2)
        names = {"bodies": [b.name for b in self.scene.bodies], "traps": [t.prim for t in self.scene.traps]}
        groups = {kind: np.full(len(prims), -1) for kind, prims in names.items()}
        for n, shift in enumerate(task.shifts):
            for kind in ("bodies", "traps"):
                for prim in getattr(shift, kind):
                    if prim not in names[kind]:
                        allowed = ", ".join(names[kind]) or "none"
                        raise InputError(f"shift of task {task.name} has {prim}; allowed {kind}: {allowed}")
                    groups[kind][names[kind].index(prim)] = n
        start.body_group = device_array(groups["bodies"], wp.int32, self.device)
        start.trap_group = device_array(groups["traps"], wp.int32, self.device)
        start.half = device_array([s.half for s in task.shifts] or [(0, 0, 0)], wp.vec3, self.device)
        start.middle = device_array([s.middle for s in task.shifts] or [(0, 0, 0)], wp.vec3, self.device)
        goal = task.goal or (self.scene.goal.position if self.scene.goal else (0.0, 0.0, 0.0))
        start.goal, start.goal_half = wp.vec3(*goal), wp.vec3(*task.goal_half)
        start.rows, self._rows = row_data(table, model, variants.count)
        start.state = self._state(start.orientation.shape[1])
        return start

    def _state(self, turning: int) -> Any:
        """`StateData` of worlds that start anew: poses of their own, the rest as the scene has it."""
        origin, shape = self.sim.episodes.origin.state, (self.worlds, len(self.scene.bodies))
        state = StateData()
        state.position = wp.zeros(shape, dtype=wp.vec3, device=self.device)
        state.orientation = wp.zeros((self.worlds, turning), dtype=wp.quat, device=self.device)
        state.trap_position, state.image = origin.trap_position, wp.zeros_like(origin.image)
        return state

    def _verdict(self) -> Any:
        """`VerdictData`, all zero."""
        w, seen, rewards = self.worlds, len(self.layout.seen), len(self.task.rewards)
        shapes = {"seen": (w, seen), "earned": (w, rewards), "last_seen": (w if self.autoreset == "same" else 0, seen)}
        out = VerdictData()
        for name, var in VerdictData.vars.items():
            setattr(out, name, wp.zeros(shapes.get(name, (w,)), dtype=var.type.dtype, device=self.device))
        return out

    def _load(self) -> None:
        """Compile and load what the graph captures."""
        for kernel in (take, self._judge, self._start_worlds):
            wp.load_module(kernel.module, device=self.device)

    def _launch(self, kernel: Any, *inputs: object, places: int | None = None) -> None:
        """Launch a kernel over all worlds, or over so many places of a list."""
        each, block = WORLDS_EACH if self.device.is_cpu else 1, kernel.module.options["block_dim"]
        dim = math.ceil((self.worlds if places is None else places) / each)
        wp.launch(kernel, dim=dim, inputs=[*inputs, each], device=self.device, block_dim=block)

    @property
    def _worlds(self) -> Any:
        """`WorldsData` of the model."""
        return self.sim.model.episode_data[0]

    def _views(self) -> tuple[Any, ...]:
        """Commands, state, readout, place and the worlds, as kernels see them."""
        sim = self.sim
        return sim.control.data(), sim.state.data(), sim.last_readout.data(), self.place, self._worlds

    def _begin(self, listed: wp.array, count: wp.array, *, hold: bool = False, ended: bool = False) -> None:
        """Start the first `count` of the listed worlds anew, with `ended` those that have ended; held for a period."""
        model, seen = self.sim.model.data, self.verdict.seen
        how = self._numbers, listed, count, int(ended), int(hold), self.episode
        self._launch(self._start_worlds, self._start, model, *self._views(), *how, seen, places=len(listed))
        self.sim.note_starts()

    def _before(self) -> None:
        """What comes before the steps of a period: worlds start anew, and actions are taken in."""
        sim, episode = self.sim, self.episode
        if self.autoreset == "next":
            self._begin(episode.over, episode.over_count, hold=True, ended=True)
        control, state, step = sim.control.data(), sim.state.data(), wp.float64(sim.time_step)
        self._launch(take, self.actions, self._hands, self.place, step, self._worlds, control, state, episode)

    def _after(self) -> None:
        """What comes after a period: its verdict, and in the mode `same` worlds that start anew."""
        same = self.autoreset == "same"
        how = self._numbers, self.steps, int(same)
        self._launch(self._judge, *self._views(), *how, self.episode, self.verdict)
        if same:
            self._begin(self.episode.over, self.episode.over_count, ended=True)

    def restart(self, chosen: np.ndarray | None = None, seeds: np.ndarray | None = None) -> None:
        """Start worlds anew, at once.

        Args:
            chosen: (W) bool; None for all.
            seeds: (W) whole numbers of environments, -1 to go on with the next episode; None for that everywhere.
        """
        flags = np.ones(self.worlds, dtype=bool) if chosen is None else chosen.astype(bool)
        episode, listed = self.episode, np.flatnonzero(flags)
        if seeds is not None:
            number = episode.number.numpy().copy()
            fresh = flags & (seeds >= 0)
            first = (seeds.astype(np.int64) - int(NEXT_EPISODE)) % 2**32
            number[fresh] = first[fresh].astype(np.uint32)
            episode.number.assign(number)
        places, count = (device_array(a, wp.int32, self.device) for a in (listed, [len(listed)]))
        self._begin(places, count)

    def step(self) -> None:
        """One period of control by `actions`; on a GPU without waiting for it."""
        self._turn()

    @property
    def done(self) -> np.ndarray:
        """(W) bool, worlds whose episode is over, on the host."""
        return self._worlds.done.numpy() != 0
