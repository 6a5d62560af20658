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
from otwarp.teleop import HandFrame, MoveTraps, Pause
from otwarp.teleop.page import PageProcess
from otwarp.teleop.page.child import HAND_HANDLE, TRAP_HANDLE
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.gizmos import DEAD_MAN
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


class Visit:
    """A window of the browser at the page of a loop, which a test turns.

    Args:
        window: At the page.
        loop, page: Behind it.
    """

    def __init__(self, window: Any, loop: Loop, page: PageProcess):
        self.window, self.loop, self.page = window, loop, page
        self._camera = compose(loop.sim.scene).camera
        self._size = float(np.linalg.norm(np.subtract(self._camera.position, self._camera.look_at)))

    def turn_until(self, done: Callable[[], bool], pause: int = 15) -> bool:
        for _ in range(TURNS):
            self.loop.obey(self.page.commands())
            self.loop.advance(STEP)
            self.page.publish(self.loop.frame())
            self.window.wait_for_timeout(pause)
            if done():
                return True
        return False

    def turn(self, times: int) -> None:
        left = iter(range(times))
        self.turn_until(lambda: next(left, None) is None)

    def settle(self) -> None:
        """Turn until the browser has shown what was published and nothing new is asked: it draws a few frames a
        second."""
        asked = -1
        while asked != len(self.loop.asked):
            asked = len(self.loop.asked)
            self.turn(25)

    def pixel(self, place: np.ndarray) -> tuple[float, float]:
        return pixel(self._camera, place, self.window.locator("canvas").first.bounding_box())

    def drag(self, handle: np.ndarray, reach: float, way: int, shift: Callable[[], float]) -> list[Any]:
        """Pull a handle's red arrow to the right until what it moves has gone as far; what was asked meanwhile.

        Args:
            handle: Its place [µm].
            reach: Its size over the distance of the camera.
            way: Of the mouse [pixels].
            shift: How far that has gone which it moves [µm].
        """
        before = len(self.loop.asked)
        x, y = self.pixel(np.add(handle, (0.7 * reach * self._size, 0.0, 0.0)))
        self.window.mouse.move(x, y)
        self.settle()
        self.window.mouse.down()
        for k in range(1, 5):
            self.window.mouse.move(x + way * k / 4, y)
            self.turn(4)
        self.window.mouse.up()

        def gone() -> float:
            """On the screen, to the right [pixels]."""
            return self.pixel(np.add(handle, (shift(), 0.0, 0.0)))[0] - self.pixel(handle)[0]

        assert self.turn_until(lambda: abs(gone() - way) < PICKED)
        self.settle()
        return self.loop.asked[before:]

    def drag_traps(self, traps: tuple[int, ...], reach: float, way: int) -> float:
        """Drag traps by their handle, and see that they went along the arrow alone, all alike; how far [µm]."""
        loop = self.loop
        old = loop.places.copy()
        moves = self.drag(
            old[list(traps)].mean(axis=0), reach, way, lambda: loop.targets[traps[0], 0] - old[traps[0], 0]
        )
        assert moves and all(isinstance(move, MoveTraps) and set(move.positions) == set(traps) for move in moves)
        new = old.copy()
        for k, place in moves[-1].positions.items():
            new[k] = place
        shift = (new - old)[list(traps)]
        assert shift[:, 1:] == pytest.approx(0.0, abs=1e-5)
        assert shift[:, 0] == pytest.approx(shift[0, 0], abs=1e-5)
        # nothing is fed back: the traps are where they were put, and stay
        assert loop.places == pytest.approx(new, abs=1e-5)
        return shift[0, 0]

    def drag_hand(self, pointer: Mailbox[tuple[float, ...]]) -> None:
        """Drag the page's own hand: no command, its pointer is told to go where the handle went."""
        words = [pointer.read()]
        assert words[0] is not None and words[0][:3] == (0.0, 0.0, 0.0) and words[0][3] == DEAD_MAN

        def told() -> float:
            """How far the hand's traps shall go, by what the servo is told [µm]."""
            words.append(pointer.read() or words[-1])
            return GAIN * words[-1][0]

        assert self.drag(self.loop.places[list(LEFT)].mean(axis=0), HAND_HANDLE, SHORT, told) == []
        assert words[-1][1:3] == pytest.approx((0.0, 0.0), abs=1e-9) and words[-1][3] == DEAD_MAN


@pytest.mark.thorough
def test_a_drag_moves_a_trap_and_the_robot_follows(device: str):
    scene = ot.Scene.load(SCENE)
    loop = Loop(scene, device=device)
    hand = {"name": "left", "device": "mouse", "traps": LEFT, "motion_gain": GAIN, "force_gain": 0.05, "clamp": 3.3}
    loop.hands = (HandFrame(**hand, present=True),)
    with (
        browser() as chromium,
        Mailbox.create(POINTER) as pointer,
        PageProcess(scene, port=0, pointers={"left": pointer.name}) as page,
    ):
        window = chromium.new_page(viewport=SIZE)
        visit = Visit(window, loop, page)
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(page.url + "?fixedDpr=0.8")
        window.get_by_text("Session", exact=True).wait_for()
        shown = window.get_by_text("Contact load [pN]")
        assert visit.turn_until(lambda: page.visitors == 1 and loop.beat > 10 and shown.is_visible())
        assert loop.asked == []  # nobody touched anything

        robot = loop.frame().frame.position[0, 1].copy()
        visit.drag_traps((TRAP,), TRAP_HANDLE, SHORT)
        shift = visit.drag_traps(HAND, HAND_HANDLE, LONG)
        assert loop.frame().frame.position[0, 1, 0] - robot[0] > 0.8 * shift > 1.0

        page.complain("no such trap: 9")
        assert visit.turn_until(lambda: window.get_by_text("no such trap: 9").is_visible())
        visit.drag_hand(pointer)

        window.get_by_role("button", name="Pause").click()
        assert visit.turn_until(lambda: loop.paused)
        assert loop.asked[-1] == Pause(True)
        assert visit.turn_until(lambda: window.get_by_role("button", name="Go on").is_visible())
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "page.png")
        assert errors == []
        window.close()
        elsewhere = Visit(chromium.new_page(), loop, page)
        assert elsewhere.turn_until(lambda: page.visitors == 0)
        pointer.read()  # the last word that was written
        elsewhere.turn(30)
        assert pointer.read() is None  # nobody looks: nobody holds the dead-man switch
