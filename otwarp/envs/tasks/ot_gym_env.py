"""`CellDeliveryOTGym` as environments: `Env` and `VectorEnv` with the spaces that `strides` makes of theirs."""

from __future__ import annotations

from copy import copy
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from otwarp.envs.experts.strides import CHOICES, Strides
from otwarp.envs.single import Env
from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError


class OTGym(gymnasium.Wrapper):
    """One environment with the spaces of OT-Gym.

    Args:
        env: Of the task of `otwarp.envs.tasks.ot_gym`.
    """

    def __init__(self, env: Env):
        super().__init__(env)
        self._strides = Strides(_scale(env), 1)
        self.observation_space, self.action_space = self._strides.spaces()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; see `Env.reset`."""
        columns, info = self.env.reset(seed=seed, options=options)
        self._strides.restart(np.array([True]))
        return self._strides.seen(columns[None])[0], info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One stride.

        Raises:
            InputError: No whole number from 0 to 9, or as `Env.step`.
        """
        stride, ahead = _given(action, ()), copy(self._strides)
        columns, *rest = self.env.step(ahead.velocities(stride[None])[0])
        self._strides = ahead  # a step that was refused leaves it where it was
        return (self._strides.seen(columns[None])[0], *rest)  # type: ignore[return-value]


class OTGymVector(VectorWrapper):
    """Many of them.

    Args:
        envs: Of the same task, with arrays of NumPy or torch.
    """

    def __init__(self, envs: VectorEnv):
        super().__init__(envs)
        self._strides = Strides(_scale(envs), envs.num_envs)
        self._over = np.zeros(envs.num_envs, dtype=bool)
        self.single_observation_space, self.single_action_space = self._strides.spaces()
        self.observation_space = batch_space(self.single_observation_space, envs.num_envs)
        self.action_space = batch_space(self.single_action_space, envs.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start environments anew; see `VectorEnv.reset`."""
        columns, info = self.env.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        chosen = np.ones(self.num_envs, dtype=bool) if mask is None else _host(mask)
        self._strides.restart(chosen)
        self._over[chosen] = False
        return self._like(self._strides.seen(_host(columns)), columns), info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One stride of each.

        Raises:
            InputError: No whole numbers from 0 to 9, or as `VectorEnv.step`.
        """
        strides, mode = _given(actions, (self.num_envs,)), self.env.mode  # type: ignore[attr-defined]
        ahead = copy(self._strides)
        # what ended in the step before starts anew in this one, whatever is asked of it
        if mode is AutoresetMode.NEXT_STEP:
            ahead.restart(self._over)
            strides = np.where(self._over, 0, strides)
        velocities = self._like(ahead.velocities(strides), actions)
        columns, reward, terminated, truncated, info = self.env.step(velocities)
        self._strides = ahead  # a step that was refused leaves them where they were
        self._over = _host(terminated) | _host(truncated)
        if mode is AutoresetMode.SAME_STEP:
            if "final_obs" in info:
                last = self._strides.seen(_host(info["final_obs"]))
                info["final_obs"] = self._like(np.where(self._over[:, None], last, 0.0).astype(np.float32), columns)
            self._strides.restart(self._over)
        return self._like(self._strides.seen(_host(columns)), columns), reward, terminated, truncated, info

    @staticmethod
    def _like(values: np.ndarray, other: Any) -> Any:
        """An array, as a tensor where the other one is."""
        if not hasattr(other, "device") or isinstance(other, np.ndarray):
            return values
        import torch

        return torch.as_tensor(values, device=other.device)


def _host(values: Any) -> np.ndarray:
    """An array of NumPy."""
    return values.cpu().numpy() if hasattr(values, "cpu") else np.asarray(values)


def _scale(env: Any) -> np.ndarray:
    return np.array([column.scale for column in env.unwrapped.layout.seen])


def _given(strides: Any, wanted: tuple[int, ...]) -> np.ndarray:
    """Choices on the host.

    Raises:
        InputError: They are no choice of each environment.
    """
    allowed = f"whole numbers of shape {wanted}" if wanted else "one whole number"
    try:
        found = _host(strides)
    except (TypeError, ValueError, RuntimeError):  # ragged lists, tensors without memory
        raise InputError(f"action is a {type(strides).__name__} that is no array; allowed: {allowed}") from None
    if found.shape != wanted or found.dtype.kind not in "iu":
        raise InputError(f"action is {found.dtype} of shape {found.shape}; allowed: {allowed}")
    outside = (found < 0) | (found >= CHOICES)
    if np.any(outside):
        raise InputError(f"an action is {found[outside].flat[0]}; allowed: 0 to {CHOICES - 1}")
    return found
