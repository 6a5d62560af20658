"""What the page draws of a camera: images, outlines, ellipses, and texts that are escaped."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np

from otwarp.teleop.page.camera_panel import EVERY, LOST, PLACE, SEEN, SIDE, CameraPanel, drawn, text
from otwarp.teleop.perception import BodyNow, PerceptionNow


def body(**more) -> BodyNow:
    levels = np.full((32, 32), 90, dtype=np.uint8)
    levels[4, 20] = 250  # a bright pixel in the lower right
    given = {
        "body": 0, "name": "/World/bead", "why": "", "deviation": (0.002, 0.003, 0.05), "levels": levels,
        "outline": np.array([[16.0, 16.0, 8.0]]), "spread": np.diag([4.0, 1.0]),
    }  # fmt: skip
    return BodyNow(**(given | more))


def where(image: np.ndarray, colour) -> np.ndarray:
    return np.argwhere(np.all(image == np.array(colour, dtype=np.uint8), axis=-1))


def test_an_outline_is_where_the_body_is():
    image, scale = drawn(body()), SIDE / 32
    assert image.shape == (SIDE, SIDE, 3)
    # pixel (20, 4) of rows that count from below
    bright = np.argwhere(np.all(image == 220, axis=-1)).mean(axis=0) + 0.5
    assert np.allclose(bright, [SIDE - 4.5 * scale, 20.5 * scale], atol=1.0)
    middle = np.array([SIDE - (16.5 * scale), 16.5 * scale])
    away = np.linalg.norm(where(image, SEEN) + 0.5 - middle, axis=1)
    assert np.abs(away - 8.0 * scale).max() < 1.0 and len(away) > 100
    ellipse = where(image, PLACE) + 0.5 - middle
    # two deviations of 2 and 1 pixels
    assert abs(np.abs(ellipse[:, 1]).max() - 4.0 * scale) < 2.0 and abs(np.abs(ellipse[:, 0]).max() - 2.0 * scale) < 2.0


def test_what_is_lost_is_red_and_what_was_never_seen_is_dark():
    lost = drawn(body(why="no measurement"))
    assert len(where(lost, LOST)) > 100 and not len(where(lost, SEEN))
    assert drawn(body(levels=None, outline=None, spread=None)).max() < 30
    assert not len(where(drawn(body(outline=None, spread=None)), SEEN))


def test_texts_are_escaped():
    evil = "<img src=x>"
    said = text(PerceptionNow(camera="top", ended="", rate=12.3, bodies=(body(), body(name="b", why=evil))))
    assert "12.3 /s" in said and "± 2, 3, 50 nm" in said and "&lt;img" in said and "<img" not in said


def test_the_panel_comes_with_the_first_frame_and_is_updated_a_few_times_a_second():
    made: list[SimpleNamespace] = []

    def add(content, **_):
        made.append(SimpleNamespace(image=content, content=content))
        return made[-1]

    gui = SimpleNamespace(add_folder=lambda name: nullcontext(), add_image=add, add_html=add)
    panel = CameraPanel(SimpleNamespace(gui=gui))  # type: ignore[arg-type]
    panel.update(None, 0.0)
    assert not made
    now = PerceptionNow(camera="top", ended="", rate=10.0, bodies=(body(), body()))
    panel.update(now, 1.0)
    assert made[0].image.shape == (SIDE, 2 * SIDE, 3)
    first = made[0].image
    panel.update(now, 1.0 + 0.5 * EVERY)
    assert made[0].image is first
    panel.update(PerceptionNow(camera="top", ended="over", rate=0.0, bodies=(body(),)), 1.0 + 1.1 * EVERY)
    assert made[0].image.shape == (SIDE, SIDE, 3) and "over" in made[1].content
