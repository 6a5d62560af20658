from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from otwarp.teleop.page.compose import compose
from otwarp.view import RecordedRun
from otwarp.view.sight import PRESETS, Look, legend, length_text, pixels_per_micrometre, preset, round_length


@pytest.mark.parametrize("aspect", [2.0, 0.5])
@pytest.mark.parametrize("name", [name for name in PRESETS if name != "stage"])
def test_presets_have_what_they_promise_in_view(run: Path, name: str, aspect: float):
    source = RecordedRun(run)
    drawing, frame = compose(source.scene), source.frame(0)
    look = preset(name, drawing, frame, aspect)
    eye, forward = np.array(look.position), np.subtract(look.look_at, look.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    wanted = frame.position[drawing.robots] if name == "close" else frame.position
    high = math.tan(0.5 * drawing.camera.fov)
    for place in wanted:
        way = place - eye
        assert abs(way @ up / (way @ forward)) < high and abs(way @ right / (way @ forward)) < high * aspect
    source.close()


def test_from_above_the_front_and_the_side(run: Path):
    source = RecordedRun(run)
    drawing, frame = compose(source.scene), source.frame(0)
    for name, axis in {"top": (0, 0, -1), "front": (0, 1, 0), "side": (-1, 0, 0)}.items():
        look = preset(name, drawing, frame)
        way = np.subtract(look.look_at, look.position)
        assert way / np.linalg.norm(way) == pytest.approx(axis, abs=2e-3)
    assert preset("stage", drawing, frame).position == drawing.camera.position
    source.close()


def test_the_scale_bar_is_a_round_length_of_the_plane_that_is_looked_at():
    look = Look((0.0, 0.0, 100.0), (0.0, 0.0, 0.0))
    per = pixels_per_micrometre(look, math.radians(60.0), 600.0)
    assert per == pytest.approx(600.0 / (2.0 * 100.0 * math.tan(math.radians(30.0))))
    for scale in np.geomspace(1e-3, 1e4, 97):
        length = round_length(float(scale))
        assert 0.4 * 120.0 - 1e-6 <= length * scale <= 120.0 + 1e-6
        digit = length / 10.0 ** math.floor(math.log10(length) + 1e-9)
        assert min(abs(digit - k) for k in (1.0, 2.0, 5.0)) < 1e-6
    assert [length_text(x) for x in (0.2, 5.0, 2000.0)] == ["200 nm", "5 µm", "2 mm"]


def test_the_legend_names_what_is_drawn(run: Path):
    source = RecordedRun(run)
    text = legend(source.scene, compose(source.scene), 2.0, "a <b>")
    for word in ("left", "right", "cell", "trap, left hand", "contact force", "2 µm per pN", "a &lt;b&gt;"):
        assert word in text
    source.close()
