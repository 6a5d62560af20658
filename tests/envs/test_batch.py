"""Worlds of a task: how episodes start, what is randomised, and what a period of control is made of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from otwarp import studies
from otwarp.envs import Batch, TaskNow, term
from otwarp.envs.batch import WORLDS_EACH
from otwarp.envs.kernels.judge import VerdictData
from otwarp.envs.registration import task_of
from otwarp.envs.terms import kept_up
from otwarp.errors import InputError
from otwarp.scene import Track
from otwarp.simulation.model import Model
from tests.envs.bead_task import task as bead_task

TASK = bead_task()
PLACE = np.array([-10.0, 0.0, 5.0])
VISCOSITY = studies.values([1.0, 2.0], unit="mPa·s")
STIFFNESS = studies.values([1.0, 3.0], unit="pN/µm per mW")


def test_episodes_start_within_their_boxes_and_differ(device):
    """Uniform within ± h: means within 5 standard errors, h/√(3 n), of 0."""
    n, half = 2000, np.array([1.0, 6.0, 0.0])
    batch = Batch(TASK, n, device=device)
    batch.restart(seeds=np.arange(n))
    for _ in range(2):
        bead = batch.sim.state.position.numpy()[:, 0] - PLACE
        goal = batch.episode.goal.numpy() - [10.0, 0.0, 5.0]
        for shift in (bead, goal):
            assert np.all(np.abs(shift) <= half + 1e-6) and len(np.unique(shift[:, 1])) > 0.99 * n
            assert np.all(np.abs(shift.mean(axis=0)) <= 5.0 * half / np.sqrt(3 * n) + 1e-6)
        assert abs(np.corrcoef(bead[:, 1], goal[:, 1])[0, 1]) < 5.0 / np.sqrt(n)
        assert np.allclose(batch.sim.control.trap_position.numpy()[:, 0], bead + PLACE, atol=1e-6)
        before = bead.copy()
        batch.restart()
        assert not np.any(batch.sim.state.position.numpy()[:, 0, 1] - 0.0 == before[:, 1])


def test_a_thread_of_a_cpu_takes_its_worlds_and_no_others(device):
    """As many as it takes, one more, and the same alone: each world acts, ends and starts anew as by itself."""
    seen = {}
    for worlds in (WORLDS_EACH + 1, WORLDS_EACH, 1):
        batch = Batch(TASK, worlds, device=device, autoreset="same")
        batch.restart(seeds=np.arange(WORLDS_EACH + 1)[-worlds:] if worlds == 1 else np.arange(worlds))
        batch.actions.fill_(0.7)
        for _ in range(40):
            batch.step()
        seen[worlds] = (batch.verdict.seen.numpy(), batch.episode.number.numpy())
    for many, few in zip(seen[WORLDS_EACH + 1], seen[WORLDS_EACH], strict=True):
        assert np.array_equal(many[:WORLDS_EACH], few)
    for many, one in zip(seen[WORLDS_EACH + 1], seen[1], strict=True):
        assert np.array_equal(many[-1:], one)


@term()
def placed(now: TaskNow, after: float) -> bool:
    """Later than `after` periods, the goal of the world has a negative y."""
    return float(now.period) > after and now.episode.goal[now.world][1] < 0.0


def ends_of(mode: str, worlds: int, ends: tuple, numbers: np.ndarray, device: str) -> list[np.ndarray]:
    """Numbers of trials, periods and observations of worlds after each of some periods."""
    batch = Batch(dataclasses.replace(TASK, ends=ends), worlds, device=device, autoreset=mode)
    batch.restart(seeds=numbers)
    found = []
    for period in range(6):
        if period == 3:
            # one of them may be in the list of those that have just ended
            batch.restart(numbers % 3 == 0)
        batch.step()
        out, episode = batch.verdict, batch.episode
        each = (episode.number, episode.period, out.terminated, batch.sim.state.position, out.seen)
        found.append(np.column_stack([a.numpy().reshape(worlds, -1).astype(float) for a in each]))
    return found


@pytest.mark.parametrize("mode", ["next", "same", "off"])
@pytest.mark.parametrize(
    "ends", [(placed(after=1.0),), (kept_up(duration=0.1),), (kept_up(duration=99.0),)], ids=["some", "all", "none"]
)
def test_worlds_that_end_in_one_period_start_anew_as_each_by_itself(mode, ends, device):
    """Some, all or none: whatever else is in the list of those that start anew."""
    numbers = np.arange(WORLDS_EACH + 7)
    many = ends_of(mode, len(numbers), ends, numbers, device)
    over = np.array([rows[:, 2] for rows in many])
    assert over.any() == (ends[0].name == "placed" or ends[0].values["duration"] < 1.0)
    if ends[0].name == "placed":
        assert 10 < over[1].sum() < len(numbers) - 10
    for n in (0, 1, 2, len(numbers) - 1):
        alone = ends_of(mode, 1, ends, numbers[n : n + 1], device)
        assert all(np.array_equal(rows[n], one[0]) for rows, one in zip(many, alone, strict=True))


def everything(batch: Batch) -> dict[str, np.ndarray]:
    """What a period has led to, and where the next one begins."""
    verdict = {name: getattr(batch.verdict, name) for name in VerdictData.vars}
    episode = {name: getattr(batch.episode, name) for name in ("number", "period", "held", "energy", "focus", "goal")}
    return {name: array.numpy().copy() for name, array in (verdict | episode | batch.sim.arrays()).items()}


@pytest.mark.parametrize("how", ["fault", "written"])
def test_where_worlds_start_anew_at_once_all_of_them_are_stepped(how, device):
    """A world that faults within a period, or whose `done` is written before it, is in the next episode after it; from
    then on it is as one that was reset by a mask, and all others are from the first as if nothing had been."""
    n, ended = WORLDS_EACH + 3, 5
    ending, masked = (Batch(TASK, n, device=device, autoreset="same") for _ in range(2))
    others = np.arange(n) != ended
    for batch in (ending, masked):
        batch.restart(seeds=np.arange(n))
        batch.actions.fill_(0.3)
        batch.step()
    if how == "fault":
        place = ending.sim.state.position.numpy().copy()
        place[ended], place[ended, 0, 1] = 9e8, 1.1e8
        ending.sim.set_state(position=place)
    else:
        ending.sim.episodes.done.assign(np.where(others, 0, 7))
    ending.step()
    masked.step()
    there, here = everything(masked), everything(ending)
    assert all(np.array_equal(there[name][others], here[name][others]) for name in there if len(there[name]) == n)
    fault = how == "fault"
    assert here["terminated"][ended] == fault and here["outcome"][ended] == (-1 if fault else 0)
    assert here["episodes.done"][ended] == here["period"][ended] == here["episodes.step"][ended] == 0
    assert here["number"][ended] != there["number"][ended] and np.any(here["last_seen"][ended])
    masked.restart(~others)
    for _ in range(6):
        ending.step()
        masked.step()
        assert ending.sim.episodes.count.numpy()[0] == n
    there, here = everything(masked), everything(ending)
    assert all(np.array_equal(there[name], here[name]) for name in there if name != "readout.fault_count")


def test_a_state_that_is_no_number_earns_none(device):
    """Returns and gradients of all environments are sums of rewards."""
    lost, other = (Batch(TASK, 3, device=device, autoreset="off") for _ in range(2))
    for batch in (lost, other):
        batch.restart(seeds=np.arange(3))
    place = lost.sim.state.position.numpy().copy()
    place[1] = np.nan
    lost.sim.state.position.assign(place)
    for batch in (lost, other):
        batch.step()
    assert lost.verdict.outcome.numpy()[1] == -1 and lost.verdict.terminated.numpy()[1]
    for name in ("reward", "earned", "seen"):
        here, there = (getattr(batch.verdict, name).numpy() for batch in (lost, other))
        assert np.isfinite(here).all() and np.array_equal(here[[0, 2]], there[[0, 2]])
    assert lost.verdict.reward.numpy()[1] == 0.0


@pytest.mark.parametrize("mode", ["next", "off"])
def test_worlds_on_hold_and_those_that_are_over_are_not_stepped(mode, device):
    n, far = 6, 2
    batch = Batch(dataclasses.replace(TASK, ends=(kept_up(duration=0.1),)), n, device=device, autoreset=mode)
    batch.restart(seeds=np.arange(n))
    batch.step()
    batch.restart(np.arange(n) == far)
    batch.step()
    assert batch.done.tolist() == [world != far for world in range(n)]
    step, place = batch.sim.episodes.step.numpy().copy(), batch.sim.state.position.numpy().copy()
    batch.step()
    assert batch.sim.episodes.count.numpy()[0] == 1
    moved = np.any(batch.sim.state.position.numpy() != place, axis=(1, 2))
    assert np.all(moved) if mode == "next" else moved.tolist() == [world == far for world in range(n)]
    # who starts anew is put where it starts, and no further
    start = batch.episode.start.numpy() if mode == "next" else place
    held = np.arange(n) != far
    assert np.array_equal(batch.sim.state.position.numpy()[held], start[held])
    assert np.array_equal(batch.sim.episodes.step.numpy()[held], 0 * step[held] if mode == "next" else step[held])
    assert batch.sim.episodes.step.numpy()[far] == step[far] + batch.steps


def test_a_box_of_starts_may_lie_elsewhere(device):
    places = []
    for middle in ((0.0, 0.0, 0.0), (3.0, -2.0, 0.5)):
        shifts = tuple(dataclasses.replace(shift, middle=middle) for shift in TASK.shifts)
        batch = Batch(dataclasses.replace(TASK, shifts=shifts), 8, device=device)
        batch.restart(seeds=np.arange(8))
        places.append((batch.sim.state.position.numpy()[:, 0], batch.sim.control.trap_position.numpy()[:, 0]))
    for there, elsewhere in zip(*places, strict=True):
        assert np.allclose(elsewhere - there, [3.0, -2.0, 0.5], atol=1e-5)


def test_each_episode_takes_a_row_of_what_is_randomised(device):
    task = dataclasses.replace(
        TASK,
        randomise={
            "trap_power": studies.values([2.0, 4.0, 8.0], unit="mW"),
            ("medium_viscosity", "trap_stiffness"): (
                VISCOSITY,
                STIFFNESS,
            ),
        },
    )
    batch = Batch(task, 50, device=device)
    seen = set()
    for k in range(3):
        batch.restart(seeds=np.arange(50) if k == 0 else None)
        power = batch.sim.control.trap_power.numpy()[:, 0]
        data = batch.sim.model.data
        stiffness, viscosity = data.traps.stiffness.numpy()[:, 0], data.medium.viscosity.numpy()
        assert np.allclose(stiffness, np.where(viscosity > 1.5e-3, 3.0, 1.0))
        seen |= set(zip(power.tolist(), stiffness.tolist(), strict=True))
    assert seen == {(p, s) for p in (2.0, 4.0, 8.0) for s in (1.0, 3.0)}
    few = Batch(task, 2, device=device)
    few.restart(seeds=np.array([7, 31]))
    batch.restart(seeds=np.arange(50))
    assert np.array_equal(few.sim.control.trap_power.numpy(), batch.sim.control.trap_power.numpy()[[7, 31]])
    for one in (few, batch):
        one.actions.fill_(0.5)
        for _ in range(5):
            one.step()
    assert np.array_equal(few.verdict.seen.numpy(), batch.verdict.seen.numpy()[[7, 31]])


def test_starts_are_randomised_as_they_are_named(device):
    """The bead where the axis says, its trap where the scene has it; both moved by the shift."""
    high = studies.values([5.2, 5.4], unit="µm")
    task = dataclasses.replace(TASK, randomise={"start.z:/World/bead": high})
    batch = Batch(task, 20, device=device)
    batch.restart(seeds=np.arange(20))
    place, focus = batch.sim.state.position.numpy()[:, 0], batch.sim.control.trap_position.numpy()[:, 0]
    assert set(np.round(place[:, 2], 4)) == {np.float32(5.2), np.float32(5.4)}
    assert np.allclose(focus[:, :2], place[:, :2], atol=1e-6) and np.allclose(focus[:, 2], 5.0)


def test_forces_on_bodies_are_randomised(device):
    """A bead in a trap that lets it go by force over stiffness, 0.2 µm, under a force along x or none."""
    force = studies.values([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], unit="pN")
    batch = Batch(dataclasses.replace(TASK, randomise={"external_force": force}), 200, device=device)
    batch.restart(seeds=np.arange(200))
    for _ in range(4):
        batch.step()
    away = (batch.sim.state.position.numpy() - batch.sim.control.trap_position.numpy())[:, 0, 0]
    pushed = batch.episode.variant.numpy() == 1
    # kT/k = 0.0041/10 µm² along x, 5 standard errors of means of some 100
    for group, wanted in ((~pushed, 0.0), (pushed, 0.2)):
        assert 60 < group.sum() < 140 and abs(away[group].mean() - wanted) < 5.0 * np.sqrt(0.00041 / group.sum())


def test_bodies_start_turned_as_they_are_named(device):
    """A robot turned about its prim's origin by its axis z: 0 or 0.5 rad."""
    name = "otwarp/Orient-v0"
    task = task_of(name, randomise={"turn.z:/World/pair": studies.values([0.0, 0.5], unit="rad")})
    batch = Batch(task, 40, device=device)
    batch.restart(seeds=np.arange(40))
    turn, variant = batch.sim.state.orientation.numpy()[:, 0], batch.episode.variant.numpy()
    still = np.array(batch.sim.model.start_orientation())[0]
    angle = 2.0 * np.arccos(np.clip(np.abs(turn @ still), 0.0, 1.0))
    assert set(variant) == {0, 1} and np.allclose(angle, 0.5 * variant, atol=1e-3)
    assert np.allclose(batch.sim.prim_poses()[0][:, 0], batch.scene.bodies[0].position, atol=1e-5)


def test_powers_go_by_the_numbers_of_actions(device):
    task = dataclasses.replace(TASK, action="both", power=(2.0, 6.0))
    batch = Batch(task, 3, device=device)
    assert [c.name for c in batch.layout.acted] == ["hand.velocity.x", "hand.velocity.y", "hand.power"]
    batch.restart(seeds=np.arange(3))
    batch.actions.assign(np.array([[0, 0, -1], [0, 0, 0.5], [0, 0, 9]], dtype=np.float32))
    batch.step()
    assert np.allclose(batch.sim.control.trap_power.numpy()[:, 0], [2.0, 5.0, 6.0])


def test_a_period_is_cut_for_the_hardest_variant(device):
    """As few time steps as the scene with its stiffest trap, at most power and as fast as hands may be, allows."""
    power, stiffness = 60.0, (1.0, 3.0)
    varied = {"trap_stiffness": studies.values(list(stiffness), unit="pN/µm per mW")}
    task = dataclasses.replace(TASK, action="both", power=(2.0, power), randomise=varied)
    batch = Batch(task, 2, device=device)
    limits = []
    for k in stiffness:
        (trap,) = task.load().traps
        law = dataclasses.replace(trap.radial, stiffness=k, power=1.0)
        trap = dataclasses.replace(trap, radial=law, power=Track.constant(power), speed_limit=task.speed_limit)
        limits.append(Model.build(dataclasses.replace(task.load(), traps=(trap,)), device=device).time_step)
    assert limits[1] < 0.5 * limits[0]
    assert batch.sim.time_step * batch.steps == pytest.approx(1.0 / task.rate, rel=1e-12)
    assert batch.sim.time_step <= limits[1] * (1.0 + 1e-9) < 1.0 / (task.rate * (batch.steps - 1))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"randomise": {"/World/bead/sphere.radius": studies.values([1.0], unit="µm")}}, "its scene has no file"),
        ({"randomise": {"turn:/World/bead": studies.values([[0, 0, 1.0]], unit="rad")}}, "where no body rotates"),
        ({"speed_limit": 0.0}, "speed_limit of task tests/Bead-v0 is 0.0; allowed: a number from 0.001 to 10000 µm/s"),
        ({"action": "force"}, "allowed: velocity, power, both"),
        ({"hands": ()}, "at least one hand"),
    ],
)
def test_tasks_that_cannot_be_are_told_in_one_line(changes, said):
    with pytest.raises(InputError) as error:
        Batch(dataclasses.replace(TASK, **changes), device="cpu")
    assert said in str(error.value) and "\n" not in str(error.value)
