"""The measuring tool on the page: two clicks become two marks, a line and its length."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from otwarp.teleop.page.protocol import Drawing, PageFrame
from otwarp.view.measure import hit, on_plane
from otwarp.view.sight import length_text
from otwarp.view.theme import Theme

if TYPE_CHECKING:
    import viser

MARK = 0.004
"""Radius of a mark over the distance of the camera that it was made from."""


class Tape:
    """Marks of the measuring tool; for all windows alike.

    Args:
        server: Of viser.
        theme: Colours.
        say: Shows HTML to the user.
    """

    def __init__(self, server: viser.ViserServer, theme: Theme, say: Callable[[str], None]):
        self._scene, self._theme, self._say = server.scene, theme, say
        self._places: list[np.ndarray] = []
        self._drawn: list[Any] = []
        self._on = False

    def start(
        self, drawing: Drawing, frame: Callable[[], PageFrame], post: Callable[[Callable[[], None]], None]
    ) -> None:
        """Take clicks from now on.

        Args:
            drawing, frame: What is clicked on.
            post: Runs a function in the page's thread.
        """
        self.stop()
        self._on = True

        async def clicked(event: Any) -> None:
            origin, way = np.array(event.ray_origin), np.array(event.ray_direction)
            middle = np.array(event.client.camera.look_at)
            post(lambda: self._click(drawing, frame(), origin, way, middle))

        self._scene.on_click()(cast("Any", clicked))  # it takes coroutines, too

    def stop(self) -> None:
        """Take no more clicks; what was measured stays."""
        if self._on:
            self._scene.remove_click_callback()
        self._on = False

    def clear(self) -> None:
        """Take all marks away."""
        for handle in self._drawn:
            handle.remove()
        self._drawn, self._places = [], []

    def _click(
        self, drawing: Drawing, frame: PageFrame, origin: np.ndarray, way: np.ndarray, middle: np.ndarray
    ) -> None:
        place = hit(drawing, frame, origin, way)
        where = "on what is drawn"
        if place is None:  # the plane across the view, through the place that is looked at
            place, where = on_plane(middle, origin, way, middle - origin), "in the plane of the scale bar"
        if len(self._places) == 2:
            self.clear()
        self._places.append(place)
        size = MARK * float(np.linalg.norm(middle - origin))
        name = f"/measure/{len(self._places)}"
        self._drawn.append(self._scene.add_icosphere(name, radius=size, color=self._theme.mark, position=tuple(place)))
        if len(self._places) == 1:
            x, y, z = place
            self._say(f"({x:.2f}, {y:.2f}, {z:.2f}) µm, {where}; click on another place")
            return
        a, b = self._places
        length = float(np.linalg.norm(b - a))
        dx, dy, dz = b - a
        self._drawn.append(
            self._scene.add_line_segments(
                "/measure/line",
                np.array([[a, b]], dtype=np.float32),
                np.array(self._theme.mark),
                thickness=2.0,
                thickness_units="screen",
            )
        )
        self._drawn.append(self._scene.add_label("/measure/length", length_text(length), position=tuple(0.5 * (a + b))))
        self._say(f"<b>{length_text(length)}</b> at {frame.time:.3f} s<br>Δ = ({dx:.2f}, {dy:.2f}, {dz:.2f}) µm")
