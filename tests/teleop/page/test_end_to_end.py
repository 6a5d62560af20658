"""`otwarp teleop` as a user has it: the real command in a process of its own, the page in a real browser."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.teleop.page.child import HAND_HANDLE, TRAP_HANDLE
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.controls import END, SURE, SURE_WITHIN
from tests.teleop.page.browser import ARTIFACTS, SIZE, browser, pixel

pytest.importorskip("viser")
pytest.importorskip("rosbags")

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "teleop_small.usda"
TRAP, HAND, ROBOT = 4, (3, 4, 5), 1
"""The right hub's trap, all traps of that hand, and their robot."""
SHORT, LONG = 10, 24
"""Pixels of the drags: of one trap, no farther than it can pull, and of a hand."""
STEPS, PAUSE = 6, 250
"""Moves of a drag, and milliseconds after each: a leap, and a trap may lose what it holds."""
PICKED = 2.0
"""Pixels by which a drag may differ from the way of the mouse, which takes the arrow by the middle of a pixel."""
ATTEMPTS = 20
"""Times that the end is asked for."""
PATIENCE = 240_000
"""Milliseconds after which something that must happen is called missing."""


@contextmanager
def session(*options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A running session: the address of its page, and its process."""
    command = [sys.executable, "-m", "otwarp", "teleop", str(SCENE), "--no-open", "--budget", "off", "--port", "0"]
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            said, _, url = process.stdout.readline().partition(" ")
            assert said == "page", "the session did not begin"
            yield url.split()[0], process
        finally:
            process.kill()


def places(recording: Path) -> dict[str, np.ndarray]:
    """Name of a frame of `/tf` → its (n, 3) places [µm]."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = {}
    with AnyReader([recording]) as reader:
        for connection, _, data in reader.messages([c for c in reader.connections if c.topic == "/tf"]):
            for one in reader.deserialize(data, connection.msgtype).transforms:
                place = one.transform.translation
                found.setdefault(one.child_frame_id, []).append((1e6 * place.x, 1e6 * place.y, 1e6 * place.z))
    return {name: np.array(rows) for name, rows in found.items()}


def end_session(window: Any) -> None:
    """Click on the end and on its question, anew where drawing was so slow that the page had forgotten the first."""
    from playwright.sync_api import TimeoutError as Late

    for _ in range(ATTEMPTS):
        window.get_by_role("button", name=END).click(timeout=PATIENCE)
        with suppress(Late):
            window.get_by_role("button", name=SURE).click(timeout=1e3 * SURE_WITHIN)
            return
    pytest.fail(f"the page never asked {SURE!r} long enough for a click")


def test_a_drag_in_the_browser_moves_a_trap_and_the_robot_follows(tmp_path: Path, device: str):
    scene, recording = ot.Scene.load(SCENE), tmp_path / "take.mcap"
    camera = compose(scene).camera
    size = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))
    place = np.array([trap.position.at(0.0) for trap in scene.traps])
    with browser() as chromium, session("--device", device, "--record", str(recording)) as (url, process):
        window = chromium.new_page(viewport=SIZE)
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(url + "?fixedDpr=0.8")
        window.get_by_text("Contact load [pN]").wait_for(timeout=PATIENCE)
        window.get_by_text("running at").wait_for(timeout=PATIENCE)
        box = window.locator("canvas").first.bounding_box()

        def drag(handle: np.ndarray, reach: float, way: int) -> float:
            """Pull a handle's red arrow to the right by pixels, let go of it; how far that is there [µm]."""
            x, y = pixel(camera, np.add(handle, (0.7 * reach * size, 0.0, 0.0)), box)
            window.mouse.move(x, y)
            window.wait_for_timeout(4 * PAUSE)
            window.mouse.down()
            for k in range(1, STEPS + 1):
                window.mouse.move(x + way * k / STEPS, y)
                window.wait_for_timeout(PAUSE)
            window.screenshot(path=ARTIFACTS / "teleop.png")
            window.mouse.up()
            window.wait_for_timeout(8 * PAUSE)  # the handle is left alone for a while, then follows its traps
            return way / (pixel(camera, np.add(handle, (1.0, 0.0, 0.0)), box)[0] - pixel(camera, handle, box)[0])

        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        alone = drag(place[TRAP], TRAP_HANDLE, SHORT)
        place[TRAP, 0] += alone
        together = drag(place[list(HAND)].mean(axis=0), HAND_HANDLE, LONG)
        end_session(window)
        assert process.wait(PATIENCE / 1e3) == 0
        assert process.stdout is not None and "recorded" in process.stdout.read() and errors == []

    path = places(recording)
    traps = np.array([path[trap.prim.strip("/")] for trap in scene.traps])
    robot = path[scene.bodies[ROBOT].prim.strip("/")]
    way = traps - traps[:, :1]
    others = [k for k in range(len(traps)) if k not in HAND]
    assert np.abs(way[others]).max() == 0.0 and np.abs(way[..., 1:]).max() < 1e-5  # along the arrow alone
    about = {"abs": PICKED * together / LONG}
    assert way[:, -1, 0][[TRAP]] == pytest.approx(alone + together, **about)
    assert way[:, -1, 0][[HAND[0], HAND[2]]] == pytest.approx(together, **about)
    before = np.flatnonzero(np.abs(way[HAND[0], :, 0]) < 1e-6)[-1]  # the last frame with one trap moved
    assert way[TRAP, before, 0] == pytest.approx(alone, **about)
    assert robot[before, 0] - robot[0, 0] > 0.15 * alone > 0.1
    assert robot[-1, 0] - robot[0, 0] > 0.8 * together > 1.0
