"""The loop of simulated operators: hands, servo chain, traps, physics and pictures, all on the device.

A servo period is one graph: every operator moves its hands by the force that was last sent, the chain makes of them
commands for the traps and a new force, the physics goes on, and the trials' accounts are kept. Pictures come between,
at the rate of a session's frames.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.operators.chain import ChainBatch
from otwarp.operators.kernels import account, seen
from otwarp.operators.kernels.hand import hand_kernel
from otwarp.operators.kernels.seen import TwinData
from otwarp.operators.kernels.types import NOTHING
from otwarp.operators.people import People, moving_shapes
from otwarp.operators.task import Task
from otwarp.simulation.simulation import Simulation
from otwarp.teleop.operators import HandPlan, LocalScene

FRAME_RATE = 120.0
"""Pictures per second, a session's default [1/s]."""
LONGEST_STEP = 5e-4
"""Longest time step of the physics where none is given [s]."""


class Loop:
    """Simulated operators at a scene, a world each.

    Args:
        task: What they are asked to do.
        persons: (W) structs of `people.persons`.
        seed: Key of all random numbers.
        device: Where; None for the best available.
        time_step: Of the physics [s], at most; the longest that fits into a servo period a whole number of times.
        frame_rate: Pictures per second [1/s].

    Attributes:
        sim: The physics, with a trial of the operator's number in each world.
        people: The operators.
        chain: The servo chains.
        ticks: Servo periods so far.

    Raises:
        InputError: More trapped spheres than a hand can feel, or a frame rate above the servo's.
    """

    def __init__(
        self,
        task: Task,
        persons: np.ndarray,
        *,
        seed: int = 0,
        device: str | None = None,
        time_step: float = LONGEST_STEP,
        frame_rate: float = FRAME_RATE,
    ):
        self.task = task
        self.rate = task.plans[0].config.chain.rate
        if not 1.0 <= frame_rate <= self.rate:
            raise InputError(f"frame rate is {frame_rate!r}; allowed: 1 to the servo's, {self.rate:g} Hz")
        self.frame_rate = frame_rate
        steps = math.ceil(1.0 / (self.rate * time_step) - 1e-9)
        worlds = len(persons)
        self.sim = Simulation(
            task.scene, worlds=worlds, seed=seed, device=device, time_step=1.0 / (self.rate * steps),
            ends=task.ends, threads=1, allow_large_step=True,
        )  # fmt: skip
        self.sim.reset(number=persons["number"])
        model = self.sim.model
        self.people = People(task, model, persons, seed, 1.0 / self.rate)
        local = local_scene(self.sim, task.plans)
        self.chain = ChainBatch(task.plans, local, worlds, device=model.device, traps=len(task.scene.traps))
        gains = np.array([plan.config.force_gain for plan in task.plans])
        given = np.where(persons["feels"][:, None] == NOTHING, 0.0, gains)
        self.chain.force_gain.assign(given)
        self._take_traps()
        self.prepare(local)
        self.operate = hand_kernel(moving_shapes(task) if model.features.obstacles else ())
        self.ticks, self._frames = 0, 0
        self.load()
        self.turn = self.sim.capture(steps, before=self.act, after=self.keep_account)
        self.publish()
        self.chain.arm()

    def load(self) -> None:
        """Compile and load what a graph captures."""
        for kernel in (self.operate, account.command, account.account_for, seen.see):
            wp.load_module(kernel.module, device=self.sim.model.device)

    def _take_traps(self) -> None:
        """Let the traps of hands follow their commands, which differ from world to world, instead of the scene."""
        sim, held = self.sim, self.people.task.hand_of.numpy() >= 0
        start = np.array([trap.position.at(0.0) for trap in self.task.scene.traps])
        follow = np.where(held, sim.control.follow.numpy() & 2, sim.control.follow.numpy())
        sim.control.set(trap_position=start, follow=follow)
        sim.control.widen("trap_position")

    def prepare(self, local: LocalScene) -> None:
        """Make what a picture is taken with, of what the hands can feel: here the chain gets all of it, at once."""
        self.twin = self.twin_of(self.chain)

    def twin_of(self, chain: ChainBatch) -> Any:
        """What these chains get of the state; its spheres in the order of theirs."""
        body = self.sim.model.data.body
        first = body.trapped_start.numpy()
        data = TwinData()
        data.sphere, data.trap, data.power = chain.sphere, chain.trap, chain.power
        device = self.sim.model.device
        owner = np.repeat(np.arange(len(first) - 1), np.diff(first)).astype(np.int32)
        data.body = wp.array(owner, dtype=wp.int32, device=device)
        data.offset = wp.array(body.trapped.numpy()[:, :3], dtype=wp.vec3, device=device)
        return data

    def launch(self, kernel: Any, dim: Any, *inputs: object) -> None:
        """Launch a kernel on the device of the simulation."""
        wp.launch(kernel, dim=dim, inputs=inputs, device=self.sim.model.device)

    def act(self) -> None:
        """One servo period up to the traps."""
        self.move_hands()
        self.chain.step()
        self.command_traps()

    def move_hands(self) -> None:
        """What operators see, feel, plan and do in a servo period."""
        people, chain, sim = self.people, self.chain, self.sim
        self.launch(
            self.operate, sim.model.worlds, sim.model.data, people.task, people.people, people.sight, people.mind,
            people.account, sim.episodes.done, chain.force, chain.hand,
        )  # fmt: skip

    def command_traps(self) -> None:
        """Put the traps where the chain has them."""
        shape = self.sim.model.worlds, len(self.task.scene.traps)
        done, commanded = self.sim.episodes.done, self.chain.commanded
        self.launch(account.command, shape, self.people.task, done, commanded, self.sim.control.data())

    def keep_account(self) -> None:
        """Keep what a servo period did."""
        sim, people, task = self.sim, self.people, self.task
        self.launch(
            account.account_for, sim.model.worlds, sim.model.data, sim.control.data(), sim.state.data(),
            sim.last_readout.data(), people.task, people.mind, task.cell, task.contact_warning, task.distance_warning,
            people.account,
        )  # fmt: skip

    def publish(self) -> None:
        """Take a picture of every world: for the chain, and for the operator's eyes."""
        sim, people = self.sim, self.people
        self.launch(
            seen.see, sim.model.worlds, sim.model.data, sim.control.data(), sim.state.data(), people.task, people.mind,
            sim.episodes.done, self.twin, people.sight,
        )  # fmt: skip
        self.chain.refresh(self.ticks / self.rate)
        self._frames += 1

    def run(self, duration: float) -> None:
        """Go on for so many seconds, to whole servo periods; worlds that are done stand still."""
        last = self.ticks + round(duration * self.rate)
        while self.ticks < last:
            due = math.floor(self._frames * self.rate / self.frame_rate)
            until = min(due, last)
            if until > self.ticks:
                self.turn(until - self.ticks)
                self.ticks = until
            if self.ticks == due:
                self.publish()

    @property
    def running(self) -> int:
        """Worlds in motion."""
        return self.sim.episodes.running


def local_scene(sim: Simulation, plans: Sequence[HandPlan]) -> LocalScene:
    """What the hands can feel of a scene.

    Raises:
        InputError: Not all trapped spheres of the scene.
    """
    local = LocalScene.of(sim.model, [t for plan in plans for t in plan.config.traps])
    spheres = len(sim.model.data.body.trapped)
    if len(local.kinds) != spheres:
        where = sim.scene.file or sim.scene.root
        raise InputError(f"{where}: has {spheres} trapped spheres; allowed: {len(local.kinds)} for simulated operators")
    return local
