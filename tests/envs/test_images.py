"""Observations by the microscope: spaces, where bodies are in them, one environment beside many, bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env

from otwarp.envs import Env, VectorEnv, check_vector
from otwarp.errors import InputError
from otwarp.scene import Scene
from tests.envs.bead_task import BEAD
from tests.envs.bead_task import task as bead_task

PUSH = "otwarp/Push-v0"
SMALL = dataclasses.replace(bead_task(), observation="image", image_size=(16, 12), image_binning=1, time_limit=0.2)
"""The scene of beads has no camera: that is the default one."""


@pytest.mark.parametrize("kind", ["image", "both"])
def test_gymnasium_has_nothing_to_say_about_images(kind, device):
    env = gymnasium.make(PUSH, observation=kind, image_size=(24, 16), image_binning=1, device=device).unwrapped
    check_env(env, skip_render_check=True)
    image = env.observation_space if kind == "image" else env.observation_space["image"]
    assert image.shape == (16, 24, 1) and image.dtype == np.uint8


@pytest.mark.parametrize("kind", ["image", pytest.param("both", marks=pytest.mark.thorough)])
def test_many_with_images_are_as_each_alone_in_all_modes(kind, device):
    task = dataclasses.replace(SMALL, observation=kind)
    checks = check_vector(lambda n, mode: VectorEnv(task, n, device=device, autoreset_mode=mode), steps=5, num_envs=2)
    assert len(checks) > 5


def test_states_beside_images_are_those_without_and_final_ones_come_before_the_start(device):
    both = dataclasses.replace(SMALL, observation="both")
    with_images = VectorEnv(both, 2, device=device, autoreset_mode="SameStep")
    without = VectorEnv(dataclasses.replace(SMALL, observation="state"), 2, device=device, autoreset_mode="SameStep")
    seen, state = with_images.reset(seed=3)[0], without.reset(seed=3)[0]
    action = np.full((2, 2), 0.8, dtype=np.float32)
    for _ in range(9):
        assert np.array_equal(seen["state"], state) and with_images.observation_space.contains(seen)
        seen, *_, over, told = with_images.step(action)
        state, *_, also, wanted = without.step(action)
        assert np.array_equal(over, also) and ("final_obs" in told) == bool(over.any())
        if over.any():
            assert np.array_equal(told["final_obs"]["state"], wanted["final_obs"])
            assert np.any(told["final_obs"]["image"] != seen["image"])


@pytest.mark.parametrize(("kind", "mode"), [("image", "SameStep"), ("both", "NextStep")])
def test_tensors_of_images_are_the_arrays(kind, mode, device):
    torch = pytest.importorskip("torch")
    task = dataclasses.replace(SMALL, observation=kind)
    arrays, tensors = (VectorEnv(task, 2, device=device, arrays=a, autoreset_mode=mode) for a in ("numpy", "torch"))
    seen, also = arrays.reset(seed=3)[0], tensors.reset(seed=3)[0]
    action, ended = np.full((2, 2), 0.8, dtype=np.float32), False
    for _ in range(9):
        _are_alike(also, seen)
        seen, _, terminated, truncated, told = arrays.step(action)
        also, *_, same = tensors.step(torch.as_tensor(action, device=str(tensors.device)))
        if "final_obs" in told:
            _are_alike(same["final_obs"], told["final_obs"])
        ended |= bool(np.any(terminated | truncated))
    assert ended


def _are_alike(tensors, arrays):
    if isinstance(arrays, dict):
        for name in arrays:
            _are_alike(tensors[name], arrays[name])
        return
    assert tensors.dtype.is_floating_point == (arrays.dtype.kind == "f")
    assert np.array_equal(tensors.cpu().numpy(), arrays)


def test_a_world_whose_state_is_no_number_is_black_and_the_others_go_on(device):
    lost, other = (VectorEnv(SMALL, 2, device=device) for _ in range(2))
    still = np.zeros((2, 2), dtype=np.float32)
    for envs in (lost, other):
        envs.reset(seed=3)
    place = lost.batch.sim.state.position.numpy().copy()
    place[1] = np.nan
    lost.batch.sim.state.position.assign(place)
    (seen, _, terminated, *_), (wanted, *_) = lost.step(still), other.step(still)
    assert np.array_equal(terminated, [False, True]) and not seen[1].any() and np.array_equal(seen[0], wanted[0])
    assert lost.step(still)[0][1].any(), "it starts anew"


def middle(image, width):
    """(2) where what is not background lies, from the middle, x to the right and y up [pixels]."""
    unlike = np.abs(image[..., 0].astype(float) - np.median(image))
    unlike[unlike < 0.25 * unlike.max()] = 0.0
    rows, columns = np.indices(unlike.shape)
    where = [np.sum(unlike * index) / unlike.sum() for index in (columns, rows)]
    return np.array([where[0] - width / 2, width / 2 - where[1]])


@pytest.mark.parametrize("follows", [True, False])
def test_bodies_are_where_they_are_in_the_image(follows, device):
    width, binning = 64, 2
    task = dataclasses.replace(
        bead_task(), observation="image", image_size=(width, width), image_binning=binning, image_follows=follows
    )
    env = Env(task, device=device)
    env.reset(seed=5)
    for _ in range(3):
        image = env.step(np.float32([0.9, -0.4]))[0]
    camera = env._images.camera
    place = env.batch.sim.prim_poses()[0][0, 0, :2] - np.array(camera.center)
    assert np.abs(place).max() > 1.0
    wanted = np.zeros(2) if follows else place / (camera.pixel_size * binning)
    # rings of light are cut off at the edge of the image, noise moves the middle: a pixel of the image at most
    assert np.allclose(middle(image, width), wanted, atol=1.0 if follows else 2.0)


def unlike_nothing() -> Scene:
    scene = bead_task().load()
    (bead,) = scene.bodies
    assert bead.name == BEAD
    spheres = [dataclasses.replace(s, refractive_index=scene.medium.refractive_index) for s in bead.spheres]
    return dataclasses.replace(scene, bodies=(dataclasses.replace(bead, spheres=tuple(spheres)),))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Env(dataclasses.replace(SMALL, scene=unlike_nothing())), "no body has another refractive index"),
        (lambda: gymnasium.make(PUSH, observation="pixels"), "is 'pixels'; allowed: state, image, both"),
        (lambda: gymnasium.make(PUSH, image_size=(0, 8)), "image_size of task otwarp/Push-v0 is (0, 8); allowed"),
        (lambda: gymnasium.make(PUSH, image_binning=9), "image_binning of task otwarp/Push-v0 is 9; allowed"),
        (lambda: gymnasium.make("otwarp/CellDeliveryOTGym-v0", observation="image"), "allowed: state, the numbers"),
    ],
)
def test_images_that_cannot_be_are_refused_in_one_line(call, said):
    with pytest.raises(InputError) as error:
        call()
    assert said in str(error.value) and "\n" not in str(error.value)
