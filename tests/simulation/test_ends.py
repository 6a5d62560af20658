"""What ends and their parameters may be: nothing that a world could never come to, or read beyond its arrays for."""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene

WORLDS = 8
ORIGIN = (0.0, 0.0, 0.0)


@ot.end
def above(now: ot.WorldNow, height: float, axis: int = 2) -> bool:
    return now.state.position[now.world, 0][axis] > height


def simulate(device, ends) -> Simulation:
    return Simulation(bead_scene(), worlds=WORLDS, device=device, ends=ends)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: ot.timed_out(after=-1.0), r"after of end timed_out has the value -1; allowed: in \[0, .*\] s"),
        (lambda: ot.timed_out(after=[1.0, np.nan]), "after of end timed_out has the value nan; allowed"),
        (lambda: ot.timed_out(after=1e300), r"after of end timed_out has the value 1e\+300; allowed"),
        (lambda: ot.reached(radius=-0.1), r"radius of end reached has the value -0.1; allowed: in \[0, 1e\+09\] µm"),
        (lambda: ot.strayed(radius=np.nan), "radius of end strayed has the value nan; allowed"),
        (lambda: ot.strayed(origin=(0.0, 0.0, np.inf)), "origin of end strayed has the value inf; allowed: finite µm"),
        (lambda: ot.reached(goal=(0.0, 0.0, 2e9)), r"vector of length 2e\+09; allowed: ≤ 1e\+09 µm"),
        (lambda: ot.reached(body=0.5), "body of end reached has the value 0.5; allowed: whole numbers ≥ 0"),
        (lambda: ot.reached(body=-1), "body of end reached has the value -1; allowed: whole numbers ≥ 0"),
        (lambda: ot.reached(body="/World/bead"), "body of end reached is '/World/bead' of type <U11; allowed: numbers"),
        (lambda: above(height=np.inf), "height of end above has the value inf; allowed"),
        (lambda: above(axis=1.5), "axis of end above has the value 1.5; allowed: whole numbers in"),
        (lambda: above(axis=1e12), r"axis of end above has the value 1e\+12; allowed"),
        (lambda: above(depth=1.0), "end above: parameter 'depth' is unknown; allowed: height, axis"),
        (lambda: ot.end(lambda x: True), "first argument must be annotated as otwarp.WorldNow"),
    ],
)
def test_what_parameters_may_be(wrong, says):
    with pytest.raises(ot.InputError, match=says):
        wrong()


@pytest.mark.parametrize(
    ("ends", "says"),
    [
        ([abs], "ends has <built-in function abs>; allowed: functions decorated with otwarp.end"),
        (42, "ends is 42; allowed: a list of functions decorated with otwarp.end"),
        (ot.escaped(), r"ends is End\(name='escaped', values={}\); allowed: a list of"),
        ([above], "end above: parameter height has no value; allowed"),
        ([ot.escaped], "no trap with a finite reach holds a sphere"),
        (
            [ot.reached(goal=ORIGIN, radius=1.0, body=1)],
            r"body of end reached .* 1; allowed: whole numbers in \[0, 0\]",
        ),
        ([ot.strayed(origin=(0.0, 0.0), radius=1.0)], r"origin of end strayed has shape \(2,\); .* worlds = 8$"),
        ([above(height=np.zeros(3))], r"height of end above has shape \(3,\); allowed: scalar or \(worlds,\)"),
    ],
)
def test_what_a_simulation_refuses_as_ends(ends, says, device):
    with pytest.raises(ot.InputError, match=says):
        simulate(device, ends)


def test_a_simulation_without_ends_has_no_episodes(device):
    for wrong in (lambda sim: sim.episodes, lambda sim: sim.reset()):
        with pytest.raises(ot.InputError, match="has no episodes; allowed: Simulation"):
            wrong(simulate(device, None))


def test_rows_hold_one_number_a_column_and_world():
    rows = ot.reached(goal=np.arange(24.0).reshape(8, 3), radius=2.0, body=3).rows(WORLDS, bodies=4)
    assert np.array_equal(rows, np.column_stack([np.arange(24.0).reshape(8, 3), np.full(8, 2.0), np.full(8, 3.0)]))
    assert ot.timed_out(after=0.0).rows(WORLDS, bodies=1).tolist() == [[0.0]]


def test_forces_are_a_list(device):
    for wrong, says in ((None, "forces is None; allowed: a list"), ([42], "forces has 42; allowed: functions")):
        with pytest.raises(ot.InputError, match=says):
            Simulation(bead_scene(), forces=wrong, device=device)


def test_a_bug_in_an_end_is_told_in_one_line(device):
    @ot.end
    def high(now: ot.WorldNow, height: float) -> bool:
        return now.state.position[now.world, 0][2]

    with pytest.raises(
        ot.InputError, match=r"end high \(.*test_ends.py:\d+\): Warp cannot compile it: .*annotated as `bool`"
    ):
        simulate(device, [high(height=1.0)])
