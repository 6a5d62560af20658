"""The checker of vector environments: it passes ours, and finds what is wrong."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from otwarp.envs import VectorEnv, check_vector
from otwarp.errors import InputError
from tests.envs.bead_task import task as bead_task

TASK = dataclasses.replace(bead_task(), time_limit=2.0, goal=(-8.0, 0.0, 5.0))
"""Short episodes, some of which reach the goal."""


def navigate(num_envs, mode, device, kind=VectorEnv):
    return kind(TASK, num_envs, device=device, autoreset_mode=mode)


def test_our_environments_are_what_the_interface_promises(device):
    assert len(check_vector(functools.partial(navigate, device=device))) == 7


@pytest.mark.quick
def test_environments_of_others_are_checked_too():
    def pole():
        return gymnasium.make("CartPole-v1", max_episode_steps=15)

    def make(n, mode):
        return SyncVectorEnv([pole] * n, autoreset_mode=AutoresetMode(mode))

    for single in (None, pole):
        assert len(check_vector(make, single=single, steps=20)) == 7


class Broken(VectorEnv):
    """Environments of which something is wrong."""

    ends = 0

    def reset(self, *, seed=None, options=None):
        self.ends = 0 if options is None else self.ends
        return super().reset(seed=seed, options=options)

    def step(self, actions):
        seen, reward, terminated, truncated, info = super().step(actions)
        self.ends += int((terminated | truncated).any())
        return self.spoilt(seen, reward, terminated, truncated, info)

    def spoilt(self, *results):
        return results


class Leaky(Broken):
    def spoilt(self, seen, *rest):
        return np.roll(seen, 1, axis=0), *rest


class Lasting(Broken):
    def spoilt(self, seen, reward, *rest):
        return seen, reward + (self.mode.value == "NextStep"), *rest


class Doubled(Broken):
    def spoilt(self, seen, reward, *rest):
        return seen, reward * (1 + (self.mode.value != "NextStep")), *rest


class Wide(Broken):
    def spoilt(self, seen, *rest):
        return seen.astype(float), *rest


class Swapped(Broken):
    def spoilt(self, seen, reward, terminated, truncated, info):
        return seen, reward, truncated, terminated, info


class Merged(Broken):
    def spoilt(self, seen, reward, terminated, truncated, info):
        return seen, reward, terminated | truncated, truncated & False, info


class Late(Broken):
    """From the second end on the last observations are those of the start."""

    def spoilt(self, seen, *rest):
        if "final_obs" in rest[-1] and self.ends > 1:
            rest[-1]["final_obs"] = rest[-1]["final_obs"] * 0 + seen
        return seen, *rest


class Stuck(Broken):
    """From the second end on nothing starts anew."""

    def spoilt(self, seen, reward, terminated, truncated, info):
        if "final_obs" in info and self.ends > 1:
            seen = np.where((terminated | truncated)[:, None], info["final_obs"], seen)
        return seen, reward, terminated, truncated, info


class Corrupt(Broken):
    def spoilt(self, *results):
        info = results[-1]
        if "final_info" in info:
            info["final_info"] = {name: np.ones_like(value) for name, value in info["final_info"].items()}
        return results


class Alike(Broken):
    def reset(self, *, seed=None, options=None):
        every = self.mode.value == "Disabled" and isinstance(seed, int)
        return super().reset(seed=[seed] * self.num_envs if every else seed, options=options)


class Unseeded(Broken):
    def reset(self, *, seed=None, options=None):
        return super().reset(seed=None if options else seed, options=options)


class Elsewhere(Broken):
    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.single_observation_space = gymnasium.spaces.Box(-1e-3, 1e-3, (99,), np.float32)


QUICK = (Swapped, Doubled, Elsewhere)
WRONG = [
    (Leaky, "NextStep, step 0: the observation of environment 0 is not that of it alone"),
    (Lasting, "NextStep, step 0: reward of environment 0 is"),
    (Doubled, "SameStep, step 0: reward of environment 0 is"),
    (Wide, "NextStep, step 0: the observation"),
    (Swapped, "terminated of environment 1 is False, alone True"),
    (Merged, "terminated of environment 0 is True, alone False"),
    (Late, "final_obs of environment"),
    (Stuck, "SameStep, step .*: the observation"),
    (Corrupt, "final_info: .* of environment"),
    (Alike, "Disabled, first reset: the observation of environment 1"),
    (Unseeded, "reset by a mask: the observation"),
    (Elsewhere, "single_observation_space is Box"),
]


@pytest.mark.parametrize(
    ("kind", "said"), [pytest.param(*w, marks=() if w[0] in QUICK else pytest.mark.thorough) for w in WRONG]
)
def test_what_is_wrong_is_told(kind, said, device):
    with pytest.raises(AssertionError, match=said):
        check_vector(functools.partial(navigate, device=device, kind=kind))


def test_what_cannot_be_checked_is_refused(device):
    with pytest.raises(InputError, match="num_envs is 1; allowed: 2 or more"):
        check_vector(functools.partial(navigate, device=device), num_envs=1)
    with pytest.raises(AssertionError, match="no episode ends within 1 periods"):
        check_vector(functools.partial(navigate, device=device), steps=1)
    pytest.importorskip("torch")
    with pytest.raises(InputError, match="observations are Tensor; allowed: arrays of NumPy"):
        check_vector(lambda n, mode: VectorEnv(TASK, n, device=device, autoreset_mode=mode, arrays="torch"))
