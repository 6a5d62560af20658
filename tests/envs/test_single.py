"""Environments as Gymnasium and PettingZoo have them: their own checks, names, pictures, policies, bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.env_match import check_environments_match

from otwarp.envs import Env, VectorEnv, from_scene
from otwarp.envs.registration import task_of
from otwarp.envs.rollout import policy_of, run_policy
from otwarp.errors import InputError
from otwarp.scene import Scene
from tests.envs.bead_task import task as bead_task

NAVIGATE = "otwarp/Navigate-v0"
TASK = bead_task()
SHORT = dataclasses.replace(TASK, time_limit=0.2)
TWO_HANDS = "scenes/teleop_small.usda"


@pytest.mark.quick
def test_gymnasium_has_nothing_to_say(device):
    env = gymnasium.make(NAVIGATE, device=device).unwrapped
    check_env(env, skip_render_check=True)
    check_environments_match(env, Env(task_of(NAVIGATE), device=device), 8, skip_rew=False, skip_render=True)
    env.close()


def test_made_by_name_an_environment_is_one_of_many(device):
    one = gymnasium.make(NAVIGATE, time_limit=0.2, device=device)
    many = gymnasium.make_vec(
        NAVIGATE, num_envs=3, vectorization_mode="vector_entry_point", device=device, time_limit=0.2
    )
    first, _ = one.reset(seed=9)
    all_, _ = many.reset(seed=7)
    assert np.array_equal(first, all_[2]) and many.unwrapped.task.time_limit == 0.2
    assert many.metadata["autoreset_mode"].value == "NextStep"


def refused(call, said):
    with pytest.raises(InputError) as error:
        call()
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.quick
def test_bad_actions_are_refused_and_change_nothing(device):
    env, many = Env(SHORT, device=device), VectorEnv(SHORT, 2, device=device, autoreset_mode="Disabled")
    refused(lambda: env.step(np.zeros(2, dtype=np.float32)), "allowed: reset() first")
    refused(lambda: many.step(np.zeros((2, 2), dtype=np.float32)), "allowed: reset() first")
    env.reset(seed=1), many.reset(seed=1)
    good, pair = np.full(2, 0.5, dtype=np.float32), np.full((2, 2), 0.5, dtype=np.float32)
    wanted = env.step(good)[0]
    env.reset(seed=1)
    for bad, said in (
        (np.array([np.nan, 0.0], dtype=np.float32), "action (0, 0) is nan; allowed: finite"),
        (np.zeros(3, dtype=np.float32), "of shape (3,); allowed: floating-point numbers of shape (2,)"),
        (np.zeros(2, dtype=int), "int64 of shape (2,); allowed: floating-point numbers of shape (2,)"),
        ("left", "allowed: floating-point numbers of shape (2,)"),
    ):
        refused(lambda bad=bad: env.step(bad), said)
        refused(lambda bad=bad: many.step(np.stack([bad, bad]) if isinstance(bad, np.ndarray) else bad), "allowed: ")
    huge = env.step(np.array([1e300, -1e300]))[0]
    env.reset(seed=1)
    assert np.array_equal(huge, env.step(np.array([1.0, -1.0]))[0])
    env.reset(seed=1)
    assert np.array_equal(env.step(good)[0], wanted) and np.array_equal(many.step(pair)[0][0], wanted)
    while not (ended := env.step(good))[3]:
        assert not ended[2]
    refused(lambda: env.step(good), "allowed: reset() first")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Env(TASK).reset(seed=-1), "seed is -1; allowed: a whole number from 0 on"),
        (lambda: Env(TASK).reset(options={"where": 1}), "option 'where' of reset is unknown"),
        (lambda: VectorEnv(TASK, 2, device="cpu").reset(seed=[1]), "seed is [1]; allowed"),
        (lambda: VectorEnv(TASK, 2, device="cpu").reset(options={"reset_mask": np.ones(3, dtype=bool)}), "reset_mask"),
        (lambda: VectorEnv(TASK, 0), "num_envs"),
        (lambda: VectorEnv(TASK, 1, arrays="jax"), "arrays is 'jax'; allowed: numpy, torch"),
        (lambda: VectorEnv(TASK, 1, autoreset_mode="never"), "autoreset_mode is 'never'; allowed: NextStep"),
        (lambda: Env(TASK, render_mode="ascii"), "render_mode is 'ascii'; allowed: rgb_array"),
        (lambda: task_of("otwarp/Fly-v0"), "environment 'otwarp/Fly-v0' is unknown"),
        (lambda: task_of(NAVIGATE, gravity=2), f"option 'gravity' of {NAVIGATE} is unknown"),
        (lambda: from_scene("scenes/single_bead.usda"), "has no goal; allowed: a scene with an OtGoalAPI"),
    ],
)
def test_bad_arguments_are_told_in_one_line(call, said):
    refused(call, said)


def test_tensors_are_on_the_memory_of_the_environments(device):
    torch = pytest.importorskip("torch")
    env = VectorEnv(SHORT, 3, device=device, arrays="torch", autoreset_mode="SameStep")
    same = VectorEnv(SHORT, 3, device=device, autoreset_mode="SameStep")
    seen, _ = env.reset(seed=4)
    wanted, _ = same.reset(seed=4)
    assert seen.data_ptr() == env.batch.verdict.seen.ptr
    for _ in range(6):
        action = np.linspace(-1, 1, 6, dtype=np.float32).reshape(3, 2)
        assert np.array_equal(seen.cpu().numpy(), wanted)
        seen, reward, _, truncated, info = env.step(torch.from_numpy(action).to(device))
        wanted, paid, *over, told = same.step(action)
        assert np.array_equal(reward.cpu().numpy(), paid) and np.array_equal(truncated.cpu().numpy(), over[1])
        if over[1].any():
            assert np.array_equal(info["final_obs"].cpu().numpy()[over[1]], told["final_obs"][over[1]])
    refused(lambda: env.step(torch.zeros(3, 2, dtype=torch.int32, device=device)), "allowed: floating-point numbers")
    refused(lambda: env.step(torch.full((3, 2), torch.nan, device=device)), "an action is not finite")


def test_a_scene_with_a_goal_is_an_environment_for_two_hands(device):
    pytest.importorskip("pettingzoo")
    from pettingzoo.test import parallel_api_test

    from otwarp.envs.pettingzoo import ParallelEnv

    task = from_scene(Scene.load(TWO_HANDS), time_limit=0.5)
    env = ParallelEnv(task, device=device)
    parallel_api_test(env, num_cycles=25)
    env.reset(seed=2)
    acted = {"left": np.float32([1, 0, 0]), "right": np.float32([0, -1, 0])}
    seen, reward, *_ = env.step(acted)
    one = Env(task, device=device)
    one.reset(seed=2)
    wanted = one.step(np.float32([1, 0, 0, 0, -1, 0]))
    assert np.array_equal(seen["left"], wanted[0]) and reward["right"] == wanted[1]
    refused(lambda: env.step({"left": acted["left"]}), "actions of left; allowed: of left, right")


def test_pictures_show_what_moves(device):
    env = Env(from_scene(TWO_HANDS), device=device, render_mode="rgb_array")
    env.reset(seed=1)
    before = env.render()
    for _ in range(20):
        env.step(np.float32([0, 1, 0, 0, 1, 0]))
    after = env.render()
    assert before.shape == (360, 480, 3) and before.dtype == np.uint8
    assert 0.001 < np.mean(np.any(before != after, axis=-1)) < 0.5


def test_policies_run_to_the_end_of_their_episodes(device):
    found = run_policy(SHORT, policy_of(SHORT, "random"), episodes=5, worlds=2, seed=3, device=device)
    assert np.array_equal(found.periods, [4] * 5) and not found.success.any() and found.rate == 0.0
    again = run_policy(SHORT, policy_of(SHORT, "still"), episodes=2, device=device)
    assert np.all(np.abs(again.earned) < 0.2)
    refused(lambda: policy_of(SHORT, "best"), "policy is 'best'")
    refused(lambda: run_policy(SHORT, lambda seen, fresh: np.zeros(3), episodes=1, device=device), "policy returned")
