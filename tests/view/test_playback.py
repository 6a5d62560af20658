from __future__ import annotations

import numpy as np
import pytest

from otwarp.view.playback import SPEEDS, Playback

TIME = np.arange(11) / 10.0


def test_it_plays_at_the_speed_chosen_and_stops_at_the_end():
    playback = Playback(TIME)
    assert not playback.tick(100.0) and playback.index == 0
    playback.toggle()
    playback.tick(100.0)
    assert playback.tick(100.25) and playback.time == pytest.approx(0.25) and playback.index == 2
    playback.speed = 2.0
    playback.tick(100.45)
    assert playback.time == pytest.approx(0.65)
    assert playback.tick(101.0) and not playback.playing and playback.time == 1.0 and playback.index == 10
    playback.toggle()  # from the end on it begins anew
    assert playback.playing and playback.time == 0.0


def test_time_that_passed_while_it_stood_still_does_not_count():
    playback = Playback(TIME)
    playback.toggle()
    playback.tick(0.0)
    playback.tick(0.1)
    playback.toggle()
    playback.tick(50.0)
    playback.toggle()
    playback.tick(99.0)
    assert playback.time == pytest.approx(0.1)


def test_it_may_go_round():
    playback = Playback(TIME)
    playback.loop = True
    playback.toggle()
    playback.tick(0.0)
    playback.tick(2.3)
    assert playback.playing and playback.time == pytest.approx(0.3)


def test_steps_and_places():
    playback = Playback(TIME)
    playback.step(3)
    assert playback.time == pytest.approx(0.3) and playback.index == 3 and not playback.playing
    playback.step(-9)
    assert playback.index == 0
    playback.seek(7.0)
    assert playback.index == 10
    playback.seek(0.7)  # which is 7 · 0.1 but for rounding
    assert playback.index == 7
    playback.faster(1)
    assert playback.speed == 2.0
    for _ in SPEEDS:
        playback.faster(1)
    assert playback.speed == SPEEDS[-1]


def test_a_recording_of_one_moment_stands_still():
    playback = Playback(np.array([0.5]))
    playback.loop = True
    playback.toggle()
    playback.tick(0.0)
    playback.tick(1.0)
    assert playback.time == 0.5
