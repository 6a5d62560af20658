from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.record.monitor import GRACE, Monitor, robot_distance
from otwarp.record.statistics import RunningStatistics
from otwarp.record.summary import escapes, statistics
from otwarp.scene import Scene
from tests.record.small_run import HELD, RATE, frame

LAST = 1e-12
"""Rounding of sums of some hundred numbers of order 1 in double precision."""


def at_goal(scene: Scene, item, world: int):
    """The same frame with the cell and its robots at the goal in one world."""
    position = np.array(item.position)
    position[world, :3] += np.array(scene.goal.position) - position[world, 2]
    return dataclasses.replace(item, position=position)


def test_the_first_arrival_counts(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 2)
    for index in range(10):
        item = frame(scene, index, worlds=2)
        monitor.update(at_goal(scene, item, 1) if index in (4, 7) else item)
    assert monitor.counts() == {"undecided": 1, "delivered": 1, "robot lost": 0, "cell lost": 0}
    end = monitor.outcome(1)
    assert (end.outcome, end.time) == ("delivered", 4 / RATE)
    assert "tolerance 1 µm" in end.reason
    assert monitor.outcome(0).outcome == "undecided"
    assert monitor.outcome(0).time is None


def test_a_robot_is_lost_only_after_the_grace_and_from_when_it_went(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 2)
    away = np.array([[0.2, 3.5], [0.2, 0.2]])
    for index in range(30):
        short_jump = 5 <= index < 5 + int(0.5 * GRACE * RATE)
        gone = short_jump or index >= 15
        monitor.update(frame(scene, index, worlds=2, **({"trap_distance": away} if gone else {})))
    end = monitor.outcome(0)
    assert end.outcome == "robot lost"
    assert end.time == pytest.approx(15 / RATE)
    assert "/World/Group/right was 3.5 µm" in end.reason
    assert monitor.outcome(1).outcome == "undecided"


@pytest.mark.parametrize(
    "change",
    [{"trap_distance": np.array([[np.nan, 0.2]])}, {"trap_power": np.array([[0.0, 20.0]])}],
    ids=["holds nothing", "dark"],
)
def test_a_robot_that_nothing_holds_is_lost(scene: Scene, change: dict[str, np.ndarray]) -> None:
    monitor = Monitor(scene, HELD, 1)
    for index in range(12):
        monitor.update(frame(scene, index, **change))
    assert monitor.outcome(0).outcome == "robot lost"
    assert monitor.outcome(0).reason == "no trap holds /World/Group/left any more"


def test_a_cell_far_from_the_midpoint_of_its_robots_is_lost(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 1)
    for index in range(3):
        item = frame(scene, index)
        position = np.array(item.position)
        position[0, 2, 0] += 2.5 * index
        monitor.update(dataclasses.replace(item, position=position))
    end = monitor.outcome(0)
    assert (end.outcome, end.time) == ("cell lost", 2 / RATE)
    assert end.reason == "/World/Group/cell was 5 µm from the midpoint of its robots (limit 4 µm)"


def test_delivery_before_a_loss_stays_delivery_and_a_loss_before_stays_a_loss(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 2)
    off = np.zeros((2, 6, 3))
    off[:, 2, 0] = 5.0
    for index in range(6):
        item = frame(scene, index, worlds=2)
        first = at_goal(scene, item, 0) if index == 1 else item
        second = dataclasses.replace(first, position=first.position + off * [[[index == 1]], [[index == 0]]])
        monitor.update(at_goal(scene, second, 1) if index == 3 else second)
        if index == 1:
            assert monitor.outcome(0).outcome == "cell lost"
    assert monitor.outcome(1).outcome == "cell lost"
    monitor = Monitor(scene, HELD, 1)
    monitor.update(at_goal(scene, frame(scene, 0), 0))
    late = frame(scene, 1)
    monitor.update(dataclasses.replace(late, position=late.position + off[:1]))
    assert monitor.outcome(0).outcome == "delivered"


def test_statistics_are_those_of_all_samples_until_the_outcome(scene: Scene) -> None:
    rng = np.random.default_rng(5)
    monitor, distances, forces = Monitor(scene, HELD, 3), [], []
    for index in range(150):
        distance, force = rng.uniform(0.0, 2.0, (3, 2)), rng.normal(size=(3, 6, 3)) * 6.0
        monitor.update(frame(scene, index, worlds=3, trap_distance=distance, contact_force=force))
        distances.append(distance)
        forces.append(np.linalg.norm(force[:, :2], axis=2))
    for series, values, line in ((monitor.distance, distances, 1.0), (monitor.force, forces, 5.0)):
        pooled = series.pooled()
        assert pooled["samples"] == 150 * 6
        assert pooled["mean"] == pytest.approx(np.mean(values), rel=LAST)
        assert pooled["std"] == pytest.approx(np.std(values), rel=LAST)
        assert pooled["maximum"] == np.max(values)
        assert pooled["fraction_above"] == np.mean(np.array(values) > line)
    # the robots are held to the 5 pN of the cell they carry, not to their own 10 pN
    np.testing.assert_array_equal(monitor.warning_force, [5.0, 5.0])


def test_statistics_stop_at_the_outcome(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 1)
    for index in range(5):
        item = frame(scene, index, trap_distance=np.full((1, 2), 0.1 if index < 3 else 2.0))
        monitor.update(at_goal(scene, item, 0) if index == 2 else item)
    assert monitor.distance.pooled()["samples"] == 6
    assert monitor.distance.pooled()["mean"] == pytest.approx(0.1)


def test_escapes_are_those_of_the_device_up_to_the_outcome(scene: Scene) -> None:
    monitor = Monitor(scene, HELD, 3)
    escaped = np.full((3, 2), np.nan)
    for index in range(3, 9):
        if index == 5:
            escaped[0, 1] = 4.5 / RATE  # between two frames: no distance says so
            escaped[1, 0] = 1.0 / RATE  # before this run was resumed
        if index == 8:
            escaped[2, 0] = 7.5 / RATE  # after the outcome
        item = frame(scene, index, worlds=3, escape_time=escaped.copy())
        monitor.update(at_goal(scene, item, 2) if index == 6 else item)
    np.testing.assert_array_equal(monitor.escape_time, [[np.nan, 4.5 / RATE], [np.nan] * 2, [np.nan] * 2])
    assert escapes(monitor) == (1, {"trap": "/World/Traps/right", "world": 0, "time_s": 4.5 / RATE})
    assert escapes(Monitor(scene, HELD, 3)) == (0, None)


def test_contact_forces_are_left_out_where_nothing_can_touch(scene: Scene) -> None:
    ghosts = tuple(
        dataclasses.replace(b, spheres=tuple(dataclasses.replace(s, collides=False) for s in b.spheres))
        for b in scene.bodies
    )
    lone = dataclasses.replace(scene, bodies=(scene.bodies[0], *ghosts[1:]))
    for changed, touching in ((scene, True), (lone, True), (dataclasses.replace(lone, obstacles=()), False)):
        monitor = Monitor(changed, HELD, 1)
        monitor.update(frame(changed, 0))
        assert monitor.touching == touching
        assert [key in statistics(monitor) for key in ("contact_force", "cell_load")] == [touching, touching]
        assert "trap_distance" in statistics(monitor)


def test_without_a_goal_there_are_statistics_only(scene: Scene) -> None:
    monitor = Monitor(dataclasses.replace(scene, goal=None), HELD, 1)
    for index in range(4):
        monitor.update(frame(scene, index, trap_distance=np.full((1, 2), 9.0)))
    assert monitor.outcome(0).outcome == "undecided"
    assert monitor.cells == [2, 3, 4, 5]
    assert monitor.distance.pooled()["mean"] == pytest.approx(9.0)


def test_robot_distance_is_the_largest_of_the_lit_traps() -> None:
    distance = np.array([[0.1, 0.7, 0.9, np.nan, 0.3]])
    power = np.array([[1.0, 1.0, 0.0, 1.0, 1.0]])
    traps_of = [np.array([0, 1, 2]), np.array([3, 4]), np.array([2]), np.array([], dtype=int)]
    np.testing.assert_array_equal(robot_distance(distance, power, traps_of), [[0.7, np.inf, np.inf, np.nan]])


def test_a_mean_far_from_zero_keeps_its_spread() -> None:
    """The sum of squares would lose everything here: 1e9² · 1e-16 = 100 is more than the variance."""
    values = 1e9 + np.random.default_rng(1).normal(size=1000)
    series = RunningStatistics((1,))
    for value in values:
        series.add(np.array([value]))
    assert series.pooled()["std"] == pytest.approx(np.std(values - 1e9), rel=1e-6)


def test_no_samples_have_no_mean() -> None:
    series = RunningStatistics((2,))
    series.add(np.array([np.nan, np.inf]))
    assert series.pooled() == {"samples": 0, "mean": None, "std": None, "maximum": None, "fraction_above": None}
