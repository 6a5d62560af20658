"""Episodes of a policy in many environments: how often it succeeds, what it earns, and pictures of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from otwarp.envs.actions import read_action
from otwarp.envs.batch import Batch
from otwarp.envs.randomise.groups import group_tasks
from otwarp.envs.results import information
from otwarp.envs.task import Policy, Task
from otwarp.errors import InputError
from otwarp.simulation.packing.arguments import whole

POLICIES = ("random", "expert", "still")


@dataclass(frozen=True)
class Rollout:
    """What a policy has done.

    Attributes:
        success: (E) bool, episodes that came to what was wanted.
        outcome: (E) int, why they ended: n for the n-th end, counted from 1, -1 for a fault, 0 for out of time.
        earned: (E) float, sums of rewards.
        periods: (E) int, how long they took.
    """

    success: np.ndarray
    outcome: np.ndarray
    earned: np.ndarray
    periods: np.ndarray

    @property
    def rate(self) -> float:
        """Share of episodes that succeeded."""
        return float(np.mean(self.success)) if len(self.success) else float("nan")


@dataclass
class _Account:
    """What is kept of the episodes so far."""

    rows: dict[str, list[Any]] = field(default_factory=lambda: {n: [] for n in ("success", "outcome", "earned", "n")})


def policy_of(task: Task, name: str, *, seed: int = 0) -> Policy:
    """A policy by name: random numbers within ±1, the task's own script, or zeros.

    Raises:
        InputError: None of that name, or a task without a script.
    """
    if name == "expert":
        if task.expert is None:
            raise InputError(f"task {task.name} has no scripted expert; allowed: random, still")
        return _scripted(task, task.expert())
    width = len(task.choices[0]) if task.choices else None
    if name == "random":
        draws = np.random.Generator(np.random.Philox(seed))

        def policy(seen: Any, fresh: np.ndarray) -> np.ndarray:
            """Uniform numbers, or rows of the choices."""
            if width is not None:
                return np.array(task.choices)[draws.integers(0, len(task.choices), len(fresh))]
            return draws.uniform(-1.0, 1.0, (len(fresh), numbers_of(task)))

        return policy
    if name == "still":
        return lambda seen, fresh: np.zeros((len(fresh), numbers_of(task)))
    raise InputError(f"policy is {name!r}; allowed: {', '.join(POLICIES)}")


def _scripted(task: Task, script: Policy) -> Policy:
    """The script of a task, held to the numbers that its actions have."""
    wanted = numbers_of(task)

    def policy(seen: Any, fresh: np.ndarray) -> np.ndarray:
        """What the script does.

        Raises:
            InputError: Its actions have other numbers, as options may have changed those of the task.
        """
        acted = np.asarray(script(seen, fresh))
        if acted.ndim == 2 and acted.shape[1] != wanted:
            raise InputError(f"expert of {task.name} acts by {acted.shape[1]} numbers, an action has {wanted} here; "
                             "allowed: the task's own actions, no option that changes them")  # fmt: skip
        return acted

    return policy


def numbers_of(task: Task) -> int:
    """How many numbers an action has."""
    from otwarp.envs.layout import Layout

    return len(Layout(task, task.load()).acted)


def run_policy(
    task: Task,
    policy: Policy,
    *,
    episodes: int = 100,
    worlds: int | None = None,
    seed: int = 0,
    device: str | None = None,
    watch: Callable[[Batch], None] | None = None,
) -> Rollout:
    """Run a policy for the first episodes of as many environments, so that short ones do not count more often.

    Args:
        task: The task.
        policy: `(seen, fresh) -> (N, A)`, see `Policy`.
        episodes: How many, one in each environment.
        worlds: Environments at a time; None for all.
        seed: Of the first environment.
        device: Where; None for the best available.
        watch: Called with the batch at the start and after each period.

    Environment i has model i mod G, where the scenes of a task differ, as in a `GroupedVectorEnv`; these run one after
    the other.

    Raises:
        InputError: The task cannot be, a number that is none, or the policy returns something else.
    """
    if not callable(policy):
        raise InputError(f"policy is {policy!r}; allowed: a function (seen, fresh) -> actions, as policy_of gives it")
    tasks, episodes, seed = group_tasks(task), whole("episodes", episodes, 1), whole("seed", seed, 0)
    together = episodes if worlds is None else whole("worlds", worlds, 1)
    found: dict[str, np.ndarray] = {}
    for g, one in enumerate(tasks[:episodes]):
        numbers = np.arange(g, episodes, len(tasks))
        count = min(together, len(numbers))
        batch, account = Batch(one, count, device=device, autoreset="off"), _Account()
        for first in range(0, len(numbers), count):
            # the last block is filled up with environments that do not count
            some = numbers[first : first + count]
            which = some[0] + np.arange(count) * len(tasks)
            _run_block(batch, policy, len(some), which, seed, account, watch)
        for name, parts in account.rows.items():
            rows = np.concatenate(parts)
            found.setdefault(name, np.empty(episodes, dtype=rows.dtype))[numbers] = rows
    return Rollout(found["success"], found["outcome"], found["earned"], found["n"])


def _run_block(
    batch: Batch,
    policy: Policy,
    wanted: int,
    which: np.ndarray,
    seed: int,
    account: _Account,
    watch: Callable[[Batch], None] | None,
) -> None:
    """An episode of each world, of which the first `wanted` count; `which` environments they are, by which seeds go."""
    w, columns, out = batch.worlds, batch.layout.seen, batch.verdict
    batch.restart(seeds=(seed + which) % 2**32)
    scale = np.array([c.scale for c in columns])
    earned, periods = np.zeros(w), np.zeros(w, dtype=int)
    success, outcome, running = np.zeros(w, dtype=bool), np.zeros(w, dtype=int), np.ones(w, dtype=bool)
    fresh = np.ones(w, dtype=bool)
    if watch is not None:
        watch(batch)
    while running[:wanted].any():
        seen = out.seen.numpy() * scale
        batch.actions.assign(_acted(batch, policy({c.name: seen[:, n] for n, c in enumerate(columns)}, fresh), which))
        batch.step()
        info = information(batch, lambda array: array.numpy())
        # a world that stands still is judged again: its first end counts
        ended = running & (out.terminated.numpy() | out.truncated.numpy())
        earned[running] += out.reward.numpy()[running]
        periods[running] += 1
        success[ended], outcome[ended] = info["success"][ended], info["outcome"][ended]
        running &= ~ended
        fresh = np.zeros(w, dtype=bool)
        if watch is not None:
            watch(batch)
    for name, row in (("success", success), ("outcome", outcome), ("earned", earned), ("n", periods)):
        account.rows[name].append(row[:wanted])


def _acted(batch: Batch, given: Any, which: np.ndarray) -> np.ndarray:
    """(N, A) float32 within ±1, what a policy returned.

    Raises:
        InputError: It is something else; of a number that is not finite, whose it is.
    """
    acted = read_action(given)
    if acted.dtype.kind not in "iuf" or acted.shape != batch.actions.shape:
        kind = type(given).__name__ if acted.dtype.kind == "O" else f"{acted.dtype} of shape {acted.shape}"
        raise InputError(f"policy returned {kind}; allowed: numbers of shape {tuple(batch.actions.shape)}")
    bad = np.argwhere(~np.isfinite(acted))
    if len(bad):
        row, n = bad[0]
        name = batch.layout.acted[n].name
        raise InputError(f"policy returned {acted[row, n]} for {name}, number {n} of the action of environment "
                         f"{which[row]}; allowed: finite numbers, of which those within ±1 count")  # fmt: skip
    return acted.clip(-1.0, 1.0).astype(np.float32)  # as the device does; float32 holds no 1e300
