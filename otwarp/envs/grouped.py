"""`GroupedEnv` and `GroupedVectorEnv`: environments whose scenes differ in what a model fixes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import warp as wp
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymnasiumVectorEnv
from gymnasium.vector.utils import batch_space

from otwarp.envs.actions import is_tensor, write_actions
from otwarp.envs.kernels.starts import NEXT_EPISODE
from otwarp.envs.layout import Layout
from otwarp.envs.randomise.groups import group_tasks, scenes_differ
from otwarp.envs.results import Arrays
from otwarp.envs.single import Env, read_seed, refuse_options
from otwarp.envs.task import Task
from otwarp.envs.vector import VectorEnv, drawn, read_mask, read_seeds, refuse_over
from otwarp.errors import InputError
from otwarp.simulation.packing.arguments import whole


class GroupedEnv(gymnasium.Env):
    """One environment, whose episodes each have one of the models of its task, chosen by seed and episode.

    An episode is that of an `Env` of one of `group_tasks(task)`, bit for bit. A model is built when it is first chosen.

    Args:
        task: The task; `randomise` may have attributes of the stage and speeds of paths.
        device: As of `Env`.
        render_mode: `rgb_array`, or None.

    Raises:
        InputError: As `Env`; a window, which shows one scene.
    """

    def __init__(self, task: Task, *, device: str | None = "cpu", render_mode: str | None = None):
        self.task, self.tasks = task, group_tasks(task)
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode is {render_mode!r}, where scenes of {task.name} differ by episode; "
                             "allowed: rgb_array, None, or Env(group_tasks(task)[n], render_mode='human')")  # fmt: skip
        self._how: dict[str, Any] = {"device": device, "render_mode": render_mode}
        self._envs: dict[int, Env] = {}
        self._seed, self._episode = -1, 0
        self.now = self._env(0)
        self.metadata = {**self.now.metadata, "render_modes": ["rgb_array"]}
        self.render_mode = render_mode
        self.observation_space, self.action_space = self.now.observation_space, self.now.action_space
        self._started = self.closed = False

    def _env(self, group: int) -> Env:
        """The environment that has a model."""
        if group not in self._envs:
            env = Env(self.tasks[group], **self._how)
            first = self._envs.get(0, env)
            check_alike(self.task, first.layout, env.layout)
            self._envs[group] = env
        return self._envs[group]

    @property
    def layout(self) -> Layout:
        """What the numbers of observations and actions are."""
        return self.now.layout

    def refuse_closed(self) -> None:
        """Refuse to go on after `close`.

        Raises:
            gymnasium.error.ClosedEnvironmentError: It was closed.
        """
        self.now.refuse_closed()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode, as `Env.reset` does, in the scene that is its own."""
        self.refuse_closed()
        given = read_seed(seed)
        refuse_options(options)  # before a scene is made ready for what is refused
        super().reset(seed=given)
        if given is not None or not self._started:
            first = int(self.np_random.integers(0, 2**32)) if given is None else given
            place = first % 2**32, 0
        else:
            place = self._seed, self._episode + 1
        env = self._env(group_of(*place, len(self.tasks)))
        result = env.reset(seed=(place[0] + place[1] * int(NEXT_EPISODE)) % 2**32)
        self.now, (self._seed, self._episode), self._started = env, place, True
        return result

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One period of control; see `Env.step`."""
        return self.now.step(action)

    def render(self) -> np.ndarray | None:
        """As `Env.render`."""
        return self.now.render()

    def close(self) -> None:
        """End it; may be called more than once."""
        self.closed = True
        for env in self._envs.values():
            env.close()


def group_of(seed: int, episode: int, groups: int) -> int:
    """Which of several models an episode of a `GroupedEnv` has: each as likely as the others."""
    return int(np.random.Generator(np.random.Philox(key=[seed, episode])).integers(groups))


def check_alike(task: Task, one: Layout, other: Layout) -> None:
    """Refuse scenes in which numbers mean something else.

    Raises:
        InputError: Their observations or actions have other names.
    """
    for what in ("seen", "acted"):
        names = [[column.name for column in getattr(layout, what)] for layout in (one, other)]
        if names[0] != names[1]:
            raise InputError(f"randomise of task {task.name} has scenes with other numbers of observations or actions: "
                             f"{len(names[0])} and {len(names[1])}; allowed: the same ones")  # fmt: skip


class GroupedVectorEnv(GymnasiumVectorEnv):
    """N environments, of which environment i has model i mod G of the G of its task, for good.

    Environment i of seed s is an `Env` of `group_tasks(task)[i mod G]` with seed s + i, as `VectorEnv` says it.

    Args:
        task: The task; `randomise` may have attributes of the stage and speeds of paths.
        num_envs: N; below G the last models are not used.
        device, arrays, autoreset_mode, render_mode, render_envs: As of `VectorEnv`; tensors are the caller's own.

    Raises:
        InputError: As `VectorEnv`.
    """

    def __init__(
        self,
        task: Task,
        num_envs: int = 1,
        *,
        device: str | None = None,
        arrays: Arrays = "numpy",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        render_envs: Sequence[int] = (0,),
    ):
        self.envs: list[VectorEnv] = []  # at once: Gymnasium 1.2 closes what was refused, too
        num_envs = whole("num_envs", num_envs, 1)
        self._drawn = drawn(render_envs, num_envs)
        self.task, self.tasks, self.num_envs = task, group_tasks(task), num_envs
        groups = min(len(self.tasks), num_envs)
        how: dict[str, Any] = {"device": device, "arrays": arrays, "autoreset_mode": autoreset_mode}
        self._parts = [slice(g, None, groups) for g in range(groups)]
        for g, part in enumerate(self._parts):
            mine = [n // groups for n in self._drawn if n % groups == g]
            count = len(range(num_envs)[part])
            env = VectorEnv(self.tasks[g], count, render_mode=render_mode, render_envs=mine, **how)
            self.envs.append(env)
            check_alike(task, self.envs[0].layout, env.layout)
        first = self.envs[0]
        self.arrays, self.mode, self.metadata, self.render_mode = arrays, first.mode, first.metadata, render_mode
        self.single_observation_space = first.single_observation_space
        self.single_action_space = first.single_action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._actions = wp.zeros((num_envs, len(self.layout.acted)), dtype=wp.float32, device=self.device)
        self._started = False

    @property
    def layout(self) -> Layout:
        """What the numbers of observations and actions are."""
        return self.envs[0].layout

    @property
    def device(self) -> Any:
        """Where the environments are."""
        return self.envs[0].device

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start environments anew; see `VectorEnv.reset`."""
        self.envs[0].refuse_closed()
        mask, seeds = read_mask(options, self.num_envs), read_seeds(seed, self.num_envs)
        if seed is not None and not isinstance(seed, Sequence) and np.ndim(seed) == 0:
            super().reset(seed=int(seed))
        if not self._started and mask is not None and not mask.all():
            raise InputError("reset_mask leaves environments out that were never reset; allowed: a reset of all first")
        if not self._started:
            fresh = (int(self.np_random.integers(0, 2**32)) + np.arange(self.num_envs, dtype=np.int64)) % 2**32
            seeds = np.where(seeds < 0, fresh, seeds)
        results = []
        for env, part in zip(self.envs, self._parts, strict=True):
            chosen = None if mask is None else mask[part]
            results.append(env.restarted(chosen, seeds[part]))
        self._started = True
        return self._joined([seen for seen, _ in results]), self._joined([info for _, info in results])

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One period of control; see `VectorEnv.step`. Of actions that are refused no environment takes its own."""
        self.envs[0].refuse_closed()
        if not self._started:
            raise InputError("step before the first reset; allowed: reset() first")
        if self.mode is AutoresetMode.DISABLED:
            refuse_over(self._joined([env.batch.done for env in self.envs]))
        write_actions(self.task, actions, self._actions)
        for env, part in zip(self.envs, self._parts, strict=True):
            wp.copy(env.batch.actions, self._actions[part])  # type: ignore[arg-type]
        results = [env.advance() for env in self.envs]
        seen, reward, terminated, truncated, info = (self._joined(list(rows)) for rows in zip(*results, strict=True))
        return seen, reward, terminated, truncated, info

    def _joined(self, rows: list[Any]) -> Any:
        """Arrays of all environments from those of each group; what a group does not have is zero there."""
        given = next(row for row in rows if row is not None)
        if isinstance(given, dict):
            names = dict.fromkeys(name for row in rows for name in row or {})
            return {name: self._joined([None if row is None else row.get(name) for row in rows]) for name in names}
        shape = (self.num_envs, *given.shape[1:])
        out = given.new_zeros(shape) if is_tensor(given) else np.zeros(shape, dtype=given.dtype)
        for row, part in zip(rows, self._parts, strict=True):
            if row is not None:
                out[part] = row
        return out

    def render(self) -> tuple[np.ndarray, ...] | None:
        """(height, width, 3) pictures of `render_envs`; None without a render mode."""
        if self.render_mode is None:
            return None
        pictures = [iter(env.render() or ()) for env in self.envs]
        return tuple(next(pictures[n % len(self.envs)]) for n in self._drawn)

    def close_extras(self, **kwargs: Any) -> None:
        """Close those of each group."""
        for env in self.envs:
            env.close()


def environment(task: Task, **options: Any) -> Any:
    """The environment of a task: an `Env`, or a `GroupedEnv` where its scenes differ."""
    return (GroupedEnv if scenes_differ(task) else Env)(task, **options)


def environments(task: Task, num_envs: int = 1, **options: Any) -> Any:
    """Those of a task: a `VectorEnv`, or a `GroupedVectorEnv` where its scenes differ."""
    return (GroupedVectorEnv if scenes_differ(task) else VectorEnv)(task, num_envs, **options)
