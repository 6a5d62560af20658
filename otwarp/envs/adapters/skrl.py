"""A `VectorEnv` as skrl has them: tensors (N, 1) of rewards and ends, flat ones of what is seen, on their device."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch
from gymnasium.vector import AutoresetMode
from skrl.envs.wrappers.torch.base import Wrapper
from skrl.utils.spaces.torch import flatten_tensorized_space, tensorize_space

from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError


class SkrlEnv(Wrapper):
    """For agents and trainers of skrl, whose models take images out of what is seen as they do of other environments.

    Args:
        envs: With `arrays="torch"` and `autoreset_mode="SameStep"`.
        seed: Of the first reset.

    Attributes:
        succeeded: (N) bool, whether the last episode of each environment that is over succeeded.

    Raises:
        InputError: They are made otherwise.
    """

    def __init__(self, envs: VectorEnv, seed: int | None = None):
        arrays = getattr(getattr(envs, "unwrapped", None), "arrays", None)
        if arrays != "torch" or envs.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise InputError(f"environments for SkrlEnv are {envs}; "
                             "allowed: a VectorEnv with arrays='torch', autoreset_mode='SameStep'")  # fmt: skip
        super().__init__(envs)
        self.envs, self._first = envs, seed
        self._seen: torch.Tensor | None = None
        self.succeeded = torch.zeros(envs.num_envs, dtype=torch.bool, device=self.device)

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
            seen = self._seen = self._flat(self.envs.reset(seed=self._first)[0])
        return seen, {}

    def _flat(self, seen: Any) -> torch.Tensor:
        """(N, size of the space) numbers; skrl keeps them until the next step, which writes on the memory of `seen`."""
        flat = flatten_tensorized_space(tensorize_space(self.observation_space, seen))
        assert flat is not None
        return flat.to(torch.float32, copy=True)

    def step(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, Any]:
        """One period: observations (N, size of the space), rewards, terminated and truncated (N, 1)."""
        given = actions.flatten() if hasattr(self.action_space, "n") else actions
        seen, reward, terminated, truncated, info = self.envs.step(given)
        self.succeeded = torch.where(terminated | truncated, info["success"].bool(), self.succeeded)
        flat = self._seen = self._flat(seen)
        return flat, reward.clone()[:, None], terminated[:, None].clone(), truncated[:, None].clone(), info

    def state(self) -> torch.Tensor | None:
        """None: observations are all there is."""
        return None

    def render(self, *args: Any, **kwargs: Any) -> Any:
        """What the environments draw."""
        return self.envs.render()

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()
