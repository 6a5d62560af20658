"""A checker of vector environments, which Gymnasium does not have: what its interface promises, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.envs.grouped import GroupedVectorEnv
from otwarp.envs.single import Env
from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError
from otwarp.simulation.packing.arguments import whole

Make = Callable[[int, str], Any]
"""`(num_envs, autoreset_mode) -> VectorEnv` that gives arrays of NumPy; the mode is a value of `AutoresetMode`."""

STEPS = 60
NEXT, SAME, OFF = "NextStep", "SameStep", "Disabled"


def check_vector(
    make: Make, *, single: Callable[[], Any] | None = None, num_envs: int = 3, steps: int = STEPS, seed: int = 11
) -> list[str]:
    """Check vector environments of all three modes, step by step, beside single environments under the same actions.

    Args:
        make: Makes the environments.
        single: Makes the single environment of Gymnasium that each of them is to be; or a list of those, of which
            environment i is to be number i modulo how many there are. None for an `Env` of the same task, or of each of
            those of a `GroupedVectorEnv`; of environments that are none of otwarp's, for a vector of one, from which
            `terminated` and `truncated` are not told apart if both confuse them.
        num_envs: How many are compared with single ones, 2 or more.
        steps: Periods of random actions within which an episode must end; about twice as many are checked.
        seed: Of environments and actions.

    Returns:
        What was checked, in words.

    Raises:
        InputError: Too few environments, arrays that are not NumPy's, or a wrapped `GroupedVectorEnv` without `single`.
        AssertionError: What does not hold, in words.
    """
    num_envs, steps, seed = whole("num_envs", num_envs, 2), whole("steps", steps, 1), whole("seed", seed, 0)
    modes = {mode: make(num_envs, mode) for mode in (NEXT, SAME, OFF)}
    ones = {mode: make(1, mode) for mode in modes}
    alone = _singles(modes[OFF], make, single)
    try:
        actions = _actions(modes[NEXT], num_envs, 2 * steps + 2, seed)
        done = []
        for mode, env in modes.items():
            _check_declared(env, mode, alone[0])
            stories = [_story(alone[i % len(alone)], actions[:, i], mode, seed + i) for i in range(num_envs)]
            ended = any(p.over for story in stories for p in story[: steps + 1])
            _claim(ended, f"no episode ends within {steps} periods of random actions: nothing to check")
            _check_mode(env, mode, stories, actions, seed)
            _check_mode(ones[mode], mode, stories[:1], actions[:, :1], seed)
            done.append(f"{mode}: one environment and each of many are as a single one, over all ends of episodes")
        _check_refusal(modes[OFF], actions, seed)
        _check_seeding(modes[NEXT], actions[:steps], seed)
        for mode, env in modes.items():
            _check_copies(env, mode, actions, seed)
        return [
            "modes and spaces are declared",
            *done,
            f"{OFF}: no step is taken after an end",
            "a seed gives the same again, another one does not",
            "arrays are the caller's own",
        ]
    finally:
        for env in (*modes.values(), *ones.values(), *alone):
            env.close()


class _First:
    """A vector environment of one, in the mode DISABLED, as a single environment."""

    def __init__(self, env: Any):
        self.env, self.observation_space = env, env.single_observation_space
        self.close = env.close

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        seen, info = self.env.reset(seed=seed)
        return _row(seen, 0), _told(info, 0)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        seen, reward, terminated, truncated, info = self.env.step(np.array([action]))
        return _row(seen, 0), reward[0], bool(terminated[0]), bool(truncated[0]), _told(info, 0)


def _singles(env: Any, make: Make, single: Callable[[], Any] | None) -> list[Any]:
    """The measure, as given or of the same task: of environment i, number i modulo how many there are."""
    if single is not None:
        made = single()
        return made if isinstance(made, list) else [made]
    if isinstance(env, GroupedVectorEnv):
        return [Env(task, device=str(env.device)) for task in env.tasks]
    if isinstance(getattr(env, "unwrapped", env), GroupedVectorEnv):
        raise InputError("single is None, where scenes of wrapped environments differ; allowed: a function that makes "
                         "a list of single ones, wrapped alike, of each of group_tasks(task)")  # fmt: skip
    return [Env(env.task, device=str(env.device)) if isinstance(env, VectorEnv) else _First(make(1, OFF))]


def _actions(env: Any, count: int, steps: int, seed: int) -> np.ndarray:
    """(K, N, …) random actions, each held for some periods, so that they lead somewhere."""
    space = env.single_action_space
    space.seed(seed)
    held = [[space.sample() for _ in range(count)] for _ in range(-(-steps // 20))]
    return np.repeat(np.array(held), 20, axis=0)[:steps]


@dataclass
class _Period:
    """What a single environment gives in a period, or in a reset.

    Attributes:
        seen, reward, terminated, truncated, info: As `step` returns them; of a reset without reward and end.
        seed: With which the next episode was begun at once, or None.
        start: Observation and information of that beginning; None where it was not.
    """

    seen: Any
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    seed: int | None = None
    start: tuple[Any, dict[str, Any]] | None = None

    @property
    def over(self) -> bool:
        return self.terminated or self.truncated


def _story(env: Any, actions: np.ndarray, mode: str, seed: int) -> list[_Period]:
    """The first reset and the periods of a single environment that starts anew as a mode has it.

    In the mode DISABLED every other episode begins by a seed of its own.
    """
    seen, info = env.reset(seed=seed)
    story, ends = [_Period(seen, 0.0, False, False, info)], 0
    for action in actions:
        if mode == NEXT and story[-1].over:
            seen, info = env.reset()
            story.append(_Period(seen, 0.0, False, False, info))
            continue
        period = _Period(*env.step(action))
        if mode != NEXT and period.over:
            ends += 1
            period.seed = seed + 1000 * ends if mode == OFF and ends % 2 else None
            period.start = env.reset(seed=period.seed)
        story.append(period)
    return story


def _check_declared(env: Any, mode: str, alone: Any) -> None:
    """The mode and the spaces."""
    from gymnasium.vector.utils import batch_space

    declared = getattr(env.metadata.get("autoreset_mode"), "value", None)
    _claim(declared == mode, f"metadata['autoreset_mode'] is {declared}, made as {mode}")
    own = env.single_observation_space
    _claim(own == alone.observation_space, f"single_observation_space is {own}, alone {alone.observation_space}")
    _claim(env.observation_space == batch_space(own, env.num_envs), "observation_space is not that of so many")


def _check_mode(env: Any, mode: str, stories: list[list[_Period]], actions: np.ndarray, seed: int) -> None:
    """Step environments, and hold each to its story."""
    seen, info = env.reset(seed=seed)
    _check_arrays(seen)
    firsts = [story[0] for story in stories]
    _check_seen(env, seen, [p.seen for p in firsts], f"{mode}, first reset")
    _check_told(info, [p.info for p in firsts], f"{mode}, first reset")
    for k, row in enumerate(actions):
        where, periods = f"{mode}, step {k}", [story[k + 1] for story in stories]
        seen, reward, terminated, truncated, info = env.step(row)
        results = {"reward": (reward, "f"), "terminated": (terminated, "b"), "truncated": (truncated, "b")}
        for name, (values, kind) in results.items():
            good = isinstance(values, np.ndarray) and values.dtype.kind == kind and values.shape == (len(periods),)
            _claim(good, f"{where}: {name} is {type(values).__name__} of type {getattr(values, 'dtype', 'none')}")
            for i, period in enumerate(periods):
                wanted = getattr(period, name)
                _claim(values[i] == wanted, f"{where}: {name} of environment {i} is {values[i]}, alone {wanted}")
        over = np.array([p.over for p in periods])
        at_once = [p.start[0] if mode == SAME and p.start else p.seen for p in periods]
        _check_seen(env, seen, at_once, where)
        # of what has ended, the information in the mode SAME_STEP may be that of the start or of the end
        _check_told(info, [None if mode == SAME and p.over else p.info for p in periods], where)
        if mode == SAME:
            _check_final(info, periods, over, where)
        elif mode == OFF and over.any():
            _check_mask(env, periods, over, where)


def _check_final(info: dict[str, Any], periods: list[_Period], over: np.ndarray, where: str) -> None:
    """`final_obs` and `final_info`: of all that have ended, and of nothing else."""
    for name in ("final_obs", "final_info"):
        mask = info.get(f"_{name}", np.zeros(len(over), dtype=bool))
        _claim(np.array_equal(mask, over), f"{where}: _{name} are not the environments that ended")
    if not over.any():
        return
    last = info["final_obs"]
    for i, period in enumerate(periods):
        shown = _row(last, i)
        if period.over:
            _claim(_same(shown, period.seen), f"{where}: final_obs of environment {i} is not what it showed last")
        else:
            _claim(_is_blank(shown), f"{where}: final_obs shows environment {i}, which goes on")
    _check_told(info["final_info"], [p.info if p.over else None for p in periods], f"{where}: final_info")
    for name, mask in info["final_info"].items():
        if name.startswith("_"):
            _claim(not np.any(mask[~over]), f"{where}: {name} of final_info names environments that go on")


def _check_mask(env: Any, periods: list[_Period], over: np.ndarray, where: str) -> None:
    """The mode DISABLED: what has ended is reset by a mask, and nothing else changes."""
    seen, info = env.reset(seed=[p.seed for p in periods], options={"reset_mask": over})
    where = f"{where}, reset by a mask"
    _check_seen(env, seen, [p.start[0] if p.start else p.seen for p in periods], where)
    _check_told(info, [p.start[1] if p.start else None for p in periods], where)
    for name, value in info.items():
        if name.startswith("_"):
            _claim(np.array_equal(value, over), f"{where}: {name} is not the mask")


def _check_refusal(env: Any, actions: np.ndarray, seed: int) -> None:
    """The mode DISABLED: no step after the end of an episode."""
    env.reset(seed=seed)
    for row in actions:
        _, _, terminated, truncated, _ = env.step(row)
        if np.any(terminated | truncated):
            break
    try:
        env.step(actions[0])
    except (ValueError, AssertionError):
        return
    raise AssertionError(f"{OFF}: a step is taken after the end of an episode")


def _check_seeding(env: Any, actions: np.ndarray, seed: int) -> None:
    one, again, other = (
        [env.reset(seed=s)[0], *(env.step(row)[0] for row in actions)] for s in (seed, seed, seed + 1000)
    )
    _claim(all(map(_same, one, again)), f"observations differ between two runs of seed {seed}")
    _claim(not all(map(_same, one, other)), f"seeds {seed} and {seed + 1000} give the same")


def _check_copies(env: Any, mode: str, actions: np.ndarray, seed: int) -> None:
    seen, _ = env.reset(seed=seed)
    kept = deepcopy(seen)
    after, reward, *_ = env.step(actions[0])
    _claim(_same(seen, kept), f"{mode}: a step overwrites the observations before it")
    kept = deepcopy((after, reward))
    env.reset(seed=seed + 1)
    _claim(_same(after, kept[0]) and _same(reward, kept[1]), f"{mode}: a reset overwrites what came before it")


def _check_seen(env: Any, seen: Any, wanted: Sequence[Any], where: str) -> None:
    """Observations: within their space, and each as it is alone, of the same type."""
    for i, one in enumerate(wanted):
        _claim(_same(_row(seen, i), one), f"{where}: the observation of environment {i} is not that of it alone")
    _claim(env.observation_space.contains(seen), f"{where}: observations are not within observation_space")


def _check_told(info: dict[str, Any], wanted: Sequence[dict[str, Any] | None], where: str) -> None:
    """Information: for each environment what it has alone; None for those that are not asked about."""
    for i, one in enumerate(wanted):
        for name, value in (one or {}).items():
            _claim(name in info and np.all(info.get(f"_{name}", [False])[i]), f"{where}: no {name} of environment {i}")
            told = _row(info[name], i)
            _claim(np.array_equal(told, value), f"{where}: {name} of environment {i} is {told}, alone {value}")


def _check_arrays(seen: Any) -> None:
    """Refuse what cannot be compared."""
    for values in seen.values() if isinstance(seen, dict) else (seen,):
        if not isinstance(values, np.ndarray):
            raise InputError(f"observations are {type(values).__name__}; allowed: arrays of NumPy, or these by name")


def _claim(holds: Any, otherwise: str) -> None:
    if not holds:
        raise AssertionError(otherwise)


def _row(values: Any, i: int) -> Any:
    """What is environment `i`'s."""
    return {name: _row(value, i) for name, value in values.items()} if isinstance(values, dict) else values[i]


def _told(info: dict[str, Any], i: int) -> dict[str, Any]:
    """The information of environment `i`."""
    return {name: _row(value, i) for name, value in info.items() if not name.startswith("_")}


def _same(a: Any, b: Any) -> bool:
    """Whether observations are equal, with their types."""
    if isinstance(a, dict) or isinstance(b, dict):
        return (
            isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys() and all(_same(a[n], b[n]) for n in a)
        )
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and np.array_equal(a, b)


def _is_blank(seen: Any) -> bool:
    """Whether an observation is none: None, or zeros."""
    return all(map(_is_blank, seen.values())) if isinstance(seen, dict) else seen is None or not np.any(seen)
