"""A machine whose load changes: before a session, in the search, and while it runs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from otwarp.scene import Scene
from otwarp.teleop import PaceNow
from otwarp.teleop.budget import CHANGED, reduce_scene
from otwarp.teleop.budget.report import BudgetReport, SceneCost
from otwarp.teleop.session.pace import HOLD, BudgetWatch
from tests.teleop.budget.test_reduce import Machine, line_of_cells


class Shared(Machine):
    """A machine of which another program takes all but a part during the first measurements."""

    def __init__(self, per_body: float, *, busy: int, slower: float, **more):
        super().__init__(per_body, **more)
        self._busy, self._slower = busy, slower

    def __call__(self, scene: Scene, *, device: str | None, speed: float, rate: float) -> SceneCost:
        usual = self.per_body
        if len(self.seen) < self._busy:
            self.per_body = usual * self._slower
        try:
            return super().__call__(scene, device=device, speed=speed, rate=rate)
        finally:
            self.per_body = usual


@pytest.mark.parametrize("busy", [1, 2])
def test_a_bad_first_measurement_is_not_kept(busy):
    """All 31 bodies take 31 % of a core; while another program runs it looks like 155 %."""
    scene = line_of_cells(30)
    quiet = reduce_scene(scene, measure=Machine(1e-5)).report
    assert quiet.kept == 31 and quiet.fits and not quiet.reduced
    found = reduce_scene(scene, measure=Shared(1e-5, busy=busy, slower=5.0)).report
    assert found.kept == 31 and found.fits and not found.reduced and found.reach is None
    assert any("has changed: searched anew" in line for line in found.log)


def test_a_load_that_grows_meanwhile_is_heeded():
    scene, machine = line_of_cells(30), Shared(5e-5, busy=1, slower=1.0 / (1.1 * CHANGED))
    found = reduce_scene(scene, measure=machine).report
    same = reduce_scene(scene, measure=Machine(5e-5)).report
    assert (found.kept, found.speed, found.accuracy) == (same.kept, same.speed, same.accuracy)


def test_a_load_that_never_rests_ends_all_the_same():
    class Restless(Machine):
        def __call__(self, scene, **how):
            self.per_body = 1e-4 if len(self.seen) % 2 else 2e-4
            return super().__call__(scene, **how)

    found = reduce_scene(line_of_cells(30), measure=Restless(1e-4)).report
    assert len(found.log) < 40 and found.speed > 0.0


def report(speed: float, **more) -> BudgetReport:
    cost = Machine(7e-4)(line_of_cells(0), device=None, speed=1.0, rate=120.0)  # 70 % of a core for each bead
    fields = {"budget": "auto", "share": 0.7, "rate": 120.0, "speed": speed, "before": cost, "after": cost}
    return replace(BudgetReport.off(line_of_cells(0), 1.0), **fields | more)


def feed(watch: BudgetWatch, seconds: float, pace: PaceNow, start: float = 0.0) -> list[tuple[float, float]]:
    """The first that it asks for, and when: the loop goes on at that speed."""
    for n in range(round(10.0 * seconds)):
        speed = watch(start + 0.1 * n, pace)
        if speed is not None:
            return [(start + 0.1 * n, speed)]
    return []


def test_slow_motion_ends_when_the_machine_carries_more():
    lines: list[str] = []
    watch = BudgetWatch(report(0.5), lines.append)
    ((when, speed),) = feed(watch, 1.5 * HOLD, PaceNow(speed=0.5, factor=0.5, busy=0.2))
    assert when == pytest.approx(HOLD, abs=0.2) and speed == 1.0
    assert lines == ["budget: this machine carries more: 1 simulated seconds per second from now on"]


def test_it_rises_no_farther_than_its_share_carries():
    watch = BudgetWatch(report(0.2), str)
    assert feed(watch, 1.5 * HOLD, PaceNow(speed=0.2, factor=0.2, busy=0.3))[0][1] == pytest.approx(0.46)


def test_a_session_that_slips_goes_slower_and_comes_back():
    watch = BudgetWatch(report(1.0), str)
    ((_, slow),) = feed(watch, 1.5 * HOLD, PaceNow(speed=1.0, factor=0.6, busy=1.0))
    assert slow == pytest.approx(0.42)
    ((_, back),) = feed(watch, 1.5 * HOLD, PaceNow(speed=slow, factor=slow, busy=0.2), start=100.0)
    assert back == 1.0


@pytest.mark.parametrize(
    "pace",
    [
        PaceNow(speed=1.0, factor=1.0, busy=0.8),  # more than its share, and in time
        PaceNow(speed=0.3, factor=0.3, busy=0.1),  # the user's wish
        PaceNow(speed=1.0, factor=0.0, busy=0.0, paused=True),
    ],
)
def test_it_leaves_alone_what_need_not_change(pace):
    assert feed(BudgetWatch(report(1.0), str), 4.0 * HOLD, pace) == []


def test_a_moment_changes_nothing():
    watch, late = BudgetWatch(report(1.0), str), PaceNow(speed=1.0, factor=0.6, busy=1.0)
    for n in range(5):
        assert feed(watch, 0.8 * HOLD, late, start=10.0 * n) == []
        assert feed(watch, 0.5, PaceNow(speed=1.0, factor=1.0, busy=0.5), start=10.0 * n + 0.9 * HOLD) == []


def test_what_was_left_out_and_would_fit_is_said_once():
    lines: list[str] = []
    whole = Machine(7e-4)(line_of_cells(1), device=None, speed=1.0, rate=120.0)
    watch = BudgetWatch(report(1.0, before=whole, left=("/World/Cells[0]",)), lines.append)
    assert feed(watch, 3.0 * HOLD, PaceNow(speed=1.0, factor=1.0, busy=0.6)) == [] and not lines
    assert feed(watch, 3.0 * HOLD, PaceNow(speed=1.0, factor=1.0, busy=0.3), start=100.0) == []
    assert lines == ["budget: this machine carries the whole scene by now; start the session anew to have it"]
