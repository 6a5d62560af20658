"""A `VectorEnv` as Stable-Baselines3 has them: arrays of NumPy, a list of dictionaries, new episodes at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError


class SB3VecEnv(VecEnv):
    """For algorithms of Stable-Baselines3.

    Args:
        envs: With `arrays="numpy"` and `autoreset_mode="SameStep"`.

    Raises:
        InputError: They are made otherwise.
    """

    def __init__(self, envs: VectorEnv):
        arrays = getattr(getattr(envs, "unwrapped", None), "arrays", None)
        if arrays != "numpy" or envs.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise InputError(f"environments for SB3VecEnv are {envs}; "
                             "allowed: a VectorEnv with arrays='numpy', autoreset_mode='SameStep'")  # fmt: skip
        self.envs = envs
        self._actions: np.ndarray | None = None
        self._first: int | None = None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Any:
        """What is seen first, (N, O), or arrays by name; with the seed of `seed`, once."""
        observations, _ = self.envs.reset(seed=self._first)
        self.reset_infos, self._first = [{} for _ in range(self.num_envs)], None
        return observations

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Choose the seed of environment 0 at the next reset; those of the others follow it."""
        self._first = seed
        return [None if seed is None else seed + n for n in range(self.num_envs)]

    def step_async(self, actions: np.ndarray) -> None:
        """Remember actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Observations, rewards, ends and information of a period."""
        assert self._actions is not None, "step_async first"
        observations, rewards, terminated, truncated, info = self.envs.step(self._actions)
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for n in np.flatnonzero(over):
            infos[n] = {
                "terminal_observation": _of(info["final_obs"], n),
                "TimeLimit.truncated": bool(truncated[n] and not terminated[n]),
                "is_success": bool(info["success"][n]),
            }
        return observations, rewards, over, infos

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environments, which they have in common."""
        return [getattr(self.envs, attr_name)] * len(list(self._indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: environments share one simulation."""
        raise InputError(
            f"attribute {attr_name} cannot be set; allowed: options of the environments when they are made"
        )

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Refused: environments have no methods of their own."""
        raise InputError(f"method {method_name} cannot be called; allowed: those of the vector environment, `envs`")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """False for each."""
        return [False] * len(list(self._indices(indices)))

    def _indices(self, indices: Any) -> Sequence[int]:
        if indices is None:
            return range(self.num_envs)
        return [indices] if isinstance(indices, int) else indices


def _of(seen: Any, n: Any) -> Any:
    """What environment `n` shows, an array or arrays by name."""
    return {name: values[n] for name, values in seen.items()} if isinstance(seen, dict) else seen[n]
