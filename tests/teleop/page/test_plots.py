from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import otwarp as ot
from otwarp.haptics.core import ServoFrame
from otwarp.teleop import HandFrame
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import Drawing
from otwarp.teleop.page.readout import MOST_CURVES, SPAN, History, Panel, panels, series_data, styles
from tests.teleop.page.frames import page_frame
from tests.teleop.page.test_browser import SCENE


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return compose(ot.Scene.load(SCENE))


def test_the_ring_remembers_its_span_and_no_more():
    history = History(1, span=1.0, bin=0.1)
    for k in range(37):
        history.add(0.1 * k + 0.05, [float(k)])
    time, values = history.arrays()
    assert time == pytest.approx(np.arange(-9, 1) * 0.1)
    assert values[0].tolist() == [float(k) for k in range(27, 37)]


def test_a_bin_keeps_its_largest_value():
    history = History(2, span=1.0, bin=0.5)
    for values in ((1.0, 5.0), (3.0, math.nan), (2.0, -math.inf)):
        history.add(10.1, values)
    assert history.arrays()[1][:, -1].tolist() == [3.0, 5.0]


def test_bins_without_a_frame_are_empty_and_a_long_gap_empties_all():
    history = History(1, span=1.0, bin=0.1)
    history.add(0.05, [1.0])
    history.add(0.45, [2.0])
    assert history.arrays()[1][0, -5:].tolist() == pytest.approx([1.0, math.nan, math.nan, math.nan, 2.0], nan_ok=True)
    history.add(99.0, [3.0])
    assert np.isfinite(history.arrays()[1]).sum() == 1


def test_what_is_pushed_has_no_nan_and_starts_with_the_first_value():
    panel = Panel("x", (("a", "#fff"), ("b", "#fff")), (("limit", 7.0, "#f00"),), lambda frame: (0.0, 0.0))
    history = History(2, span=1.0, bin=0.1)
    history.add(0.05, [1.0, math.nan])
    history.add(0.35, [2.0, 4.0])
    time, a, b, limit = series_data(panel, history)
    assert time == pytest.approx([-0.3, -0.2, -0.1, 0.0])
    assert a.tolist() == [1.0, 1.0, 1.0, 2.0] and b.tolist() == [0.0, 0.0, 0.0, 4.0]
    assert limit.tolist() == [7.0] * 4 and len(styles(panel)) == 4
    assert all(np.isfinite(column).all() and len(column) for column in series_data(panel, History(2)))


def test_the_plots_of_a_scene_carry_its_warning_lines(drawing: Drawing):
    force, contact, distance = panels(drawing, ())
    assert [line[1] for line in contact.lines] == [10.0]
    # the reach of the hub's trap: cut-off 3.5504 µm for the robot's 2.5 µm sphere, scaled to its own radius of 1.5 µm
    assert [line[1] for line in distance.lines] == [pytest.approx(3.5504 * 1.5 / 2.5), 1.0]
    assert force.lines == () and len(distance.curves) == 6
    frame = page_frame(
        np.zeros((6, 3)), 3, contact_load=np.array([1, 2, 3.0]), hand_force=np.array([[3, 4, 0], [0, 0, 2.0]])
    )
    assert force.read(frame) == [5.0, 2.0] and contact.read(frame) == [1.0, 2.0, 3.0]
    assert all(len(panel.read(frame)) == len(panel.curves) for panel in (force, contact, distance))


def test_hands_with_devices_show_their_force_and_energy(drawing: Drawing):
    now = ServoFrame(1, 0.0, (0, 0, 0), (0.3, 0.4, 0.0), (), "armed", 2e-3)
    left = HandFrame(name="left", device="haply", traps=(), motion_gain=1, force_gain=1, clamp=1, now=now)
    force, *_, energy = panels(drawing, ("left", "right"))
    assert force.read(page_frame(hands=(left,))) == pytest.approx([0.5, math.nan], nan_ok=True)
    assert energy.read(page_frame(hands=(left,))) == pytest.approx([2.0, math.nan], nan_ok=True)


def test_without_traps_there_is_nothing_to_plot_of_them(drawing: Drawing):
    assert [panel.title for panel in panels(dataclasses.replace(drawing, traps=()), ())] == ["Contact load [pN]"]


def test_a_crowd_gets_one_curve():
    crowd = compose(ot.Scene.load(SCENE.with_name("microfluidic_channel.usda")))
    contact = next(panel for panel in panels(crowd, ()) if "Contact" in panel.title)
    assert [label for label, _ in contact.curves] == ["robot", "largest of the others"]
    load = np.arange(len(crowd.names), dtype=float)[::-1].copy()
    assert contact.read(page_frame(bodies=len(load), contact_load=load)) == [load[0], load[1]]
    assert len(crowd.names) > MOST_CURVES and SPAN == 20.0
