"""The spaces of OT-Gym: what Gymnasium asks of environments, strides, and one environment beside many."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="pip install 'otwarp[envs]'")

import gymnasium

from otwarp.envs.registration import task_of
from otwarp.errors import InputError

NAME = "otwarp/CellDeliveryOTGym-v0"


def many(count, device, **options):
    return gymnasium.make_vec(NAME, num_envs=count, vectorization_mode="vector_entry_point", device=device, **options)


def test_one_environment_is_one_of_many(device):
    one, envs = gymnasium.make(NAME, device=device), many(3, device, autoreset_mode="SameStep")
    assert one.action_space.n == 10 and one.observation_space.shape == (5,)
    seen, _ = envs.reset(seed=7)
    alone, _ = one.reset(seed=8)
    for stride in (3, 9, 0, 5):
        np.testing.assert_array_equal(alone, seen[1])
        alone, reward, *_ = one.step(stride)
        seen, rewards, *_ = envs.step(np.full(3, stride))
        assert reward == pytest.approx(float(rewards[1]), abs=1e-6)
    assert one.observation_space.contains(alone)
    assert alone[1] == pytest.approx(5 / 9)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_an_episode_that_ends_starts_at_the_beginning_of_the_path(mode, device):
    envs = many(2, device, autoreset_mode=mode)
    envs.reset(seed=1)
    for _ in range(80):
        seen, _, terminated, _, info = envs.step(np.array([9, 0]))
        if terminated[0]:
            break
    assert terminated[0] and not terminated[1]
    if mode == "SameStep":
        assert info["final_obs"][0, 0] > 0.1 and not info["final_obs"][1].any()
    else:
        assert seen[0, 0] > 0.1
        seen, *_ = envs.step(np.array([9, 0]))
    assert seen[0, 0] == 0.0 and seen[0, 1] == 0.0


@pytest.mark.parametrize("actions", [np.array([1, 10]), np.array([1.0, 2.0]), np.array([1]), np.array([-1, 0])])
def test_what_is_no_stride_is_refused(actions, device):
    envs = many(2, device)
    envs.reset(seed=1)
    with pytest.raises(InputError, match="allowed"):
        envs.step(actions)
    envs.step(np.array([1, 9]))


def test_of_one_environment_bad_strides_are_told_as_they_were_given(device):
    one = gymnasium.make(NAME, device=device, disable_env_checker=True)
    one.reset(seed=1)
    with pytest.raises(InputError, match=r"an action is 99; allowed: 0 to 9"):
        one.env.step(99)
    with pytest.raises(InputError, match=r"shape \(9,\); allowed: one whole number"):
        one.env.step(np.arange(9))


def test_what_was_closed_goes_on_no_more(device):
    for env, action in ((gymnasium.make(NAME, device=device), 1), (many(2, device), np.array([1, 1]))):
        env.reset(seed=1)
        env.close()
        env.close()
        for again in (env.reset, lambda env=env, action=action: env.step(action)):
            with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="was closed"):
                again()


def test_a_refused_step_changes_nothing(device):
    """Episodes of two environments, of which one is over: others do not go on where the step was refused."""

    def found(refused):
        envs = many(2, device, autoreset_mode="Disabled", time_limit=0.6)
        envs.reset(seed=1)
        envs.step(np.array([6, 6]))
        envs.reset(options={"reset_mask": np.array([False, True])})
        for _ in range(2):
            over = envs.step(np.array([6, 6]))[3]
        assert over.tolist() == [True, False]
        for _ in range(refused):
            with pytest.raises(InputError, match="whose episode is over"):
                envs.step(np.array([6, 9]))
        seen, _ = envs.reset(options={"reset_mask": np.array([True, False])})
        return seen[1], envs.step(np.array([0, 6]))[0][1]

    np.testing.assert_array_equal(found(0), found(5))


@pytest.mark.quick
@pytest.mark.parametrize(
    "option", [{"rate": 20.0}, {"speed_limit": 5.0}, {"action": "both"}, {"choices": ((0.0,) * 4,)}]
)
def test_options_that_its_strides_do_not_allow_are_refused(option):
    name = next(iter(option))
    with pytest.raises(InputError, match=f"^{name} of {NAME} is .*; allowed: "):
        task_of(NAME, **option)
    assert task_of(NAME, rate=5, time_limit=3.0).time_limit == 3.0


def test_what_is_no_array_is_refused(device):
    torch = pytest.importorskip("torch")
    envs = many(2, device)
    envs.reset(seed=1)
    for actions in ([1, [2, 3]], torch.zeros(2, dtype=torch.int64, device="meta"), None):
        with pytest.raises(InputError, match=r"^action is .*; allowed: whole numbers of shape \(2,\)$"):
            envs.step(actions)
    envs.step(torch.ones(2, dtype=torch.int64, device=device))
