"""The page in headless Chromium, steering a real simulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.teleop.commands import MoveTraps, Pause
from otwarp.teleop.page.child import HAND_HANDLE, TRAP_HANDLE
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.process import PageProcess
from tests.teleop.page.browser import ARTIFACTS, SIZE, browser, pixel
from tests.teleop.page.loop import Loop

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "teleop_small.usda"
TRAP, HAND = 4, (3, 4, 5)
"""The right hub's trap, and all traps of that hand."""
STEP = 1.0 / 60.0
TURNS = 300
"""Turns of the loop within which anything must have happened: 25 s of simulated time, not of the clock."""
SHORT, LONG = 20, 60
"""Pixels of the drags: of one trap, no farther than it can pull, and of a hand."""
PICKED = 3.0
"""Pixels by which a drag may differ from the way of the mouse, which takes the arrow by the middle of a pixel."""


def turn_until(window: Any, loop: Loop, page: PageProcess, done: Callable[[], bool], pause: int = 15) -> bool:
    for _ in range(TURNS):
        loop.obey(page.commands())
        loop.advance(STEP)
        page.publish(loop.frame())
        window.wait_for_timeout(pause)
        if done():
            return True
    return False


def turn(window: Any, loop: Loop, page: PageProcess, times: int) -> None:
    left = iter(range(times))
    turn_until(window, loop, page, lambda: next(left, None) is None)


def settle(window: Any, loop: Loop, page: PageProcess) -> None:
    """Turn until the browser has shown what was published and nothing new is asked: it draws a few frames a second."""
    asked = -1
    while asked != len(loop.asked):
        asked = len(loop.asked)
        turn(window, loop, page, 60)


def test_a_drag_moves_a_trap_and_the_robot_follows(device: str):
    scene = ot.Scene.load(SCENE)
    camera = compose(scene).camera
    loop = Loop(scene, device=device)
    with browser() as chromium, PageProcess(scene, port=0) as page:
        window = chromium.new_page(viewport=SIZE)
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(page.url)
        window.get_by_text("Session", exact=True).wait_for()
        shown = window.get_by_text("Contact load [pN]")
        assert turn_until(window, loop, page, lambda: page.visitors == 1 and loop.beat > 60 and shown.is_visible())
        assert loop.asked == []  # nobody touched anything
        start, robot = loop.places.copy(), loop.frame().frame.position[0, 1].copy()

        box = window.locator("canvas").first.bounding_box()
        size = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))

        def drag(handle: np.ndarray, reach: float, way: int) -> list[MoveTraps]:
            """Pull a handle's red arrow to the right; what was asked meanwhile."""
            before = len(loop.asked)
            x, y = pixel(camera, np.add(handle, (0.7 * reach * size, 0.0, 0.0)), box)
            window.mouse.move(x, y)
            settle(window, loop, page)
            window.mouse.down()
            for k in range(1, 7):
                window.mouse.move(x + way * k / 6, y)
                turn(window, loop, page, 4)
            window.mouse.up()
            assert turn_until(window, loop, page, lambda: len(loop.asked) > before)
            settle(window, loop, page)
            asked = loop.asked[before:]
            assert asked and all(isinstance(command, MoveTraps) for command in asked)
            return asked  # type: ignore[return-value]

        for handle, reach, way, traps in (
            (start[TRAP], TRAP_HANDLE, SHORT, (TRAP,)),
            (None, HAND_HANDLE, LONG, HAND),
        ):
            old = loop.places.copy()
            moves = drag(old[list(traps)].mean(axis=0) if handle is None else handle, reach, way)
            assert all(set(move.positions) == set(traps) for move in moves)
            new = old.copy()
            for k, place in moves[-1].positions.items():
                new[k] = place
            shift = (new - old)[list(traps)]
            # along the arrow's axis alone, all alike, by the way of the mouse
            assert shift[:, 1:] == pytest.approx(0.0, abs=1e-5)
            assert shift[:, 0] == pytest.approx(shift[0, 0], abs=1e-5)
            centre = old[list(traps)].mean(axis=0)
            seen = pixel(camera, centre + shift[0], box)[0] - pixel(camera, centre, box)[0]
            assert seen == pytest.approx(way, abs=PICKED)
            # nothing is fed back: the traps are where they were put, and stay
            assert loop.places == pytest.approx(new, abs=1e-5)
        followed = loop.frame().frame.position[0, 1, 0] - robot[0]
        assert followed > 0.8 * shift[0, 0] > 1.0

        window.get_by_role("button", name="Pause").click()
        assert turn_until(window, loop, page, lambda: loop.paused)
        assert loop.asked[-1] == Pause(True)
        assert turn_until(window, loop, page, lambda: window.get_by_role("button", name="Go on").is_visible())
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "page.png")
        assert errors == []
        window.close()
        assert turn_until(window_of(chromium), loop, page, lambda: page.visitors == 0)


def window_of(chromium: Any) -> Any:
    """A window that looks at nothing, to wait in."""
    return chromium.new_page()
