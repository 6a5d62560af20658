"""A `VectorEnv` as rsl_rl has them: observations in a TensorDict, ends by the clock told apart."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium.vector import AutoresetMode
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError


class RslRlVecEnv(VecEnv):
    """For runners of rsl_rl: the state is the group `policy`; images are the group `image`, for its convolutions.

    Images are (N, 1, height, width) numbers from 0 to 1.

    Args:
        envs: With `arrays="torch"` and `autoreset_mode="SameStep"`, whose actions are numbers.
        seed: Of the first reset.

    Attributes:
        succeeded: (N) bool, whether the last episode of each environment that is over succeeded.

    Raises:
        InputError: They are made otherwise.
    """

    def __init__(self, envs: VectorEnv, seed: int | None = None):
        base: Any = getattr(envs, "unwrapped", None)
        good = (
            getattr(base, "arrays", None) == "torch"
            and envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
            and not base.task.choices
            and envs.single_action_space.shape != ()
        )
        if not good:
            raise InputError(f"environments for RslRlVecEnv are {envs}; allowed: a VectorEnv with arrays='torch', "
                             "autoreset_mode='SameStep' and actions of numbers")  # fmt: skip
        self.envs, self.cfg = envs, {"task": base.task.name}
        self.num_envs, self.num_actions = envs.num_envs, envs.single_action_space.shape[0]  # type: ignore[index]
        self.max_episode_length = max(1, round(base.task.time_limit * base.task.rate))
        self.device = torch.device(str(base.device))
        self.episode_length_buf = torch.zeros(self.num_envs, dtype=torch.long, device=self.device)
        self.succeeded = torch.zeros(self.num_envs, dtype=torch.bool, device=self.device)
        self._seen = self._groups(envs.reset(seed=seed)[0])

    def _groups(self, seen: Any) -> dict[str, torch.Tensor]:
        """Tensors of the caller's own, by group."""
        named = seen if isinstance(seen, dict) else {"image" if seen.dtype is torch.uint8 else "state": seen}
        groups = {}
        if "state" in named:
            groups["policy"] = named["state"].clone()
        if "image" in named:
            groups["image"] = named["image"].movedim(-1, 1).float() / 255.0
        return groups

    def get_observations(self) -> TensorDict:
        """What is seen now."""
        return TensorDict(self._seen, batch_size=[self.num_envs], device=self.device)

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """One period: observations, rewards (N), ends (N), and which of these the clock made."""
        seen, reward, terminated, truncated, info = self.envs.step(actions)
        over = terminated | truncated
        self._seen = self._groups(seen)
        self.episode_length_buf = torch.where(over, 0, self.episode_length_buf + 1)
        self.succeeded = torch.where(over, info["success"].bool(), self.succeeded)
        extras: dict[str, Any] = {"time_outs": truncated & ~terminated, "log": {}}
        if bool(over.any()):
            extras["log"]["/success"] = self.succeeded[over].float().mean()
        return self.get_observations(), reward.clone(), over.long(), extras
