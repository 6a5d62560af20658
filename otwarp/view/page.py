"""The page of recordings: one thread that shows the moment that the clock says, and does what windows ask."""

from __future__ import annotations

import dataclasses
import html
import queue
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import BallGroup, BodyDrawing, Drawing, MeshPart, MovingDrawing
from otwarp.teleop.page.readout import table
from otwarp.teleop.page.scene_view import SceneView
from otwarp.teleop.page.screenshot import send_screenshot
from otwarp.view.controls import Controls
from otwarp.view.curves import charts
from otwarp.view.playback import Playback, index_at
from otwarp.view.plots import Plots
from otwarp.view.scale_bars import ScaleBars
from otwarp.view.sight import legend, preset
from otwarp.view.source import Source
from otwarp.view.tape import Tape
from otwarp.view.theme import Theme

if TYPE_CHECKING:
    import viser

TICK = 1.0 / 30.0
"""Seconds between two looks at the clock."""
MOST_FAILURES = 5
"""Failures that are written to stderr."""
GHOST = 0.35
"""Opacity of the second run."""
PLOTS_WIDTH = 330
"""Of the panel of plots [pixels]."""


class ViewPage:
    """A page that shows one recording, or two on top of each other.

    Args:
        server: viser's, with access guarded.
        theme: Colours.
    """

    def __init__(self, server: viser.ViserServer, theme: Theme):
        self._server, self._theme = server, theme
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._views: list[SceneView] = []
        self._sources: list[Source] = []
        self._drawings: list[Drawing] = []
        self._shown: tuple[int, ...] | None = None
        self._failures, self._loaded = 0, 0
        gui = server.gui
        gui.configure_theme(
            dark_mode=not theme.light,
            show_logo=False,
            show_share_button=False,
            brand_color=(24, 118, 163) if theme.light else (56, 160, 205),
        )
        gui.main_panel.dock_right()
        self.playback = Playback(np.zeros(1))
        self.controls = Controls(self, server, theme)
        self._tape = Tape(server, theme, self.controls.measured)
        self._side = gui.add_panel()
        self._side.dock_left()
        self._side.set_width(PLOTS_WIDTH)
        self._plots = Plots(gui, self._side.add_tab("Plots"), theme)
        self.scale_bars = ScaleBars(server, self.post)

    @property
    def side(self) -> Any:
        """The panel with the plots; others put their tabs there."""
        return self._side

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the page's thread."""
        self._inbox.put(work)

    def show(self, sources: Sequence[Source]) -> None:
        """Show recordings, from their start, in place of those that were shown.

        Args:
            sources: One, or two: the second is drawn translucent.
        """
        self._sources = list(sources)
        self._drawings = [compose(source.scene) for source in sources]
        if len(self._drawings) > 1:
            self._drawings[1] = ghost(self._drawings[1], self._drawings[0])
        self._loaded += 1
        self.playback = Playback(np.unique(np.concatenate([source.time for source in sources])))
        self._shown = None
        with self._server.atomic():
            for root in ("/scene", "/second", "/light"):
                self._server.scene.remove_by_name(root)
            self._tape.clear()
            light = self._theme.light
            self._views = [SceneView(self._server, self._drawings[0], light=light)]
            for drawing in self._drawings[1:]:
                self._views.append(SceneView(self._server, drawing, root="/second", studio=False))
        self._server.gui.set_panel_label(f"otwarp · {' and '.join(source.title for source in sources)}")
        self._views[1:] = [_plain(view) for view in self._views[1:]]
        self.controls.loaded(self._sources, self._drawings[0])
        self._plots.show([], [], (0.0, 1.0))
        threading.Thread(target=self._curves, args=(self._loaded, list(sources)), daemon=True).start()

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until `stopped` says so."""
        while not stopped():
            self._do(self.turn)
            try:
                self._do(self._inbox.get(timeout=TICK))
                while True:
                    self._do(self._inbox.get_nowait())
            except queue.Empty:
                pass

    def turn(self) -> None:
        """Show the moment that the clock says, if it is another than the one shown."""
        self.playback.tick(time.monotonic())
        if not self._sources:
            return
        indices = tuple(index_at(source.time, self.playback.time) for source in self._sources)
        self.controls.update()
        if indices == self._shown:
            return
        self._shown = indices
        now = time.monotonic()
        frames = [source.frame(i) for source, i in zip(self._sources, indices, strict=True)]
        with self._server.atomic():
            for view, frame in zip(self._views, frames, strict=True):
                view.update(frame, now)
        self._server.flush()

    def redraw(self) -> None:
        """Draw the same moment anew: something about how it is drawn has changed."""
        self._shown = None

    @property
    def view(self) -> SceneView | None:
        """Of the first recording."""
        return self._views[0] if self._views else None

    def look(self, client: Any, name: str) -> None:
        """Put the camera of a window to a preset."""
        if client is None or not self._sources:
            return
        frame = self._sources[0].frame(self.playback_index)
        aspect = client.camera.aspect or 1.0
        found = preset(name, self._drawings[0], frame, aspect)
        with client.atomic():
            client.camera.up_direction = (0.0, 0.0, 1.0)
            client.camera.position = found.position
            client.camera.look_at = found.look_at

    @property
    def playback_index(self) -> int:
        """Moment of the first recording that is shown."""
        return index_at(self._sources[0].time, self.playback.time)

    def screenshot(self, client: Any) -> None:
        """Download what a window shows."""
        send_screenshot(client, self._theme.background)

    def measure(self, on: bool) -> None:
        """Take the next clicks as places to measure between, or not."""
        if not on or not self._sources:
            self._tape.stop()
            return
        source, drawing = self._sources[0], self._drawings[0]
        self._tape.start(drawing, lambda: source.frame(self.playback_index), self.post)

    def clear_measure(self) -> None:
        """Take away what was measured."""
        self._tape.clear()

    def legend(self) -> str:
        """What colours mean, as HTML."""
        if not self._views:
            return ""
        other = self._sources[1].title if len(self._sources) > 1 else None
        return legend(self._sources[0].scene, self._drawings[0], self._views[0].arrow_scale, other)

    def about(self) -> str:
        """What is shown and how it was computed, as HTML."""
        return about_html(self._sources)

    def tell(self, line: str, colour: Any = "orange") -> None:
        """Show a line in all windows for a while."""
        for client in self._server.get_clients().values():
            client.add_notification("otwarp", line, auto_close_seconds=8.0, color=colour)

    def _curves(self, loaded: int, sources: list[Source]) -> None:
        """Thread: read the runs as a whole for the plots, then have them drawn."""
        try:
            found = [charts(source) for source in sources]
        except (OSError, ValueError):
            traceback.print_exc()
            return

        def draw() -> None:
            """Unless something else is shown meanwhile."""
            if loaded == self._loaded:
                span = (self.playback.first, max(self.playback.last, self.playback.first + 1e-9))
                self._plots.show(found, [source.title for source in sources], span)

        self.post(draw)

    def _do(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception:  # a picture that fails must not end the page
            self._failures += 1
            if self._failures <= MOST_FAILURES:
                traceback.print_exc()


def about_html(sources: Sequence[Source]) -> str:
    """What recordings are and how they were computed, each under its title where there are several."""
    tables = [table([(name, html.escape(said)) for name, said in source.about]) for source in sources]
    if len(tables) == 1:
        return tables[0]
    style = "padding:4px 12px 0;font-weight:600"
    titles = [f'<div style="{style}">{html.escape(source.title)}</div>' for source in sources]
    return "".join(title + rows for title, rows in zip(titles, tables, strict=True))


def ghost(drawing: Drawing, first: Drawing) -> Drawing:
    """A drawing that can be told from another one in the same place: translucent, without what both have alike."""
    same = len(drawing.fixed) == len(first.fixed) and all(
        np.array_equal(a.vertices, b.vertices) for a, b in zip(drawing.fixed, first.fixed, strict=True)
    )

    def thin(parts: tuple[MeshPart, ...]) -> tuple[MeshPart, ...]:
        return tuple(dataclasses.replace(part, opacity=GHOST * part.opacity) for part in parts)

    bodies = tuple(BodyDrawing(index=b.index, parts=thin(b.parts)) for b in drawing.bodies)
    balls = tuple(
        BallGroup(bodies=g.bodies, radii=g.radii, colours=g.colours, opacity=GHOST * g.opacity) for g in drawing.balls
    )
    moving: tuple[MovingDrawing, ...] = () if same else drawing.moving
    return dataclasses.replace(
        drawing, bodies=bodies, balls=balls, fixed=() if same else thin(drawing.fixed), moving=moving, traps=()
    )


def _plain(view: SceneView) -> SceneView:
    """Without arrows: those of two runs could not be told apart."""
    view.trap_forces = view.contact_forces = view.beams = False
    return view
