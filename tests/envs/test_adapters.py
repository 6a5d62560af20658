"""Adapters to libraries for learning: what they ask of environments. Training by them is shown by examples."""

from __future__ import annotations

import dataclasses
from importlib import import_module

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="pip install 'otwarp[envs]'")

from otwarp.envs import VectorEnv, task_of
from otwarp.errors import InputError
from tests.envs.bead_task import task as bead_task

SHORT = 0.5
"""After which an episode is cut off [s]: in the tenth period."""


def envs(arrays, device, mode="SameStep"):
    return VectorEnv(
        task_of("otwarp/Navigate-v0", time_limit=SHORT), 3, device=device, arrays=arrays, autoreset_mode=mode
    )


def test_sb3(device):
    pytest.importorskip("stable_baselines3", reason="pip install 'otwarp[learning]'")
    from otwarp.envs.adapters.sb3 import SB3VecEnv

    vec = SB3VecEnv(envs("numpy", device))
    vec.seed(4)
    first = vec.reset()
    still = np.zeros((3, 2), dtype=np.float32)
    for _ in range(9):
        seen, _, over, infos = vec.step(still)
        assert not over.any() and infos == [{}, {}, {}]
    seen, _, over, infos = vec.step(still)
    assert over.all() and all(info["TimeLimit.truncated"] and not info["is_success"] for info in infos)
    # the last of an episode is in its information, what is seen is the first of the next one
    # (columns 0 to 3 say where the robot is, which its trap has held meanwhile)
    assert np.abs(infos[0]["terminal_observation"] - first[0])[:4].max() < 0.05
    assert np.abs(seen[0] - first[0])[:4].max() > 0.05
    vec.seed(4)
    np.testing.assert_array_equal(vec.reset(), first)
    assert vec.get_attr("num_envs") == [3, 3, 3] and vec.env_is_wrapped(object) == [False] * 3
    with pytest.raises(InputError, match="allowed"):
        SB3VecEnv(envs("numpy", device, "NextStep"))
    with pytest.raises(InputError, match="environments for SB3VecEnv are 3; allowed: a VectorEnv with"):
        SB3VecEnv(3)


def test_sb3_with_images_beside_states(device):
    pytest.importorskip("stable_baselines3", reason="pip install 'otwarp[learning]'")
    from otwarp.envs.adapters.sb3 import SB3VecEnv

    task = task_of("otwarp/Navigate-v0", observation="both", image_size=(8, 8), time_limit=0.1)
    vec = SB3VecEnv(VectorEnv(task, 2, device=device, autoreset_mode="SameStep"))
    vec.reset()
    for _ in range(2):
        seen, _, over, infos = vec.step(np.zeros((2, 2), dtype=np.float32))
    last = infos[1]["terminal_observation"]
    assert over.all() and vec.observation_space.contains(last) and set(seen) == {"image", "state"}
    assert not np.array_equal(last["state"], seen["state"][1])


def test_skrl(device):
    torch = pytest.importorskip("torch")
    pytest.importorskip("skrl", reason="pip install 'otwarp[learning]'")
    from otwarp.envs.adapters.skrl import SkrlEnv

    env = SkrlEnv(envs("torch", device), seed=4)
    first, _ = env.reset()
    kept = first.clone()
    for n in range(10):
        seen, reward, terminated, truncated, _ = env.step(torch.zeros(3, 2, device=device))
        assert reward.shape == terminated.shape == (3, 1) and bool(truncated.all()) == (n == 9)
    assert torch.equal(first, kept), "what was given out stays as it was"
    assert torch.equal(env.reset()[0], seen) and env.num_envs == 3 and str(env.device) == device
    with pytest.raises(InputError, match="allowed"):
        SkrlEnv(envs("numpy", device))
    with pytest.raises(InputError, match="environments for SkrlEnv are 3; allowed: a VectorEnv with"):
        SkrlEnv(3)


def test_rsl_rl(device):
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl", reason="pip install 'otwarp[learning]'")
    from otwarp.envs.adapters.rsl_rl import RslRlVecEnv

    env = RslRlVecEnv(envs("torch", device), seed=4)
    assert env.max_episode_length == 10 and env.num_actions == 2
    for n in range(10):
        seen, reward, over, extras = env.step(torch.zeros(3, 2, device=device))
        assert reward.shape == (3,) and bool(over.all()) == (n == 9) == bool(extras["time_outs"].all())
    assert float(extras["log"]["/success"]) == 0.0 and not env.episode_length_buf.any()
    assert torch.equal(seen["policy"], env.get_observations()["policy"])
    with pytest.raises(InputError, match="allowed"):
        RslRlVecEnv(envs("numpy", device))
    with pytest.raises(InputError, match="environments for RslRlVecEnv are 3; allowed: a VectorEnv with"):
        RslRlVecEnv(3)


@pytest.mark.parametrize("name", ["skrl", "rsl_rl"])
def test_who_succeeded_last_is_kept(name, device):
    """A goal where the robots are is reached in the first period, by those whose episodes are not lost before."""
    torch = pytest.importorskip("torch")
    pytest.importorskip(name, reason="pip install 'otwarp[learning]'")
    task = bead_task()
    start = task.load().bodies[0].position
    near = dataclasses.replace(task, goal=start, goal_half=(0.0, 0.0, 0.0), shifts=())
    far = dataclasses.replace(task, time_limit=0.1, shifts=())
    adapter = getattr(import_module(f"otwarp.envs.adapters.{name}"), "SkrlEnv" if name == "skrl" else "RslRlVecEnv")
    for one, wanted, periods in ((near, True, 1), (far, False, 2)):
        env = adapter(VectorEnv(one, 2, device=device, arrays="torch", autoreset_mode="SameStep"), seed=1)
        env.reset() if name == "skrl" else env.get_observations()
        for _ in range(periods):
            assert not env.succeeded.any()
            env.step(torch.zeros(2, 2, device=device))
        assert env.succeeded.tolist() == [wanted] * 2
    kept = env.succeeded
    env.step(torch.zeros(2, 2, device=device))
    assert torch.equal(env.succeeded, kept)


def seeing(kind, device):
    """Environments with images, beside arrays of the same."""
    how = {"observation": kind, "image_size": (12, 8), "image_binning": 1, "time_limit": 0.1}
    task = task_of("otwarp/Navigate-v0", **how)
    return (VectorEnv(task, 2, device=device, arrays=a, autoreset_mode="SameStep") for a in ("torch", "numpy"))


@pytest.mark.parametrize("kind", ["image", "both"])
def test_skrl_has_images_flat(kind, device):
    """As skrl has them of other environments: all spaces in one row of numbers, which its models take apart again."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("skrl", reason="pip install 'otwarp[learning]'")
    from skrl.utils.spaces.torch import compute_space_size, unflatten_tensorized_space

    from otwarp.envs.adapters.skrl import SkrlEnv

    tensors, arrays = seeing(kind, device)
    env, wanted = SkrlEnv(tensors, seed=4), arrays.reset(seed=4)[0]
    first, _ = env.reset()
    kept = first.clone()
    for _ in range(3):  # over an end
        seen, *_ = env.step(torch.zeros(2, 2, device=device))
    assert seen.shape == first.shape == (2, compute_space_size(env.observation_space, occupied_size=True))
    assert seen.dtype is torch.float32 and torch.equal(first, kept)
    apart = unflatten_tensorized_space(env.observation_space, first)
    for name, values in wanted.items() if isinstance(wanted, dict) else [("", wanted)]:
        assert np.array_equal((apart[name] if name else apart).cpu().numpy(), values)


@pytest.mark.parametrize("kind", ["image", "both"])
def test_rsl_rl_has_images_in_a_group(kind, device):
    """Channels first, as its convolutions want them."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl", reason="pip install 'otwarp[learning]'")
    from otwarp.envs.adapters.rsl_rl import RslRlVecEnv

    tensors, arrays = seeing(kind, device)
    env, wanted = RslRlVecEnv(tensors, seed=4), arrays.reset(seed=4)[0]
    first = env.get_observations()
    kept = first.clone()
    for _ in range(3):
        seen, *_ = env.step(torch.zeros(2, 2, device=device))
    image = wanted["image"] if kind == "both" else wanted
    assert seen["image"].shape == (2, 1, 8, 12)
    np.testing.assert_allclose(first["image"][:, 0].cpu().numpy(), image[..., 0] / 255.0, atol=1e-7)
    assert torch.equal(first["image"], kept["image"]) and ("policy" in set(first.keys())) == (kind == "both")
    if kind == "both":
        assert np.array_equal(first["policy"].cpu().numpy(), wanted["state"])
