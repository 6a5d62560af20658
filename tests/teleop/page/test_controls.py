"""Every button and slider of the page: what it asks of the session, what it shows of a frame; no viser, no browser."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from otwarp import teleop as c
from otwarp.scene import Scene
from otwarp.teleop import HandFrame, PaceNow
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.controls import END, SURE, SURE_WITHIN, Controls
from tests.teleop.page.frames import page_frame
from tests.teleop.page.test_browser import SCENE

HANDS = tuple(
    HandFrame(name=name, device="virtual:hold", traps=(), motion_gain=200.0, force_gain=0.1, clamp=3.0, present=True)
    for name in ("left", "right")
)


class Thing:
    """A control of viser's GUI that keeps its callback."""

    def __init__(self, label: str, value: Any = None, **more: Any):
        self.label, self.value, self.visible, self.content = label, value, more.get("visible", True), ""
        self.min, self.max, self.step = more.get("ends", (0.0, 0.0, 0.0))
        self.act: Callable[[Any], Any] | None = None

    def on_click(self, act: Callable[[Any], Any]) -> None:
        self.act = act

    on_update = on_click

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...


class Gui:
    """viser's GUI, as far as it is used; controls by the label that they were made with."""

    def __init__(self) -> None:
        self.things: dict[str, list[Thing]] = {}

    def _add(self, label: str, *values: Any, **more: Any) -> Thing:
        thing = Thing(label, *values, **more)
        self.things.setdefault(label, []).append(thing)
        return thing

    def add_button(self, label: str, **more: Any) -> Thing:
        return self._add(label, visible=more.get("visible", True))

    def add_html(self, text: str) -> Thing:
        return self._add("html", text)

    def add_folder(self, label: str, **more: Any) -> Thing:
        return self._add(label, visible=more.get("visible", True))

    def add_slider(self, label: str, low: float, high: float, step: float, value: float, **_: Any) -> Thing:
        return self._add(label, value, ends=(low, high, step))

    def add_text(self, label: str, value: str, **_: Any) -> Thing:
        return self._add(label, value)

    def add_checkbox(self, label: str, value: bool) -> Thing:
        return self._add(label, value)

    def add_dropdown(self, label: str, _: Any, initial_value: str, **__: Any) -> Thing:
        return self._add(label, initial_value)


class Stand:
    """Controls of the small scene, and what came of them."""

    def __init__(self) -> None:
        self.gui, self.asked, self.told, self.now = Gui(), [], [], 0.0
        self.view = SimpleNamespace(arrow_scale=1.0, trap_forces=True, contact_forces=True, beams=True)
        self.gizmos, self.pictures = SimpleNamespace(mode="both"), []
        drawing = compose(Scene.load(SCENE))
        self.powers = np.array([trap.power for trap in drawing.traps])
        self.controls = Controls(
            SimpleNamespace(gui=self.gui),  # type: ignore[arg-type]
            drawing,
            self.view,  # type: ignore[arg-type]
            self.gizmos,  # type: ignore[arg-type]
            post=lambda work: work(),
            ask=self.asked.append,
            tell=self.told.append,
            clock=lambda: self.now,
            screenshot=self.pictures.append,
        )

    def thing(self, label: str, n: int = 0) -> Thing:
        return self.gui.things[label][n]

    def show(self, after: float = 10.0, **more: Any) -> None:
        self.now += after
        frame = page_frame(np.zeros((len(self.powers), 3)), trap_power=self.powers, hands=HANDS, **more)
        self.controls.update(frame, self.now, 30.0, None, 1)

    def click(self, label: str, n: int = 0) -> list[Any]:
        """What a click asks for."""
        return self._done(self.thing(label, n), SimpleNamespace(client="window", client_id=1))

    def slide(self, label: str, value: Any, n: int = 0, client: int | None = 1) -> list[Any]:
        """What is asked for when a window, or the server itself, sets a value."""
        self.thing(label, n).value = value
        return self._done(self.thing(label, n), SimpleNamespace(client_id=client))

    def _done(self, thing: Thing, event: Any) -> list[Any]:
        before = len(self.asked)
        assert thing.act is not None
        done = thing.act(event)
        if done is not None:
            asyncio.run(done)
        return self.asked[before:]


@pytest.fixture
def stand() -> Stand:
    stand = Stand()
    stand.show()
    return stand


def test_buttons_of_the_session(stand: Stand):
    assert stand.click("Pause") == [c.Pause(True)]
    stand.show(pace=PaceNow(paused=True))
    assert stand.thing("Pause").label == "Go on" and stand.click("Pause") == [c.Pause(False)]
    assert stand.click("Reset") == [c.Reset()]
    assert stand.slide("Speed", 0.25) == [c.SetSpeed(0.25)]
    assert stand.slide("Speed", 0.5, client=None) == []  # the server set it
    stand.click("Screenshot")
    assert stand.pictures == ["window"]


def test_a_recording_is_begun_and_ended(stand: Stand):
    assert stand.click("Record") == [c.Record(True, None)]
    stand.thing("File").value = "take1"
    assert stand.click("Record") == [c.Record(True, "take1.mcap")]
    stand.show(recording="/lab/take1.mcap")
    assert stand.thing("Record").label == "Stop recording" and stand.click("Record") == [c.Record(False, None)]
    stand.show()
    stand.thing("File").value = "../take1"
    assert stand.click("Record") == [] and "must be a plain name" in stand.told[0]


def test_the_session_ends_by_two_clicks_that_follow_each_other(stand: Stand):
    assert stand.click(END) == [] and stand.thing(END).label == SURE
    stand.show(after=0.5 * SURE_WITHIN)
    assert stand.thing(END).label == SURE
    stand.show(after=SURE_WITHIN)  # a click that nobody repeated is forgotten
    assert stand.thing(END).label == END and stand.click(END) == []
    stand.now += 0.5 * SURE_WITHIN
    assert stand.click(END) == [c.Stop()]


def test_power_of_all_traps_and_of_each_hand(stand: Stand):
    traps = {label: thing for label, thing in stand.gui.things.items() if label.endswith("[mW]")}
    assert set(traps) == {"All traps [mW]", "Left [mW]", "Right [mW]"}
    assert stand.slide("All traps [mW]", 3.0) == [c.SetPower(3.0, ())]
    assert stand.slide("Right [mW]", 4.0) == [c.SetPower(4.0, (3, 4, 5))]
    stand.powers[:] = 7.0
    stand.show()
    assert [thing[0].value for thing in traps.values()] == pytest.approx([7.0] * 3, abs=0.1)


def test_a_hand_is_armed_disarmed_and_scaled(stand: Stand):
    assert stand.thing("Hands").visible and stand.thing("Disarm all").visible
    assert stand.click("Arm", 0) == [c.Arm("left")] and stand.click("Disarm", 1) == [c.Disarm("right")]
    assert stand.click("Disarm all") == [c.Disarm()]
    (motion,) = stand.slide("Motion gain, log₁₀", 2.5, 1)
    assert (motion.hand, motion.force_gain) == ("right", None) and motion.motion_gain == pytest.approx(10.0**2.5)
    (force,) = stand.slide("Force gain, log₁₀", -2.0, 0)
    assert (force.hand, force.motion_gain) == ("left", None) and force.force_gain == pytest.approx(0.01)
    stand.show()
    assert stand.thing("Motion gain, log₁₀", 1).value == pytest.approx(math.log10(200.0), abs=0.01)


def test_without_a_hand_there_is_nothing_to_arm():
    stand = Stand()
    assert not stand.thing("Hands").visible and not stand.thing("Disarm all").visible


def test_the_view_is_the_pages_own_matter(stand: Stand):
    assert stand.slide("Handles", "traps") == [] and stand.gizmos.mode == "traps"
    stand.slide("Arrows, log₁₀", -1.0)
    assert stand.view.arrow_scale == pytest.approx(0.1)
    for label, name in (("Trap forces", "trap_forces"), ("Contact forces", "contact_forces"), ("Beams", "beams")):
        assert stand.slide(label, False) == [] and getattr(stand.view, name) is False


def test_the_task_stands_above_the_warnings(stand: Stand):
    stand.show(task="cell is 3.2 µm from the goal", warnings=("left hub has lost its sphere",))
    text = stand.thing("html").content
    assert 0 < text.index("3.2 µm from the goal") < text.index("⚠ left hub")
