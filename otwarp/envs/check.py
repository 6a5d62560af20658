"""A checker of vector environments, which Gymnasium does not have: what its interface promises, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Make = Callable[[int, str], Any]
"""`(num_envs, autoreset_mode) -> VectorEnv` that gives arrays of NumPy; the mode is a value of `AutoresetMode`."""

STEPS = 60
NEXT, SAME, OFF = "NextStep", "SameStep", "Disabled"


def check_vector(make: Make, *, num_envs: int = 3, steps: int = STEPS, seed: int = 11) -> list[str]:
    """Check vector environments of all three modes; episodes must end within `steps` of random actions.

    Args:
        make: Makes the environments.
        num_envs: How many are compared with single ones, 2 or more.
        steps: Periods of each check.
        seed: Of environments and actions.

    Returns:
        What was checked, in words.

    Raises:
        AssertionError: What does not hold, in words.
    """
    modes = {mode: make(num_envs, mode) for mode in (NEXT, SAME, OFF)}
    alone = make(1, NEXT)
    actions = _actions(modes[NEXT], num_envs, steps, seed)
    try:
        first = roll(modes[NEXT], actions, seed)
        _claim(first["over"].any(), f"no episode ends within {steps} periods of random actions: nothing to check")
        checks = {
            "modes are declared": lambda: _check_modes(modes),
            "a seed gives the same again, another one does not": lambda: _check_seeding(modes[NEXT], actions, seed),
            "one environment is as each of many": lambda: _check_alone(alone, first, actions, seed),
            "environments do not depend on each other": lambda: _check_apart(modes[NEXT], first, actions, seed),
            "the step after an end starts anew": lambda: _check_next(first),
            "the step of an end starts anew, and has final_obs": lambda: _check_same(
                modes[NEXT], modes[SAME], actions, seed
            ),
            "masks reset those that they name": lambda: _check_masks(modes[OFF], actions, seed),
            "arrays are the caller's own": lambda: _check_copies(modes[NEXT], actions, seed),
        }
        for check in checks.values():
            check()
        return list(checks)
    finally:
        for env in (*modes.values(), alone):
            env.close()


def roll(env: Any, actions: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """What environments give under actions (K, N, …): `seen` (K + 1, N, O), `reward` and `over` (K, N)."""
    seen, _ = env.reset(seed=seed)
    out: dict[str, list[Any]] = {"seen": [seen], "reward": [], "over": []}
    for row in actions:
        seen, reward, terminated, truncated, _ = env.step(row)
        for name, value in (("seen", seen), ("reward", reward), ("over", terminated | truncated)):
            out[name].append(value)
    return {name: np.array(values) for name, values in out.items()}


def _actions(env: Any, count: int, steps: int, seed: int) -> np.ndarray:
    """(K, N, …) random actions, each held for some periods, so that they lead somewhere."""
    space = env.single_action_space
    space.seed(seed)
    held = [[space.sample() for _ in range(count)] for _ in range(-(-steps // 20))]
    return np.repeat(np.array(held), 20, axis=0)[:steps]


def _claim(holds: Any, otherwise: str) -> None:
    if not holds:
        raise AssertionError(otherwise)


def _check_modes(modes: dict[str, Any]) -> None:
    for mode, env in modes.items():
        declared = getattr(env.metadata.get("autoreset_mode"), "value", None)
        _claim(declared == mode, f"metadata['autoreset_mode'] is {declared}, made as {mode}")


def _check_seeding(env: Any, actions: np.ndarray, seed: int) -> None:
    one, again, other = roll(env, actions, seed), roll(env, actions, seed), roll(env, actions, seed + 1000)
    for name, values in one.items():
        _claim(np.array_equal(values, again[name]), f"{name} differs between two runs of seed {seed}")
    _claim(not np.array_equal(one["seen"], other["seen"]), f"seeds {seed} and {seed + 1000} give the same")


def _check_alone(alone: Any, many: dict[str, np.ndarray], actions: np.ndarray, seed: int) -> None:
    for i in range(actions.shape[1]):
        one = roll(alone, actions[:, i : i + 1], seed + i)
        for name, values in one.items():
            same = np.array_equal(values[:, 0], many[name][:, i])
            _claim(same, f"{name} of environment {i} of seed {seed} is not that of one environment of seed {seed + i}")


def _check_apart(env: Any, first: dict[str, np.ndarray], actions: np.ndarray, seed: int) -> None:
    changed = actions.copy()
    changed[:, 0] = actions[::-1, 0]
    after = roll(env, changed, seed)
    for name, values in first.items():
        _claim(np.array_equal(values[:, 1:], after[name][:, 1:]), f"{name} depends on actions of another environment")


def _check_next(first: dict[str, np.ndarray]) -> None:
    ended = np.argwhere(first["over"][:-1])
    for k, i in ended:
        _claim(first["reward"][k + 1, i] == 0.0, f"the reset of environment {i} after step {k} has a reward")
        _claim(not first["over"][k + 1, i], f"the reset of environment {i} after step {k} ends an episode")


def _check_same(following: Any, env: Any, actions: np.ndarray, seed: int) -> None:
    """The mode SAME_STEP beside NEXT_STEP: the same last observation, and the next episode at once."""
    there, _ = following.reset(seed=seed)
    here, _ = env.reset(seed=seed)
    _claim(np.array_equal(here, there), "the modes start differently")
    for k, row in enumerate(actions):
        there, _, *ended, _ = following.step(row)
        here, _, *ended_here, info = env.step(row)
        over = ended[0] | ended[1]
        _claim(np.array_equal(over, ended_here[0] | ended_here[1]), f"the modes end differently in step {k}")
        if not over.any():
            _claim(np.array_equal(here, there), f"the modes differ in step {k}")
            _claim("final_obs" not in info or not np.any(info["_final_obs"]), f"final_obs in step {k}, without an end")
            continue
        _claim(np.array_equal(info["_final_obs"], over), f"_final_obs of step {k} are not the environments that ended")
        for i in np.flatnonzero(over):
            _claim(np.array_equal(info["final_obs"][i], there[i]), f"final_obs of environment {i} in step {k} is wrong")
        for i in np.flatnonzero(~over):
            rest = info["final_obs"][i]
            _claim(rest is None or not np.any(rest), f"final_obs of step {k} shows environment {i}, which goes on")
        after, *_ = following.step(row)
        _claim(np.array_equal(here[over], after[over]), f"environments that ended in step {k} do not start anew in it")
        return


def _check_masks(env: Any, actions: np.ndarray, seed: int) -> None:
    """The mode DISABLED: what has ended is reset by a mask, and nothing else changes."""
    env.reset(seed=seed)
    for k, row in enumerate(actions):
        seen, _, terminated, truncated, _ = env.step(row)
        over = terminated | truncated
        if not over.any():
            continue
        try:
            env.step(row)
        except (ValueError, AssertionError):
            pass
        else:
            raise AssertionError(f"a step is taken after the end of an episode in step {k}")
        after, info = env.reset(options={"reset_mask": over})
        _claim(np.array_equal(after[~over], seen[~over]), "a mask resets environments that it does not name")
        same = np.all((after == seen).reshape(len(after), -1), axis=1)
        _claim(not np.any(same[over]), "a mask leaves environments as they were")
        for name, value in info.items():
            if name.startswith("_"):
                _claim(np.array_equal(value, over), f"{name} of a reset by a mask is not the mask")
        env.step(row)
        return


def _check_copies(env: Any, actions: np.ndarray, seed: int) -> None:
    seen, _ = env.reset(seed=seed)
    kept = seen.copy()
    after, reward, *_ = env.step(actions[0])
    _claim(np.array_equal(seen, kept), "a step overwrites the observations before it")
    kept = after.copy(), reward.copy()
    env.step(actions[0])
    _claim(np.array_equal(after, kept[0]) and np.array_equal(reward, kept[1]), "a step overwrites what came before it")
