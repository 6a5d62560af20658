from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.view import RecordedRun
from otwarp.view.curves import BINS, WINDOW, Chart, charts, series
from otwarp.view.source import Moments
from tests.view.runs import PEAK, PEAK_AT, RATE, SCENE, SPEED


def test_curves_of_a_run_say_what_was_recorded(run: Path):
    source = RecordedRun(run)
    load, distance, speed = charts(source)
    assert (load.key, distance.key, speed.key) == ("load", "distance", "speed")
    assert load.names == ("left", "right", "cell") and distance.names == ("left", "right")
    assert load.values[2, PEAK_AT] == pytest.approx(PEAK) and np.sum(load.values) == pytest.approx(PEAK)
    assert load.lines == (("warning 10 pN", 10.0),) and distance.lines[0][1] == 1.0
    reach = round(WINDOW * RATE)
    assert np.isnan(speed.values[:, :reach]).all()
    assert speed.values[:, reach:] == pytest.approx(SPEED, rel=1e-4)  # of places stored in single precision
    source.close()


class Long:
    """A long recording of which one moment is unlike all others."""

    title, about = "long", ()

    def __init__(self, count: int, peak_at: int):
        self.scene = ot.Scene.load(SCENE)
        self.time = np.arange(count) / 1000.0
        self.held = np.array([0, 0, 0, 1, 1, 1])
        self.peak_at, self.read = peak_at, []

    def frame(self, index: int):
        raise NotImplementedError

    def moments(self, which: slice) -> Moments:
        time = self.time[which]
        self.read.append(len(time))
        load = np.zeros((len(time), 3))
        load[np.isclose(time, self.time[self.peak_at]), 1] = 5.0
        place = np.zeros((len(time), 3, 3))
        place[:, 0, 0] = 2.0 * time
        return Moments(
            time=time,
            position=place,
            contact_load=load,
            trap_distance=np.ones((len(time), 6)),
            trap_power=np.ones((len(time), 6)),
            came_in=np.zeros((len(time), 3)),
        )


@pytest.mark.parametrize("peak_at", [0, 4095, 4096, 73_211, 99_999])
def test_a_peak_of_one_moment_of_a_hundred_thousand_is_still_drawn(peak_at: int):
    source = Long(100_000, peak_at)
    load, _, speed = charts(source)
    assert len(load.time) == 2 * BINS and np.all(np.diff(load.time) > 0.0)
    assert load.values[1].max() == 5.0
    at = load.time[np.argmax(load.values[1])]
    assert abs(at - source.time[peak_at]) <= (source.time[-1] + 1e-3) / BINS
    assert max(source.read) < 5000  # never the whole run at once
    # a speed does not jump where one block of moments ends and the next begins
    assert speed.values[0, 2:] == pytest.approx(2.0, rel=1e-6)


def test_where_a_body_came_in_again_it_has_no_speed():
    source = Long(2000, 0)
    whole = source.moments

    def moments(which: slice) -> Moments:
        found = whole(which)
        after = found.time >= 1.0
        found.position[after, 2, 1] += 50.0
        found.came_in[after, 2] += 1
        return found

    source.moments = moments
    speed = charts(source)[2]
    assert np.nanmax(speed.values[2]) == 0.0


def test_two_runs_share_a_time_axis():
    time = np.array([0.0, 1.0, 2.0])
    one = Chart(key="a", title="", names=("x",), time=time, values=np.array([[0.0, 1.0, 2.0]]), lines=(("w", 4.0),))
    two = Chart(key="a", title="", names=("x",), time=time[:2] + 0.5, values=np.array([[np.nan, 3.0]]))
    t, a, b, line = series([one, two])
    assert t.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert a.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert b.tolist() == [3.0] * 5 and line.tolist() == [4.0] * 5
