"""What a learner would see of worlds that something else steps is what environments show, bit for bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp.envs import terms as t
from otwarp.envs.batch import Batch
from otwarp.envs.observer import Observer
from otwarp.envs.registration import task_of
from otwarp.errors import InputError
from otwarp.simulation import Simulation


def test_it_sees_what_environments_show(device):
    shipped = task_of("otwarp/CellDelivery-v0")
    task = replace(shipped, observations=(*shipped.observations, t.gap(body="/World/cell")))
    batch = Batch(task, 2, device=device, autoreset="off")
    batch.restart(seeds=np.array([1, 2]))
    observer, draws = Observer(task, batch.sim), np.random.default_rng(0)
    assert np.array_equal(observer.look(), batch.verdict.seen.numpy())
    for _ in range(6):
        batch.actions.assign(draws.uniform(-0.3, 0.3, batch.actions.shape).astype(np.float32))
        batch.step()
        assert np.array_equal(observer.look(), batch.verdict.seen.numpy())
    assert not batch.done.any()


def test_a_simulation_without_what_is_observed_is_refused(device):
    scene = task_of("otwarp/CellDelivery-v0").load()
    left = tuple(o for o in scene.obstacles if not o.prim.endswith("pillar_1"))
    sim = Simulation(replace(scene, obstacles=left), device=device)
    with pytest.raises(InputError, match=r"obstacle of term .*pillar_1"):
        Observer(task_of("otwarp/CellDelivery-v0"), sim)
