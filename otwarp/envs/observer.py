"""What a learner of a task would see of worlds that something else steps: a loop of operators, a user's simulation."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.envs.layout import Layout
from otwarp.envs.places import episode_data, place_data
from otwarp.envs.task import Task
from otwarp.errors import InputError
from otwarp.simulation.simulation import Simulation


class Observer:
    """Looks at W worlds once a period of a task's control, from their start on.

    Args:
        task: Whose observations they are; its scene's bodies, traps and obstacles must be among the simulation's.
        sim: What is stepped; never changed here.

    Attributes:
        layout: What the numbers are.
        period: Looks so far.

    Raises:
        InputError: The simulation lacks what the task observes, or the task has no goal.
    """

    def __init__(self, task: Task, sim: Simulation):
        self.sim, self.layout, self.period = sim, Layout(task, sim.scene), 0
        model = sim.model
        goal = task.goal or (sim.scene.goal.position if sim.scene.goal else None)
        if goal is None:
            raise InputError(f"task {task.name} has no goal here; allowed: a scene with one")
        self._place, self._meshes = place_data(self.layout, model)
        self._episode, self._numbers = episode_data(self.layout, model), self.layout.numbers(model.device)
        self._episode.goal.assign(np.tile(np.asarray(goal, dtype=np.float32), (model.worlds, 1)))
        self._seen = wp.zeros((model.worlds, len(self.layout.seen)), dtype=wp.float32, device=model.device)
        self._kernel = self.layout.observe_kernel()

    def look(self) -> np.ndarray:
        """(W, O) float32: what is seen now, scaled as an environment has it; the next look is a period later."""
        sim, episode = self.sim, self._episode
        position, control = sim.state.position, sim.control
        for kept, now in ((episode.focus, control.trap_position), (episode.power, control.trap_power)):
            kept.assign(np.broadcast_to(now.numpy(), (*kept.shape, *now.numpy().shape[2:])))
        if self.period == 0:
            wp.copy(episode.start, position)
            wp.copy(episode.before, position)
        wp.launch(
            self._kernel, dim=sim.model.worlds, device=sim.model.device,
            inputs=[sim.state.data(), sim.last_readout.data(), self._place, self._numbers, self.period, episode,
                    self._seen],
        )  # fmt: skip
        wp.copy(episode.before, position)
        if episode.turned.shape[1]:
            wp.copy(episode.turned, sim.state.orientation)
        self.period += 1
        return self._seen.numpy().copy()
