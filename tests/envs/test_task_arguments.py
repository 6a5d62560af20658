"""Arguments of a task: one line that names the argument, the value and what is allowed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from otwarp.cli.main import main
from otwarp.envs import Env, GroupedEnv, GroupedVectorEnv, Hand, Shift, VectorEnv, from_scene
from otwarp.envs.batch import Batch
from otwarp.errors import InputError
from tests.envs.bead_task import TRAP
from tests.envs.bead_task import task as bead_task

TASK = bead_task()
NAN = float("nan")
PLACE = "allowed: three numbers from -10000 to 10000 µm"


def refused(call, *said):
    with pytest.raises(InputError) as error:
        call()
    message = str(error.value)
    assert all(part in message for part in said) and "\n" not in message, message


@pytest.mark.parametrize(
    ("name", "values", "allowed"),
    [
        ("rate", (1e9, 1e6, 1e-300, 0.099, 10001, NAN, "a", None, True), "allowed: a number from 0.1 to 10000 Hz"),
        ("time_limit", ("a", None, 0.0, 1e6, [1.0]), "allowed: a number from 0.0001 to 100000 s"),
        ("speed_limit", (0, 1e5, None), "allowed: a number from 0.001 to 10000 µm/s"),
        ("goal", ("a", (1, 2), (1e30, 0, 0), (NAN, 0, 0), (1, 2, "x"), 5), PLACE),
        ("goal_half", (None, (1e38, 0, 0), (-1, 0, 0)), "allowed: three numbers from 0 to 10000 µm"),
        ("power", (None, (1, 1), (-1, 2), (0, np.inf), (0, 10_001)), "allowed: two numbers, 0 ≤ low < high ≤ 10000 mW"),
        ("choices", (5, ((NAN, 0),), ((1, 2), (1,)), "ab"), "allowed: rows of finite numbers"),
        ("randomise", (5, None), "allowed: axes of otwarp.studies by name"),
        ("hands", (5, ("left",), Hand(name="a", traps=(TRAP,))), "allowed: a tuple of hands"),
        ("observations", (3, ("x",)), "allowed: a tuple of terms"),
        ("shifts", (1, ("x",)), "allowed: a tuple of shifts"),
        ("scene", (5,), "allowed: a Scene, or the file of one"),
        ("image_follows", ("no",), "allowed: True, False"),
        ("expert", (3,), "allowed: a function that makes a policy"),
    ],
)
def test_arguments_out_of_range_are_told_in_one_line(name, values, allowed):
    for value in values:
        refused(
            lambda value=value: dataclasses.replace(TASK, **{name: value}), f"{name} of task tests/Bead-v0", allowed
        )


@pytest.mark.thorough
def test_hands_and_shifts_are_told_in_one_line():
    refused(lambda: Shift(half=(NAN, 0, 0)), "half of a shift is (nan, 0, 0); allowed: three numbers from 0")
    refused(lambda: Shift(half=(-5, 0, 0)), "half of a shift")
    refused(lambda: Shift(half=(1, 0, 0), middle=(1e9, 0, 0)), "middle of a shift", PLACE)
    refused(lambda: Shift(half=(1, 0, 0), bodies="/World"), "bodies of a shift is '/World'; allowed: a tuple")
    refused(lambda: Hand(name="", traps=(TRAP,)), "name of a hand is ''; allowed: a text")
    two = (Hand(name="a", traps=(TRAP,)), Hand(name="a", traps=("/World/other",)))
    refused(lambda: dataclasses.replace(TASK, hands=two), "has two hands 'a'; allowed: a name for each")
    refused(lambda: VectorEnv(TASK, 2, device="cpu", render_envs=3), "render_envs is 3; allowed: indices from 0 to 1")


def test_what_is_no_task_or_scene_is_told_in_one_line():
    for make in (Env, VectorEnv, Batch, GroupedEnv, GroupedVectorEnv):
        refused(lambda make=make: make("otwarp/Navigate-v0"), "task is 'otwarp/Navigate-v0'; allowed: a Task")
    refused(lambda: from_scene(5), "scene is 5; allowed: a Scene, or the file of one")


def test_numbers_may_be_arrays_and_lists():
    task = dataclasses.replace(
        TASK, goal=np.array([1.0, 2.0, 3.0]), goal_half=[1, 0, 0], rate=np.float32(10), power=[0, 1],
        image_size=[np.int64(8), 4], image_binning=np.int64(2),
    )  # fmt: skip
    assert task.goal == (1.0, 2.0, 3.0) and task.goal_half == (1.0, 0.0, 0.0) and task.rate == 10.0
    assert task.power == (0.0, 1.0) and task.image_size == (8, 4) and task.image_binning == 2


@pytest.mark.parametrize("rate", [pytest.param(0.1, marks=pytest.mark.thorough), 10_000.0])
def test_the_ends_of_the_range_of_rates_work(rate, device):
    envs = VectorEnv(dataclasses.replace(TASK, rate=rate), 2, device=device)
    envs.reset(seed=1)
    assert np.isfinite(envs.step(np.zeros((2, 2), dtype=np.float32))[0]).all()


def test_a_period_of_too_many_time_steps_is_refused(monkeypatch, device):
    monkeypatch.setattr("otwarp.envs.batch.MOST_STEPS", 10)
    slow = dataclasses.replace(TASK, rate=0.1)
    refused(lambda: Batch(slow, device=device), "rate of task tests/Bead-v0 is 0.1", "allowed: from", "10 steps")


@pytest.mark.parametrize("option", ["rate=1e9", "rate=1e-300", "goal=1e30,0,0", "goal_half=-1,0,0"])
def test_the_command_line_refuses_them_too(option, capsys):
    assert main(["envs", "play", "otwarp/Navigate-v0", "--policy", "still", "--option", option]) == 2
    error = capsys.readouterr().err
    assert option.partition("=")[0] in error and "allowed: " in error and error.count("\n") == 1


@pytest.mark.parametrize("axis", [{"values": [4.0]}, {"sobol": {"low": 4, "high": 6, "count": 4}}])
@pytest.mark.parametrize("unit", [3, None, True, b"mW"])
def test_units_of_what_is_randomised_are_texts(axis, unit):
    refused(lambda: dataclasses.replace(TASK, randomise={"trap_power": axis | {"unit": unit}}),
            f"randomise trap_power of task tests/Bead-v0: unit is {unit!r}; allowed: a text such as 'mW'")  # fmt: skip


def test_axes_may_be_tables_which_a_spec_keeps():
    axes = {
        "trap_power": {"values": [4.0, 6.0], "unit": "mW"},
        "/World/robot/sphere.radius": {"values": [2.4, 2.6], "unit": "µm"},
    }
    env = gym.make("otwarp/Navigate-v0", randomise=axes, device="cpu")
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    for seed in range(3):
        np.testing.assert_array_equal(env.reset(seed=seed)[0], again.reset(seed=seed)[0])
    assert again.unwrapped.spec.kwargs["randomise"] == axes
    env.close()
    again.close()
    refused(lambda: dataclasses.replace(TASK, randomise={"trap_power": {"grid": {"from": 1}}}), "randomise trap_power",
            "tests/Bead-v0", "from, to and count")  # fmt: skip
    refused(lambda: dataclasses.replace(TASK, randomise={"trap_power": {"value": 1}}), "allowed: unit and one of")
