"""Buttons, sliders and keys of the page of recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from otwarp.teleop.page.front import overlay
from otwarp.teleop.page.protocol import Drawing
from otwarp.teleop.page.scene_view import SceneView
from otwarp.view.playback import SPEEDS, Playback
from otwarp.view.scale_bars import ScaleBars
from otwarp.view.sight import PRESETS
from otwarp.view.source import Source
from otwarp.view.theme import Theme

if TYPE_CHECKING:
    import viser

KEYS = (
    ("Space", "play, or stand still"),
    ("← →", "one moment back, one on"),
    ("Shift ← →", "a second back, a second on"),
    ("↑ ↓", "faster, slower"),
    ("Home, End", "first moment, last moment"),
    ("1 … 5", "look: " + ", ".join(PRESETS)),
    ("M", "measure between two clicks"),
    ("?", "this help"),
)
"""What the help says of the keys."""
STEPS = ("first", "back", "next", "last")
ARROW_DECADES = (-2.0, 2.0)
"""Ends of the slider of arrows: log₁₀ of µm/pN."""


class Controlled(Protocol):
    """What the controls need of a page."""

    playback: Playback
    scale_bars: ScaleBars

    @property
    def view(self) -> SceneView | None:
        """Of the first recording."""
        ...

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the page's thread."""
        ...

    def look(self, client: Any, name: str) -> None:
        """Put the camera of a window to a preset."""
        ...

    def measure(self, on: bool) -> None:
        """Take clicks as places to measure between, or not."""
        ...

    def clear_measure(self) -> None:
        """Take away what was measured."""
        ...

    def screenshot(self, client: Any) -> None:
        """Download what a window shows."""
        ...

    def redraw(self) -> None:
        """Draw the same moment anew."""
        ...

    def legend(self) -> str:
        """What colours mean, as HTML."""
        ...

    def about(self) -> str:
        """What is shown and how it was computed, as HTML."""
        ...


class Controls:
    """The panel on the right; callbacks only `post` work to the page's thread.

    Args:
        page: What they control.
        server: Of viser.
        theme: Colours.
    """

    def __init__(self, page: Controlled, server: viser.ViserServer, theme: Theme):
        self._page, self._gui, self._theme = page, server.gui, theme
        self._legend_on = True
        self._measuring = False
        self._scene = self._gui.add_html("")
        self._over = self._gui.add_html("")
        with self._gui.add_folder("Playback"):
            self._playback()
        with self._gui.add_folder("Look"):
            self._look()
        with self._gui.add_folder("Measure"):
            self._tape()
        with self._gui.add_folder("Show", expand_by_default=False):
            self._show()
        with self._gui.add_folder("Run", expand_by_default=False):
            self._about = self._gui.add_html("")
        self._keys()

    def loaded(self, sources: Sequence[Source], drawing: Drawing) -> None:
        """Recordings have been put on the page."""
        playback = self._page.playback
        # rounded up: the slider shows its ends
        self._slider.max = max(math.ceil(1e3 * playback.last - 1e-6) / 1e3, playback.first + 1e-3)
        self._slider.min = playback.first
        self._slider.value = playback.first
        many = max(len(source.time) for source in sources)
        self._slider.step = _round_step((playback.last - playback.first) / max(many - 1, 1))
        self._about.content = self._page.about()
        self._arrows.value = 0.0
        self.update()

    def update(self) -> None:
        """Show where the clock stands."""
        playback = self._page.playback
        _assign(self._play, "label", "Pause" if playback.playing else "Play")
        step = self._slider.step or 1e-6
        value = min(max(playback.time, self._slider.min), self._slider.max)
        if abs(value - self._slider.value) >= 0.5 * step:
            self._slider.value = round(value, 6)
        _assign(self._speed, "value", _speed_text(playback.speed))
        span = max(playback.last - playback.first, 1e-12)
        text = f"{playback.time:.3f} s of {playback.last:.3f} s"
        _assign(
            self._scene,
            "content",
            f'<div style="padding:2px 12px 6px;font-size:13px;font-variant-numeric:tabular-nums">{text}</div>'
            + overlay(
                "cursor", share=(playback.time - playback.first) / span, first=playback.first, last=playback.last
            ),
        )
        _assign(self._over, "content", overlay("legend", self._page.legend() if self._legend_on else ""))

    def measured(self, html: str) -> None:
        """The measuring tool says something."""
        self._result.content = f'<div style="padding:2px 12px 4px;font-size:13px">{html}</div>'

    def _playback(self) -> None:
        gui, page = self._gui, self._page
        self._slider = gui.add_slider("Time [s]", 0.0, 1.0, 0.001, 0.0)
        self._changed(self._slider, lambda value: page.playback.seek(value))
        self._play = gui.add_button("Play", hint="Space")
        self._clicked(self._play, lambda: page.playback.toggle())
        steps = gui.add_button_group("Step", STEPS)
        self._changed(steps, self._step)
        self._speed = gui.add_dropdown(
            "Speed", tuple(_speed_text(s) for s in SPEEDS), initial_value=_speed_text(1.0), hint="Of real time"
        )
        self._changed(self._speed, lambda text: setattr(page.playback, "speed", _speed(text)))
        loop = gui.add_checkbox("Loop", False)
        self._changed(loop, lambda on: setattr(page.playback, "loop", on))

    def _step(self, name: str) -> None:
        playback = self._page.playback
        if name in ("first", "last"):
            playback.playing = False
            playback.seek(playback.first if name == "first" else playback.last)
        else:
            playback.step(1 if name == "next" else -1)

    def _look(self) -> None:
        group = self._gui.add_button_group("View", PRESETS)

        async def looked(event: Any) -> None:
            name, client = group.value, event.client
            self._page.post(lambda: self._page.look(client, name))

        group.on_click(looked)
        shot = self._gui.add_button("Screenshot", color="gray", hint="Download what this window shows of the scene")
        shot.on_click(lambda event: self._page.screenshot(event.client))

    def _tape(self) -> None:
        self._measure = self._gui.add_button("Measure", color="gray", hint="M; then click on two places")
        self._clicked(self._measure, self._toggle_measure)
        self._result = self._gui.add_html("")
        clear = self._gui.add_button("Clear", color="gray")

        def cleared() -> None:
            """Nothing is measured any more."""
            self._page.clear_measure()
            self.measured("")

        self._clicked(clear, cleared)

    def _toggle_measure(self) -> None:
        self._measuring = not self._measuring
        self._page.measure(self._measuring)
        self._measure.label = "Stop measuring" if self._measuring else "Measure"
        self.measured("click on a place" if self._measuring else "")

    def _show(self) -> None:
        gui, page = self._gui, self._page
        self._arrows = gui.add_slider(
            "Arrows, log₁₀",
            *ARROW_DECADES,
            0.05,
            0.0,
            marks=tuple((float(k), f"{10.0**k:g}") for k in range(-2, 3)),
            hint="Length of force arrows in µm per pN; the slider holds its logarithm",
        )
        self._changed(self._arrows, lambda value: self._of_view("arrow_scale", 10.0**value))
        for label, name in (
            ("Trap forces", "trap_forces"),
            ("Contact forces", "contact_forces"),
            ("Beams", "beams"),
        ):
            box = gui.add_checkbox(label, True)
            self._changed(box, lambda value, name=name: self._of_view(name, value))
        bar, names = gui.add_checkbox("Scale bar", True), gui.add_checkbox("Legend", True)
        self._changed(bar, lambda on: page.scale_bars.show(on))
        self._changed(names, lambda on: setattr(self, "_legend_on", on))

    def _of_view(self, name: str, value: Any) -> None:
        if self._page.view is not None:
            setattr(self._page.view, name, value)
            self._page.redraw()

    def _keys(self) -> None:
        page = self._page
        self._key("Play or pause", "space", lambda: page.playback.toggle())
        self._key("One moment on", "arrowright", lambda: page.playback.step(1))
        self._key("One moment back", "arrowleft", lambda: page.playback.step(-1))
        self._key("A second on", "arrowright", lambda: page.playback.seek(page.playback.time + 1.0), "shift")
        self._key("A second back", "arrowleft", lambda: page.playback.seek(page.playback.time - 1.0), "shift")
        self._key("Faster", "arrowup", lambda: page.playback.faster(1))
        self._key("Slower", "arrowdown", lambda: page.playback.faster(-1))
        self._key("First moment", "home", lambda: self._step("first"))
        self._key("Last moment", "end", lambda: self._step("last"))
        self._key("Measure", "M", self._toggle_measure)
        for n, name in enumerate(PRESETS, start=1):
            command = self._gui.add_command(f"Look: {name}", hotkey=str(n))  # type: ignore[arg-type]

            async def looked(event: Any, name: str = name) -> None:
                client = event.client
                self._page.post(lambda: self._page.look(client, name))

            command.on_trigger(looked)

    def _key(self, label: str, key: Any, act: Callable[[], None], modifier: Any = None) -> None:
        command = self._gui.add_command(label, hotkey=key, modifier=modifier)

        async def pressed(_: Any) -> None:
            self._page.post(act)

        command.on_trigger(pressed)

    def _clicked(self, handle: Any, act: Callable[[], None]) -> None:
        async def clicked(_: Any) -> None:
            self._page.post(act)

        handle.on_click(clicked)

    def _changed(self, handle: Any, act: Callable[[Any], None]) -> None:
        async def changed(event: Any) -> None:
            value = handle.value
            if event.client_id is not None:  # else it was the server that set it
                self._page.post(lambda: act(value))

        if hasattr(handle, "options") and hasattr(handle, "on_click"):
            handle.on_click(changed)
        else:
            handle.on_update(changed)


def _speed_text(speed: float) -> str:
    return f"{speed:g} ×"


def _speed(text: str) -> float:
    return float(text.split()[0])


def _round_step(step: float) -> float:
    """A step of the slider with few digits: it shows them."""
    if not (math.isfinite(step) and step > 0.0):
        return 1e-3
    return 10.0 ** math.floor(math.log10(step))


def _assign(handle: Any, name: str, value: object) -> None:
    """Set a property only if it is another: each assignment is a message to every window."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)
