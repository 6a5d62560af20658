"""Terms of tasks against NumPy: what is seen, earned and ended follows from states, traps and obstacles."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp.envs import Batch, TaskNow, term
from otwarp.envs import terms as t
from otwarp.errors import InputError
from tests.envs.bead_task import task as bead_task

TASK = bead_task()
BEAD, TRAP = "/World/bead", "/World/trap"
TOLERANCE = 2e-5
"""Of float32 numbers of some 10, a few roundings apart."""


@term(unit="µm", scale=2.0)
def height(now: TaskNow, body: int, above: float = 0.0) -> float:
    """Height of a body."""
    return now.state.position[now.world, body][2] - above


def test_what_is_seen_and_earned_follows_from_the_state(device):
    task = dataclasses.replace(
        TASK,
        observations=(
            t.goal_offset(body=BEAD, scale=4.0),
            t.body_velocity(body=BEAD, axes="yx"),
            t.trap_offset(trap=TRAP),
            t.gap(body=BEAD),
            height(body=BEAD, above=1.0),
            t.time_left(),
        ),
        rewards=(t.progress(body=BEAD, weight=3.0), t.action_size(weight=-0.5), t.goal_distance(body=BEAD)),
        ends=(t.reached(body=BEAD, radius=0.01), t.kept_up(duration=0.3, success=True)),
    )
    batch = Batch(task, 3, device=device)
    batch.restart(seeds=np.arange(3) + 5)
    batch.actions.assign(np.array([[1.0, 0.0], [0.3, -0.4], [3.0, 4.0]], dtype=np.float32))
    action = np.array([[1.0, 0.0], [0.3, -0.4], [1.0, 1.0]])
    for period in range(1, 7):
        before = batch.sim.state.position.numpy()[:, 0].copy()
        focus = batch.episode.focus.numpy()[:, 0].copy()
        batch.step()
        now, out = batch.sim.state.position.numpy()[:, 0], batch.verdict
        goal, seen = batch.episode.goal.numpy(), out.seen.numpy()
        way = action / np.maximum(np.linalg.norm(action, axis=1, keepdims=True), 1.0) * 10.0 * 0.05
        moved = focus + np.pad(way, ((0, 0), (0, 1)))
        assert np.allclose(batch.episode.focus.numpy()[:, 0], moved, atol=TOLERANCE)
        assert np.allclose(seen[:, :3], (goal - now) / 4.0, atol=TOLERANCE)
        assert np.allclose(seen[:, 3:5], (now - before)[:, 1::-1] / 0.05 / 10.0, atol=20 * TOLERANCE)
        assert np.allclose(seen[:, 5:8], moved - now, atol=TOLERANCE)
        assert np.allclose(seen[:, 9], (now[:, 2] - 1.0) / 2.0, atol=TOLERANCE)
        assert np.allclose(seen[:, 10], (20.0 - 0.05 * period) / 10.0, atol=TOLERANCE)
        far = np.linalg.norm(goal - now, axis=1)
        nearer = np.linalg.norm(goal - before, axis=1) - far
        earned = np.stack([3.0 * nearer, -0.5 * np.mean(action**2, axis=1), far], axis=1)
        assert np.allclose(out.earned.numpy(), earned, atol=10 * TOLERANCE)
        assert np.allclose(out.reward.numpy(), earned.sum(axis=1), atol=20 * TOLERANCE)
        assert np.array_equal(out.terminated.numpy(), [period == 6] * 3)
        assert np.array_equal(out.outcome.numpy(), [2 * (period == 6)] * 3) and not out.truncated.numpy().any()
    assert out.success.numpy().all()


def test_gaps_are_those_to_the_nearest_obstacle(device):
    """Two round pillars and a cube that moves, about which the bead's sphere has a radius of 1 µm."""
    task = dataclasses.replace(
        TASK,
        observations=(t.gap(body=BEAD, scale=10.0), t.body_position(body=BEAD, scale=10.0)),
        ends=(t.strayed(body=BEAD, radius=90.0),),
    )
    batch = Batch(task, 4, device=device)
    batch.restart(seeds=np.arange(4))
    cube = next(o for o in batch.scene.obstacles if o.shape == "box")
    for period in range(1, 30):
        batch.actions.assign(np.tile(np.float32([1.0, 0.1]), (4, 1)))
        batch.step()
        gap, place = np.split(10.0 * batch.verdict.seen.numpy(), [1], axis=1)
        found = [
            np.linalg.norm(place[:, :2] - o.position.at(0.0)[:2], axis=1) - o.size[0]
            for o in batch.scene.obstacles
            if o.shape == "cylinder"
        ]
        over = np.abs(place - cube.position.at(0.05 * period)) - cube.size
        found.append(np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0))
        assert np.allclose(gap[:, 0], np.min(found, axis=0) - 1.0, atol=20 * TOLERANCE)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: t.gap(cell=1), "has no parameter cell; allowed: body, name"),
        (lambda: t.gap(body=BEAD, scale=0.0), "scale of term gap is 0.0"),
        (lambda: t.goal_offset(axes="xx"), "axes of term goal_offset are 'xx'"),
        (lambda: t.gap(body=BEAD, scale=True), "scale of term gap is True; allowed: a finite number above 0"),
        (lambda: t.passing(weight=float("nan")), "weight of term passing is nan"),
        (lambda: t.passing(weight=True), "weight of term passing is True; allowed: a finite number"),
        (lambda: t.passing(weight="1"), "weight of term passing is '1'; allowed: a finite number"),
        (lambda: t.reached(success=1), "success of term reached is 1; allowed: True, False"),
        (lambda: t.passing(name=""), "name of term passing is ''; allowed: a text"),
        (lambda: Batch(dataclasses.replace(TASK, observations=(t.gap(),))), "parameter body has no value"),
        (lambda: Batch(dataclasses.replace(TASK, observations=(t.gap(body="/World/x"),))), "body of term gap is '/Wo"),
        (lambda: dataclasses.replace(TASK, rewards=(t.goal_offset(body=BEAD),)), "is a vector; allowed: number"),
        (lambda: dataclasses.replace(TASK, ends=(t.gap(body=BEAD),)), "is a number; allowed: truth"),
    ],
)
def test_terms_that_cannot_be_are_told_in_one_line(made, said):
    with pytest.raises(InputError) as error:
        made()
    assert said in str(error.value) and "\n" not in str(error.value)


def test_weights_and_scales_may_be_numbers_of_numpy():
    made = t.gap(body=BEAD, scale=np.float32(2.0), weight=np.int64(3), success=np.True_)
    assert [type(v) for v in (made.scale, made.weight, made.success)] == [float, int, bool]
    assert (made.scale, made.weight, made.success) == (2.0, 3, True)
