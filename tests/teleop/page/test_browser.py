"""The page in headless Chromium, steering a real simulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices.mouse import POINTER
from otwarp.teleop.core import HandFrame, MoveTraps, Pause
from otwarp.teleop.page.child import HAND_HANDLE, TRAP_HANDLE
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.gizmos import DEAD_MAN
from otwarp.teleop.page.process import PageProcess
from tests.teleop.page.browser import ARTIFACTS, SIZE, browser, pixel
from tests.teleop.page.loop import Loop

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "teleop_small.usda"
TRAP, HAND, LEFT = 4, (3, 4, 5), (0, 1, 2)
"""The right hub's trap, all traps of that hand, and those of the other, which the page moves."""
GAIN = 200.0
"""Of the left hand [µm/m]."""
STEP = 1.0 / 60.0
TURNS = 3000
"""Turns of the loop within which anything must have happened: 50 s of simulated time, not of the clock."""
SHORT, LONG = 10, 60
"""Pixels of the drags: of one trap, no farther than it can pull, and of a hand."""
PICKED = 2.0
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
        turn(window, loop, page, 25)


def test_a_drag_moves_a_trap_and_the_robot_follows(device: str):
    scene = ot.Scene.load(SCENE)
    camera = compose(scene).camera
    loop = Loop(scene, device=device)
    hand = {"name": "left", "device": "mouse", "traps": LEFT, "motion_gain": GAIN, "force_gain": 0.05, "clamp": 3.3}
    loop.hands = (HandFrame(**hand, present=True),)
    with (
        browser() as chromium,
        Mailbox.create(POINTER) as pointer,
        PageProcess(scene, port=0, pointers={"left": pointer.name}) as page,
    ):
        window = chromium.new_page(viewport=SIZE)
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(page.url + "?fixedDpr=0.8")
        window.get_by_text("Session", exact=True).wait_for()
        shown = window.get_by_text("Contact load [pN]")
        assert turn_until(window, loop, page, lambda: page.visitors == 1 and loop.beat > 10 and shown.is_visible())
        assert loop.asked == []  # nobody touched anything
        robot = loop.frame().frame.position[0, 1].copy()

        box = window.locator("canvas").first.bounding_box()
        size = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))

        def seen(centre: np.ndarray, shift: float) -> float:
            """Pixels that something there moves on the screen when it moves to the right by so many µm."""
            return pixel(camera, np.add(centre, (shift, 0.0, 0.0)), box)[0] - pixel(camera, centre, box)[0]

        def drag(handle: np.ndarray, reach: float, way: int, shift: Callable[[], float]) -> list[Any]:
            """Pull a handle's red arrow to the right until what it moves has gone as far; what was asked meanwhile."""
            before = len(loop.asked)
            x, y = pixel(camera, np.add(handle, (0.7 * reach * size, 0.0, 0.0)), box)
            window.mouse.move(x, y)
            settle(window, loop, page)
            window.mouse.down()
            for k in range(1, 5):
                window.mouse.move(x + way * k / 4, y)
                turn(window, loop, page, 4)
            window.mouse.up()
            assert turn_until(window, loop, page, lambda: abs(seen(handle, shift()) - way) < PICKED)
            settle(window, loop, page)
            return loop.asked[before:]

        for reach, way, traps in ((TRAP_HANDLE, SHORT, (TRAP,)), (HAND_HANDLE, LONG, HAND)):
            old = loop.places.copy()
            centre = old[list(traps)].mean(axis=0)
            moves = drag(centre, reach, way, lambda k=traps[0], old=old: loop.targets[k, 0] - old[k, 0])
            assert moves and all(isinstance(move, MoveTraps) and set(move.positions) == set(traps) for move in moves)
            new = old.copy()
            for k, place in moves[-1].positions.items():
                new[k] = place
            shift = (new - old)[list(traps)]
            # along the arrow's axis alone, all alike, by the way of the mouse
            assert shift[:, 1:] == pytest.approx(0.0, abs=1e-5)
            assert shift[:, 0] == pytest.approx(shift[0, 0], abs=1e-5)
            # nothing is fed back: the traps are where they were put, and stay
            assert loop.places == pytest.approx(new, abs=1e-5)
        followed = loop.frame().frame.position[0, 1, 0] - robot[0]
        assert followed > 0.8 * shift[0, 0] > 1.0

        page.complain("no such trap: 9")
        assert turn_until(window, loop, page, lambda: window.get_by_text("no such trap: 9").is_visible())

        # the page's own hand: no command, its pointer is told to go where the handle went
        words = [pointer.read()]
        assert words[0] is not None and words[0][:3] == (0.0, 0.0, 0.0) and words[0][3] == DEAD_MAN

        def told() -> float:
            """How far the hand's traps shall go, by what the servo is told [µm]."""
            words.append(pointer.read() or words[-1])
            return GAIN * words[-1][0]

        assert drag(loop.places[list(LEFT)].mean(axis=0), HAND_HANDLE, SHORT, told) == []
        assert words[-1][1:3] == pytest.approx((0.0, 0.0), abs=1e-9) and words[-1][3] == DEAD_MAN

        window.get_by_role("button", name="Pause").click()
        assert turn_until(window, loop, page, lambda: loop.paused)
        assert loop.asked[-1] == Pause(True)
        assert turn_until(window, loop, page, lambda: window.get_by_role("button", name="Go on").is_visible())
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "page.png")
        assert errors == []
        window.close()
        elsewhere = chromium.new_page()
        assert turn_until(elsewhere, loop, page, lambda: page.visitors == 0)
        pointer.read()  # the last word that was written
        turn(elsewhere, loop, page, 30)
        assert pointer.read() is None  # nobody looks: nobody holds the dead-man switch
