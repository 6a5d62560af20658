"""What a policy may return, and what is said of what it may not."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp.envs.rollout import policy_of, run_policy
from otwarp.errors import InputError
from tests.envs.bead_task import task as bead_task

pytestmark = pytest.mark.quick

SHORT = dataclasses.replace(bead_task(), time_limit=0.1)


@pytest.mark.parametrize(("worlds", "number"), [(None, np.nan), (2, -np.inf)])
def test_a_number_that_is_not_finite_has_a_name_and_an_environment(device, worlds, number) -> None:
    """The third of three environments, whether all of them run at once or in blocks of two."""
    met: list[int] = []

    def policy(seen: Mapping[str, np.ndarray], fresh: np.ndarray) -> np.ndarray:
        acted = np.zeros((len(fresh), 2))
        met.extend([0] * int(fresh.sum()))
        if len(met) > 2:
            acted[2 % len(fresh), 1] = number
        return acted

    with pytest.raises(InputError) as error:
        run_policy(SHORT, policy, episodes=3, worlds=worlds, device=device)
    assert str(error.value) == (
        f"policy returned {number} for hand.velocity.y, number 1 of the action of environment 2; "
        "allowed: finite numbers, of which those within ±1 count"
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros(3), r"policy returned float64 of shape \(3,\); allowed: numbers of shape \(1, 2\)"),
        (np.zeros((1, 4)), r"policy returned float64 of shape \(1, 4\); allowed: "),
        (np.zeros((1, 2), dtype=complex), r"policy returned complex128 of shape \(1, 2\); allowed: "),
        (np.zeros((1, 2), dtype=bool), r"policy returned bool of shape \(1, 2\); allowed: "),
        ([["a", "b"]], r"policy returned <U1 of shape \(1, 2\); allowed: "),
        ([[0, 0], [0]], "policy returned list; allowed: "),
        (None, "policy returned NoneType; allowed: "),
    ],
)
def test_what_is_no_action_is_refused(device, given, said) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        run_policy(SHORT, lambda seen, fresh: given, episodes=1, device=device)


def test_what_is_no_policy_is_refused(device) -> None:
    with pytest.raises(InputError, match=r"^policy is 'still'; allowed: a function"):
        run_policy(SHORT, "still", episodes=1, device=device)  # type: ignore[arg-type]


def test_large_numbers_count_as_one(device) -> None:
    """As on the device: float32 holds no 1e300."""
    found = [run_policy(SHORT, lambda seen, fresh, n=n: np.full((len(fresh), 2), n), episodes=2, device=device)
             for n in (1.0, 1e300, 1)]  # fmt: skip
    assert all(np.array_equal(one.earned, found[0].earned) for one in found)
    assert policy_of(SHORT, "still")({}, np.ones(2, dtype=bool)).shape == (2, 2)
