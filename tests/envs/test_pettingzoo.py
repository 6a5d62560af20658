"""Hands as agents: what is no action is refused in one line, and the environment stays usable."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo", reason="pip install 'otwarp[pettingzoo]'")

from otwarp.envs import from_scene
from otwarp.envs.pettingzoo import ParallelEnv
from otwarp.errors import InputError

STILL = {"left": np.zeros(3, dtype=np.float32), "right": np.zeros(3, dtype=np.float32)}


@pytest.fixture(scope="module")
def env(device):
    return ParallelEnv(from_scene("scenes/teleop_small.usda", time_limit=0.1), device=device)


def test_what_is_no_task_is_refused():
    for wrong in (None, 3):
        with pytest.raises(InputError, match=f"task is {wrong}; allowed: a Task"):
            ParallelEnv(wrong)


def test_a_step_without_an_episode_is_refused(env):
    for actions in ({}, STILL):
        with pytest.raises(InputError, match=r"allowed: reset\(\) first"):
            env.step(actions)
    env.reset(seed=1)
    env.step(STILL)
    *_, truncated, _ = env.step(STILL)
    assert all(truncated.values()) and not env.agents
    with pytest.raises(InputError, match=r"allowed: reset\(\) first"):
        env.step({})


@pytest.mark.filterwarnings("error")
def test_what_is_no_action_is_refused_by_its_agent(env):
    env.reset(seed=1)
    for right, said in (
        ([0.0, [1.0, 2.0]], "action of right is a list that is no array"),
        (None, "action of right is object"),
        ([0.0, np.nan, 0.0], "action of right is .*nan"),
        ([0.0, np.inf, 0.0], "action of right is .*inf"),
        ([0, 1, 0], "action of right is int64"),
    ):
        with pytest.raises(InputError, match=f"{said}.*; allowed: .*"):
            env.step(STILL | {"right": right})
    for actions in (None, 3, {"left": STILL["left"]}):
        with pytest.raises(InputError, match="allowed: of left, right"):
            env.step(actions)
    seen, *_ = env.step(STILL | {"right": np.array([1e300, 0.0, 0.0])})
    env.reset(seed=1)
    wanted, *_ = env.step(STILL | {"right": np.array([1.0, 0.0, 0.0])})
    np.testing.assert_array_equal(seen["left"], wanted["left"])


def test_arrays_of_an_agent_are_its_own(device):
    task = from_scene("scenes/teleop_small.usda", observation="both", image_size=(8, 8))
    env = ParallelEnv(task, device=device)
    seen, _ = env.reset(seed=1)
    for name, values in seen["left"].items():
        assert np.array_equal(values, seen["right"][name]) and not np.shares_memory(values, seen["right"][name])
