"""Environments as Gymnasium and PettingZoo have them: their own checks, names, pictures, policies, bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.env_match import check_environments_match
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import OrderEnforcing

from otwarp.envs import Env, VectorEnv, from_scene
from otwarp.envs.describe import described
from otwarp.envs.registration import TASKS, task_of
from otwarp.envs.rollout import policy_of, run_policy
from otwarp.envs.vector import read_mode
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


def made(name, device):
    """An environment by its name, within no wrappers but those that give it spaces of its own."""
    env = gymnasium.make(name, device=device, disable_env_checker=True)
    return env.env if isinstance(env, OrderEnforcing) else env


# one of them has spaces of its own, which a wrapper gives it
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version:UserWarning")
@pytest.mark.parametrize("name", [name for name in TASKS if name != NAVIGATE])
def test_gymnasium_has_nothing_to_say_of_any_task_whose_rewards_are_told_apart(name, device):
    """Each weighted reward stands in `info` by the name that the tables have; their sum is the reward."""
    env = made(name, device)
    check_env(env, skip_render_check=True)
    paid = {f"reward/{row['name']}" for row in described(task_of(name))["rewards"]}
    env.reset(seed=3)
    env.action_space.seed(3)
    for _ in range(3):
        _, reward, over, _, info = env.step(env.action_space.sample())
        assert set(info) == paid | {"outcome", "success"}
        parts = [float(info[key]) for key in sorted(paid)]
        # float32 sums of some few terms, in another order
        assert reward == pytest.approx(sum(parts), abs=1e-6 * (1.0 + sum(map(abs, parts))))
        if over:
            break
    env.close()


def test_made_by_name_and_of_its_task_an_environment_is_the_same(device):
    """With powers for actions, and a parameter that differs from episode to episode."""
    name = "otwarp/Hold-v0"
    check_environments_match(made(name, device), Env(task_of(name), device=device), 8, skip_render=True)


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


@pytest.mark.thorough
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
        (np.array([np.nan, 0.0], dtype=np.float32), "action 0 is nan; allowed: finite"),
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
        (lambda: VectorEnv(TASK, 2, device="cpu").reset(seed=np.array(-5)), "seed is -5; allowed"),
        (lambda: VectorEnv(TASK, 2, device="cpu").reset(options={"reset_mask": [[True], [True, False]]}), "reset_mask"),
        (
            lambda: VectorEnv(TASK, 2, device="cpu").reset(options=3),
            "options of reset are 3; allowed: {'reset_mask': …}",
        ),
        (lambda: Env(TASK, device="cpu").reset(options=3), "option 3 of reset is unknown"),
        (lambda: Env(TASK, device="cpu").reset(options=np.array([1, 2])), "of reset is unknown; allowed: none"),
        (lambda: VectorEnv(TASK, 3, device="cpu").reset(seed=b"abc"), "seed is b'abc'; allowed: a whole number"),
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


def test_modes_go_by_their_names_as_well():
    """Gymnasium writes AutoresetMode.NEXT_STEP, whose value is NextStep."""
    for mode in AutoresetMode:
        assert read_mode(mode) is read_mode(mode.value) is read_mode(mode.name) is mode
    for wrong in ("next_step", "", None, 1):
        refused(lambda wrong=wrong: read_mode(wrong), f"autoreset_mode is {wrong!r}; allowed: NextStep, SameStep, Dis")


def test_a_seed_may_be_an_array_of_no_dimension(device):
    for env in (Env(SHORT, device=device), VectorEnv(SHORT, 2, device=device)):
        assert np.array_equal(env.reset(seed=np.array(5))[0], env.reset(seed=5)[0])


def test_one_environment_takes_tensors_of_the_host(device):
    torch = pytest.importorskip("torch")
    env = Env(SHORT, device=device)
    env.reset(seed=1)
    wanted = env.step(np.zeros(2, dtype=np.float32))[0]
    env.reset(seed=1)
    refused(lambda: env.step(torch.zeros(2, device="meta")), "action is on meta; allowed: an array of NumPy")
    refused(lambda: env.step(torch.zeros(3)), "of shape (3,); allowed: floating-point numbers of shape (2,)")
    refused(lambda: env.step(torch.zeros(2).to_sparse()), "of layout sparse_coo; allowed: strided")
    assert np.array_equal(env.step(torch.zeros(2, requires_grad=True))[0], wanted)
    env.reset(seed=1)
    assert np.array_equal(env.step(torch.zeros(2, dtype=torch.bfloat16))[0], wanted)


def test_many_environments_refuse_tensors_of_another_kind(device):
    torch = pytest.importorskip("torch")
    many = VectorEnv(SHORT, 2, device=device)
    many.reset(seed=1)
    still = torch.zeros((2, 2), device=device)
    refused(lambda: many.step(still.to_sparse()), "actions are a tensor of layout sparse_coo; allowed: strided")
    many.step(still.bfloat16())
    chosen = VectorEnv(dataclasses.replace(SHORT, choices=((0.0, 0.0), (1.0, 0.0))), 2, device=device)
    chosen.reset(seed=1)
    refused(lambda: chosen.step(torch.tensor([0j, 1], device=device)), "torch.complex64 of shape (2,); allowed: whole")


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


def test_tensors_that_are_refused_change_nothing(device):
    torch = pytest.importorskip("torch")
    env, untouched = (VectorEnv(SHORT, 2, device=device, arrays="torch") for _ in range(2))
    env.reset(seed=1), untouched.reset(seed=1)
    good = torch.full((2, 2), 0.5, device=device)
    for bad, said in (
        (torch.zeros(2, 2, device="meta"), f"actions are on meta; allowed: {device}, where the environments are"),
        (torch.zeros(2, 3, device=device), "of shape (2, 3); allowed: floating-point numbers of shape (2, 2)"),
        (torch.zeros(2, 2, dtype=torch.int64, device=device), "actions are torch.int64 of shape (2, 2)"),
        (torch.full((2, 2), torch.inf, device=device), "an action is not finite"),
    ):
        refused(lambda bad=bad: env.step(bad), said)
        for found, wanted in zip(env.step(good)[:4], untouched.step(good)[:4], strict=True):
            assert torch.equal(found, wanted)


def test_last_tensors_of_an_episode_are_seen_in_its_last_period_alone(device):
    """The faster reach a goal nearby the sooner, the slow never; of those that go on `final_obs` shows nothing."""
    torch = pytest.importorskip("torch")
    shift = dataclasses.replace(TASK.shifts[0], half=(1.0, 0.5, 0.0))
    near = {"goal": (-7.0, 0.0, 5.0), "goal_half": (0.0, 0.0, 0.0), "shifts": (shift,)}
    n, task = 16, dataclasses.replace(TASK, time_limit=1.0, **near)
    env = VectorEnv(task, n, device=device, arrays="torch", autoreset_mode="SameStep")
    following = VectorEnv(task, n, device=device, autoreset_mode="NextStep")
    env.reset(seed=1), following.reset(seed=1)
    actions = np.column_stack([np.linspace(-0.2, 1.0, n), np.zeros(n)]).astype(np.float32)
    first, periods = np.ones(n, dtype=bool), set()
    for period in range(20):
        _, _, terminated, truncated, info = env.step(torch.from_numpy(actions).to(device))
        there, *_ = following.step(actions)
        over, last = (terminated | truncated).cpu().numpy(), info["final_obs"].cpu().numpy()
        assert np.array_equal(info["_final_obs"].cpu().numpy(), over) and not last[~over].any()
        # after an end the modes are a period apart
        assert last[over].any(axis=1).all() and np.array_equal(last[over & first], there[over & first])
        first &= ~over
        periods |= {period} if over.any() else set()
    assert not first.any() and len(periods) > 2


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


def test_a_robot_that_is_to_reach_the_goal_itself_is_seen_once():
    """The way from it to itself would be 0, its velocity and gap those of the cell again."""
    names = [term.name for term in from_scene("scenes/navigate.usda").observations]
    assert names == ["goal_offset", "cell_velocity", "cell_gap", "left_trap_offset"]
    assert "robot_offset" in [term.name for term in from_scene("scenes/push.usda").observations]


def test_robots_of_the_same_name_in_different_places_are_told_apart():
    """Scenes are often made of two references to one robot: /World/left/robot and /World/right/robot."""
    scene = Scene.load(TWO_HANDS)
    assert scene.goal is not None
    for robots, names in (
        (("/World/left/robot", "/World/right/robot"), ("left_robot", "right_robot")),
        (("/World/cell/cell", "/World/b"), ("cell_cell", "World_b")),
        (("/cell", "/World/a"), ("robot_1", "robot_2")),
    ):
        goal = dataclasses.replace(scene.goal, robots=robots)
        seen = [term.name for term in from_scene(dataclasses.replace(scene, goal=goal)).observations]
        assert [name for name in seen if name.endswith("_offset")][1:3] == [f"{name}_offset" for name in names]


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
    still = policy_of(SHORT, "still")
    for wrong in ({"episodes": 0}, {"episodes": 2.5}, {"worlds": 0}, {"seed": -1}):
        refused(lambda wrong=wrong: run_policy(SHORT, still, device=device, **wrong), f"{next(iter(wrong))} is")
