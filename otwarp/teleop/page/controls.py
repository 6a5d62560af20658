"""Buttons, sliders and texts of the page; what a user does becomes a command, what a frame says becomes a value."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from otwarp.haptics.core import Vec3
from otwarp.teleop import (
    HANDS,
    Arm,
    Command,
    Disarm,
    HandFrame,
    Pause,
    Record,
    Reset,
    SetGains,
    SetPower,
    SetSpeed,
    Stop,
    vec3,
)
from otwarp.teleop.page.gizmos import MODES, Gizmos
from otwarp.teleop.page.protocol import Drawing, PageFrame
from otwarp.teleop.page.readout import banner, figures, hand_text
from otwarp.teleop.page.scene_view import SceneView

if TYPE_CHECKING:
    import viser

HOLD = 1.0
"""Seconds after a user moved a slider in which frames do not move it."""
TEXT_INTERVAL = 0.25
"""Seconds between two renewals of the figures: faster, nobody reads them."""
SPEEDS = (0.05, 2.0)
MOTION_DECADES, FORCE_DECADES, ARROW_DECADES = (0.0, 4.0), (-4.0, 2.0), (-2.0, 2.0)
"""Ends of the logarithmic sliders: log₁₀ of µm/m, N/pN and µm/pN."""
SURE_WITHIN = 4.0
"""Seconds after the first click on the button that ends the session in which a second one does."""
END, SURE = "End session", "Really end?"
"""Labels of that button."""
_FILE = re.compile(r"[\w-][\w .-]*")

Post = Callable[[Callable[[], None]], None]


class Follower:
    """A slider that users move and frames follow, without the one stirring up the other."""

    def __init__(self, handle: Any):
        self.handle = handle
        self._moved = -math.inf

    def touched(self, now: float) -> None:
        """A user moved the control at `now` [s]."""
        self._moved = now

    def follow(self, value: float, now: float) -> None:
        """A frame says what it is; ignored shortly after a user said otherwise, and where it would make no step."""
        low, high, step = self.handle.min, self.handle.max, self.handle.step
        if not math.isnan(value):
            value = _stepped(min(max(value, low), high), step)
        if now - self._moved >= HOLD and math.isfinite(value) and abs(value - self.handle.value) > 0.5 * step:
            self.handle.value = value


def file_name(text: str) -> str | None:
    """File of a recording by the name that a user typed, with its ending; None for none.

    Raises:
        ValueError: One that would lead out of the session's folder.
    """
    text = text.strip()
    if not text:
        return None
    if not _FILE.fullmatch(text):
        raise ValueError(f"file = {text!r}: must be a plain name of letters, digits, '-', '_', '.' and blanks")
    return text if text.lower().endswith(".mcap") else f"{text}.mcap"


class Controls:
    """The panel of a page; built and updated by one thread, its callbacks only `post` work for it.

    Args:
        server: Of viser.
        drawing: What is shown.
        view, gizmos: Moved by the controls of the view.
        post: Runs a function in the page's thread.
        ask: Sends a command to the session.
        tell: Shows a line to all users.
        clock: Seconds.
        screenshot: Takes a picture through the window of a client.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        drawing: Drawing,
        view: SceneView,
        gizmos: Gizmos,
        *,
        post: Post,
        ask: Callable[[Command], None],
        tell: Callable[[str], None],
        clock: Callable[[], float],
        screenshot: Callable[[Any], None],
    ):
        self._server, self._drawing, self._view, self._gizmos = server, drawing, view, gizmos
        self._post, self._ask, self._tell, self._clock, self._screenshot = post, ask, tell, clock, screenshot
        self._paused, self._recording = False, False
        self._texts_at = self._sure_until = -math.inf
        self._followers: dict[str, Follower] = {}
        self._hand_texts: dict[str, Any] = {}
        gui = server.gui
        self._banner = gui.add_html("")
        self._session()
        self._hands_folder = gui.add_folder("Hands", visible=False)
        self._light()
        self._sight()
        with gui.add_folder("Figures"):
            self._figures = gui.add_html("")

    def update(self, frame: PageFrame, now: float, rate: float, delay: float | None, visitors: int) -> None:
        """Show a frame; the last arguments as in `readout.figures`."""
        _assign(self._banner, "content", banner(frame.warnings, frame.pace, frame.recording, frame.task))
        self._paused, self._recording = frame.pace.paused, frame.recording is not None
        _assign(self._pause, "label", "Go on" if self._paused else "Pause")
        _assign(self._record, "label", "Stop recording" if self._recording else "Record")
        _assign(self._end, "label", SURE if now < self._sure_until else END)
        for hand in frame.hands:
            if hand.name not in self._hand_texts:
                self._hand(hand)
            self._followers[f"motion {hand.name}"].follow(_decades(hand.motion_gain), now)
            self._followers[f"force {hand.name}"].follow(_decades(hand.force_gain), now)
        self._followers["speed"].follow(frame.pace.speed, now)
        for group, traps in self._groups().items():
            if traps and len(frame.trap_power):
                powers = [float(frame.trap_power[k]) for k in traps]
                self._followers[f"power {group}"].follow(sum(powers) / len(powers), now)
        if now - self._texts_at >= TEXT_INTERVAL:
            self._texts_at = now
            _assign(self._figures, "content", figures(frame, rate, delay, visitors))
            for hand in frame.hands:
                _assign(self._hand_texts[hand.name], "content", hand_text(hand))

    def _session(self) -> None:
        gui = self._server.gui
        self._disarm_all = gui.add_button(
            "Disarm all", color="red", visible=False, hint="Let all forces fall to zero, now"
        )
        self._on_click(self._disarm_all, lambda: self._ask(Disarm()))
        with gui.add_folder("Session"):
            self._pause = gui.add_button("Pause", hint="Stand still; disarms the hands")
            self._on_click(self._pause, lambda: self._ask(Pause(not self._paused)))
            reset = gui.add_button("Reset", color="gray", hint="Begin anew with the scene as authored")
            self._on_click(reset, lambda: self._ask(Reset()))
            marks = ((0.05, "0.05"), (0.5, "½"), (1.0, "1"), (2.0, "2"))
            speed = gui.add_slider("Speed", *SPEEDS, 0.05, 1.0, marks=marks, hint="Simulated seconds per second")
            self._on_slide("speed", speed, lambda value: self._ask(SetSpeed(value)))
            self._file = gui.add_text("File", "", hint="Name of the recording; empty for one named by the time")
            self._record = gui.add_button("Record", color="gray")
            self._on_click(self._record, self._toggle_recording)
            shot = gui.add_button("Screenshot", color="gray", hint="Download what this window shows of the scene")
            shot.on_click(lambda event: self._screenshot(event.client))
            self._end = gui.add_button(
                END, color="gray", hint="Forces fall to zero, the recording is finished, all ends"
            )
            self._on_click(self._end, self._end_session)

    def _end_session(self) -> None:
        """End it by the second of two clicks: it cannot be taken back."""
        now = self._clock()
        if now < self._sure_until:
            self._ask(Stop())
        self._sure_until = now + SURE_WITHIN
        _assign(self._end, "label", SURE)

    def _toggle_recording(self) -> None:
        try:
            self._ask(Record(not self._recording, None if self._recording else file_name(self._file.value)))
        except ValueError as error:
            self._tell(str(error))

    def _hand(self, hand: HandFrame) -> None:
        """Controls of a hand with a device, once it is known."""
        gui, name = self._server.gui, hand.name
        self._hands_folder.visible = self._disarm_all.visible = True
        with self._hands_folder, gui.add_folder(f"{name.capitalize()} hand"):
            self._hand_texts[name] = gui.add_html(hand_text(hand))
            arm = gui.add_button("Arm", color="green", hint="Let it push")
            self._on_click(arm, lambda: self._ask(Arm(name)))
            disarm = gui.add_button("Disarm", color="red")
            self._on_click(disarm, lambda: self._ask(Disarm(name)))
            for kind, unit, ends, value in (
                ("motion", "µm/m", MOTION_DECADES, hand.motion_gain),
                ("force", "N/pN", FORCE_DECADES, hand.force_gain),
            ):
                slider = gui.add_slider(
                    f"{kind.capitalize()} gain, log₁₀",
                    *ends,
                    0.01,
                    _within(_decades(value), ends),
                    marks=tuple((float(k), f"{10.0**k:g}") for k in range(int(ends[0]), int(ends[1]) + 1, 2)),
                    hint=f"{kind.capitalize()} gain in {unit}; the slider holds its logarithm",
                )
                self._on_slide(f"{kind} {name}", slider, _gains(self._ask, name, kind))

    def _groups(self) -> dict[str, tuple[int, ...]]:
        """Traps whose power one slider sets: all, and those of each hand."""
        traps = self._drawing.traps
        hands = {hand: tuple(k for k, trap in enumerate(traps) if trap.hand == hand) for hand in HANDS}
        split = {hand: group for hand, group in hands.items() if group and len(group) < len(traps)}
        return {"all": tuple(range(len(traps))), **split}

    def _light(self) -> None:
        gui, traps = self._server.gui, self._drawing.traps
        if not traps:
            return
        most = 3.0 * max(max(trap.power for trap in traps), 1e-3)
        with gui.add_folder("Laser power"):
            for group, indices in self._groups().items():
                start = sum(traps[k].power for k in indices) / len(indices)
                label = f"{group.capitalize()} [mW]" if group != "all" else "All traps [mW]"
                slider = gui.add_slider(label, 0.0, round(most, 3), round(most / 300.0, 4), round(start, 3))
                self._on_slide(f"power {group}", slider, _power(self._ask, () if group == "all" else indices))

    def _sight(self) -> None:
        gui, view = self._server.gui, self._view
        with gui.add_folder("View"):
            mode = gui.add_dropdown("Handles", MODES, initial_value=self._gizmos.mode, hint="What can be dragged")
            self._on_change(mode, lambda value: setattr(self._gizmos, "mode", value))
            scale = gui.add_slider(
                "Arrows, log₁₀",
                *ARROW_DECADES,
                0.05,
                _within(_decades(view.arrow_scale), ARROW_DECADES),
                marks=tuple((float(k), f"{10.0**k:g}") for k in range(-2, 3)),
                hint="Length of force arrows in µm per pN; the slider holds its logarithm",
            )
            self._on_change(scale, lambda value: setattr(view, "arrow_scale", 10.0**value))
            for label, name in (
                ("Trap forces", "trap_forces"),
                ("Contact forces", "contact_forces"),
                ("Beams", "beams"),
            ):
                box = gui.add_checkbox(label, True)
                self._on_change(box, lambda value, name=name: setattr(view, name, value))

    def _on_click(self, handle: Any, act: Callable[[], None]) -> None:
        async def clicked(_: Any) -> None:
            self._post(act)

        handle.on_click(clicked)

    def _on_change(self, handle: Any, act: Callable[[Any], None]) -> None:
        async def changed(event: Any) -> None:
            value = handle.value
            if event.client_id is not None:  # else it was the server that set it
                self._post(lambda: act(value))

        handle.on_update(changed)

    def _on_slide(self, name: str, handle: Any, act: Callable[[float], None]) -> None:
        follower = self._followers[name] = Follower(handle)

        def slid(value: float) -> None:
            """A user moved the control at `now` [s]."""
            follower.touched(self._clock())
            act(float(value))

        self._on_change(handle, slid)


def _gains(ask: Callable[[Command], None], hand: str, kind: str) -> Callable[[float], None]:
    if kind == "motion":
        return lambda value: ask(SetGains(hand, motion_gain=10.0**value))
    return lambda value: ask(SetGains(hand, force_gain=10.0**value))


def _power(ask: Callable[[Command], None], traps: tuple[int, ...]) -> Callable[[float], None]:
    return lambda value: ask(SetPower(value, traps))


def _decades(value: float) -> float:
    return math.log10(value) if value > 0.0 else -math.inf


def _within(value: float, ends: tuple[float, float]) -> float:
    return _stepped(min(max(value, ends[0]), ends[1]), 0.01)


def _stepped(value: float, step: float) -> float:
    """The nearest step, without the digits that a number box would show of it otherwise."""
    return round(round(value / step) * step, 6)


def _assign(handle: Any, name: str, value: object) -> None:
    """Set a property only if it is another: each assignment is a message to every window."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def gizmo_position(event: Any) -> Vec3:
    """Where the transform control of an event of viser is now [µm]."""
    return vec3(event.target.position)
