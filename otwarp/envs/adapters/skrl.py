"""A `VectorEnv` as skrl has them: tensors (N, 1) of rewards and ends, cloned on their device."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch
from gymnasium.vector import AutoresetMode
from skrl.envs.wrappers.torch.base import Wrapper

from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError


class SkrlEnv(Wrapper):
    """For agents and trainers of skrl.

    Args:
        envs: With `arrays="torch"` and `autoreset_mode="SameStep"`.
        seed: Of the first reset.

    Raises:
        InputError: They are made otherwise.
    """

    def __init__(self, envs: VectorEnv, seed: int | None = None):
        if envs.unwrapped.arrays != "torch" or envs.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:  # type: ignore[attr-defined]
            raise InputError("environments for SkrlEnv: allowed: arrays='torch', autoreset_mode='SameStep'")
        super().__init__(envs)
        self.envs, self._first = envs, seed
        self._seen: torch.Tensor | None = None

    @property
    def device(self) -> torch.device:
        """Where the environments are."""
        return torch.device(str(self.envs.unwrapped.device))  # type: ignore[attr-defined]

    @property
    def observation_space(self) -> gymnasium.Space:
        """Of one environment."""
        return self.envs.single_observation_space

    @property
    def action_space(self) -> gymnasium.Space:
        """Of one environment."""
        return self.envs.single_action_space

    def reset(self) -> tuple[torch.Tensor, dict[str, Any]]:
        """What is seen first; later, what was seen last: episodes start anew by themselves."""
        seen = self._seen
        if seen is None:
            seen = self._seen = self.envs.reset(seed=self._first)[0].clone()
        return seen, {}

    def step(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, Any]:
        """One period: observations (N, O), rewards, terminated and truncated (N, 1)."""
        given = actions.flatten() if hasattr(self.action_space, "n") else actions
        seen, reward, terminated, truncated, info = self.envs.step(given)
        # skrl keeps what it gets until the next step, which writes on the same memory
        seen = self._seen = seen.clone()
        return seen, reward.clone()[:, None], terminated[:, None].clone(), truncated[:, None].clone(), info

    def state(self) -> torch.Tensor | None:
        """None: observations are all there is."""
        return None

    def render(self, *args: Any, **kwargs: Any) -> Any:
        """What the environments draw."""
        return self.envs.render()

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()
