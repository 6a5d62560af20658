"""Hands as agents: a parallel environment of PettingZoo, in which each hand decides its own numbers."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, ClassVar

import numpy as np
from pettingzoo import ParallelEnv as PettingZooParallelEnv

from otwarp.envs.grouped import environment
from otwarp.envs.task import Task, check_task
from otwarp.errors import InputError


class ParallelEnv(PettingZooParallelEnv):
    """One environment of a task whose hands are agents: all see the same, earn the same, and end together.

    Args:
        task: With hands whose names are those of the agents; no choices.
        device: As of `Env`.
        render_mode: As of `Env`.

    Raises:
        InputError: As `Env`; a task with choices, which are of all hands together.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "otwarp", "render_modes": ["rgb_array"], "is_parallelizable": True}

    def __init__(self, task: Task, *, device: str | None = "cpu", render_mode: str | None = None):
        from gymnasium import spaces

        check_task(task)
        if task.choices:
            raise InputError(f"task {task.name} has choices, which are of all hands; allowed: tasks without")
        self.env = environment(task, device=device, render_mode=render_mode)
        self.metadata = {**type(self).metadata, "render_modes": self.env.metadata["render_modes"]}  # type: ignore[misc]
        self.render_mode = render_mode
        self.possible_agents = [hand.name for hand in task.hands]
        self.agents: list[str] = []
        self._columns = dict(zip(self.possible_agents, self.env.layout.of_hand, strict=True))
        sizes = {agent: (len(columns),) for agent, columns in self._columns.items()}
        self.action_spaces = {agent: spaces.Box(-1.0, 1.0, size, np.float32) for agent, size in sizes.items()}
        self.observation_spaces = {agent: self.env.observation_space for agent in self.possible_agents}

    def observation_space(self, agent: str) -> Any:
        """The same of all agents."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """The numbers of its hand."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode; see `Env.reset`. Options mean nothing, as PettingZoo's test wants."""
        seen, info = self.env.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return self._all(seen), {agent: dict(info) for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Any]]:
        """One period of control.

        Raises:
            InputError: Not one action of each agent, or as `Env.step`.
        """
        self.env.refuse_closed()
        if not self.agents:
            raise InputError("step of an episode that is over or has not begun; allowed: reset() first")
        if not isinstance(actions, Mapping) or set(actions) != set(self.agents):
            of = ", ".join(map(str, actions)) or "nobody" if isinstance(actions, Mapping) else repr(actions)
            raise InputError(f"actions of {of}; allowed: of {', '.join(self.agents)}")
        joined = np.zeros(len(self.env.layout.acted), dtype=np.float32)
        for agent, columns in self._columns.items():
            joined[columns] = self._action(agent, actions[agent])
        seen, reward, terminated, truncated, info = self.env.step(joined)
        agents = self.agents
        result = (
            self._all(seen),
            {agent: reward for agent in agents},
            {agent: terminated for agent in agents},
            {agent: truncated for agent in agents},
            {agent: dict(info) for agent in agents},
        )
        if terminated or truncated:
            self.agents = []
        return result

    def _action(self, agent: str, given: Any) -> np.ndarray:
        """The numbers of an agent's hand, within ±1.

        Raises:
            InputError: Another shape or type, or a number that is not finite.
        """
        size = self.action_spaces[agent].shape
        allowed = f"floating-point numbers of shape {size}"
        try:
            values = np.asarray(given)
        except (TypeError, ValueError, RuntimeError):  # ragged lists, tensors elsewhere or with gradients
            said = f"action of {agent} is a {type(given).__name__} that is no array"
            raise InputError(f"{said}; allowed: {allowed}") from None
        if values.shape != size or values.dtype.kind != "f":
            raise InputError(f"action of {agent} is {values.dtype} of shape {values.shape}; allowed: {allowed}")
        if not np.isfinite(values).all():
            raise InputError(f"action of {agent} is {values}; allowed: finite numbers, of which those within ±1 count")
        return values.clip(-1.0, 1.0)

    def _all(self, seen: Any) -> dict[str, Any]:
        return {agent: deepcopy(seen) for agent in self.agents}

    def render(self) -> np.ndarray | None:
        """As `Env.render`."""
        return self.env.render()

    def close(self) -> None:
        """As `Env.close`."""
        self.env.close()
