"""Terms of the shipped tasks against NumPy, in a small scene."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp.envs import Batch
from otwarp.envs.kernels import task_terms
from otwarp.envs.tasks import terms as own
from otwarp.envs.terms import strayed
from tests.envs import bead_task

BEAD, TRAP, CUBE = bead_task.BEAD, bead_task.TRAP, bead_task.CUBE
TOLERANCE = 2e-5
"""Of float32 numbers of some 10, a few roundings apart."""


def test_terms_follow_from_the_state(device):
    task = dataclasses.replace(
        bead_task.task(),
        observations=(
            own.middle_offset(body=BEAD, obstacle=CUBE, scale=1.0),
            own.raised(trap=TRAP, scale=1.0),
            own.wanted_rise(scale=1.0),
        ),
        rewards=(
            own.approach(body=BEAD, other=BEAD),
            own.crash(body=BEAD),
            own.slip(distance=0.05),
            own.parting(body=BEAD, other=BEAD, distance=1.0),
            own.rise_error(trap=TRAP),
            own.risen_now(trap=TRAP, tolerance=5.0, after=0.2),
            own.dropped(cell=BEAD, left=BEAD, right=BEAD, distance=1.0),
            own.carried_off(cell=BEAD, left=BEAD, right=BEAD),
        ),
        ends=(
            own.parted(body=BEAD, other=BEAD, distance=1.0),
            own.risen(trap=TRAP, tolerance=5.0, after=0.3, success=True),
            strayed(body=BEAD, radius=90.0),
        ),
    )
    batch = Batch(task, 3, device=device)
    batch.restart(seeds=np.arange(3) + 5)
    batch.actions.assign(np.float32([[1.0, 0.0], [0.0, 0.0], [0.3, -0.4]]))
    cube = next(o for o in batch.scene.obstacles if o.shape == "box")
    for period in range(1, 7):
        batch.step()
        place, goal = batch.sim.state.position.numpy()[:, 0], batch.episode.goal.numpy()
        seen, earned = batch.verdict.seen.numpy(), batch.verdict.earned.numpy()
        assert np.allclose(seen[:, :3], np.clip(cube.position.at(0.05 * period) - place, -10, 10), atol=TOLERANCE)
        assert np.allclose(seen[:, 3], 0.0, atol=TOLERANCE) and np.allclose(seen[:, 4], goal[:, 2], atol=TOLERANCE)
        lag = np.linalg.norm(batch.episode.focus.numpy()[:, 0] - place, axis=1)
        assert np.array_equal(earned[:, 2], lag > 0.05)
        assert np.allclose(earned[:, 4], goal[:, 2], atol=TOLERANCE)
        assert np.array_equal(earned[:, 5], [float(period >= 4)] * 3)
        assert not earned[:, [0, 1, 3, 6, 7]].any()
        assert np.array_equal(batch.verdict.success.numpy(), [period == 6] * 3)


def test_every_function_has_its_term():
    names = {
        name for name, value in vars(task_terms).items() if getattr(value, "__module__", "") == task_terms.__name__
    }
    assert names == {term.function.function.__name__ for term in vars(own).values() if hasattr(term, "weight")}
