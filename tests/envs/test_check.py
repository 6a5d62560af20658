"""The checker of vector environments: it passes ours, and finds what is wrong."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp.envs import VectorEnv, check_vector
from tests.envs.bead_task import task as bead_task

TASK = dataclasses.replace(bead_task(), time_limit=2.0, goal=(-8.0, 0.0, 5.0))
"""Short episodes, some of which reach the goal."""


def navigate(num_envs, mode, device, kind=VectorEnv):
    return kind(TASK, num_envs, device=device, autoreset_mode=mode)


def test_our_environments_are_what_the_interface_promises(device):
    assert len(check_vector(functools.partial(navigate, device=device))) == 8


class Leaky(VectorEnv):
    """Environments that show one another's observations."""

    def step(self, actions):
        seen, *rest = super().step(actions)
        return np.roll(seen, 1, axis=0), *rest


class Lasting(VectorEnv):
    """Environments that pay for a reset."""

    def step(self, actions):
        seen, reward, *rest = super().step(actions)
        return seen, reward + 1.0, *rest


@pytest.mark.parametrize(("kind", "said"), [(Leaky, "is not that of one"), (Lasting, "has a reward")])
def test_what_is_wrong_is_told(kind, said, device):
    with pytest.raises(AssertionError, match=said):
        check_vector(functools.partial(navigate, device=device, kind=kind))
