"""What a camera sees, beside the twin: pieces of its frames with outline and uncertainty of what was made of them."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.teleop.page.readout import table
from otwarp.teleop.perception import BodyNow, PerceptionNow

if TYPE_CHECKING:
    import viser

EVERY = 0.25
"""Seconds between two images that are sent to the browsers."""
SIDE = 192
"""Pixels of the side of a piece as shown."""
SIGMAS = 2.0
"""Of the ellipse around a body's centre."""
LEAST = 2.5
"""Least half axis of that ellipse as shown [pixels]: what is known to nanometres would not be seen."""
SEEN, LOST, PLACE = (74, 222, 128), (255, 64, 92), (255, 194, 74)


def drawn(body: BodyNow) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8 of a body's piece, row 0 the highest: green where it is seen, red where it is lost."""
    if body.levels is None or not body.levels.size:
        return np.full((SIDE, SIDE, 3), 24, dtype=np.uint8)
    high, wide = body.levels.shape
    scale = SIDE / max(high, wide)
    at = np.arange(SIDE) / scale
    rows, columns = np.minimum(at.astype(int), high - 1), np.minimum(at.astype(int), wide - 1)
    grey = body.levels[np.ix_(rows, columns)].astype(float)
    low, top = np.percentile(grey, [1.0, 99.0])
    grey = np.clip((grey - low) / max(top - low, 8.0), 0.0, 1.0) * 220.0
    image = np.repeat(grey[..., None], 3, axis=2)
    if body.outline is not None and body.spread is not None:
        # the middle of a pixel is whole
        x, y = np.meshgrid((np.arange(SIDE) + 0.5) / scale - 0.5, (np.arange(SIDE) + 0.5) / scale - 0.5)
        line = np.zeros((SIDE, SIDE), dtype=bool)
        for column, row, radius in body.outline:
            line |= np.abs(np.hypot(x - column, y - row) - radius) < 0.6 / scale
        image[line] = LOST if body.why else SEEN
        image[_ellipse(x, y, body.outline[:, :2].mean(axis=0), body.spread, scale)] = PLACE
    return image.astype(np.uint8)[::-1]


def _ellipse(x: np.ndarray, y: np.ndarray, centre: np.ndarray, spread: np.ndarray, scale: float) -> np.ndarray:
    """Which pixels the ellipse of `SIGMAS` deviations goes through."""
    variance, axes = np.linalg.eigh(spread)
    half = np.maximum(SIGMAS * np.sqrt(np.maximum(variance, 0.0)), LEAST / scale)
    away = np.stack([x - centre[0], y - centre[1]], axis=-1) @ axes / half
    return np.abs(np.hypot(away[..., 0], away[..., 1]) - 1.0) < 0.6 / (scale * float(half.min()))


def text(now: PerceptionNow) -> str:
    """Rate of the camera, and of each body how well it is known or why it is lost; HTML, all escaped."""
    rows = [("frames", html.escape(now.ended) if now.ended else f"{now.rate:.1f} /s")]
    for body in now.bodies:
        name = body.name.rsplit("/", 1)[-1]
        if body.why:
            rows.append((name, f'<b style="color:#ff405c">lost</b> {html.escape(body.why)}'))
        elif body.deviation is not None and all(math.isfinite(v) for v in body.deviation):
            rows.append((name, "± {:.0f}, {:.0f}, {:.0f} nm".format(*(1e3 * v for v in body.deviation))))
    return table(rows)


class CameraPanel:
    """A folder of the page that appears with the first frame of a session with a camera.

    Args:
        server: viser's.
    """

    def __init__(self, server: viser.ViserServer):
        self._server, self._at = server, -math.inf
        self._image: Any = None
        self._text: Any = None

    def update(self, now: PerceptionNow | None, time: float) -> None:
        """Show what a camera sees, a few times a second.

        Args:
            now: None for a session without one.
            time: On the page's clock [s].
        """
        if now is None or time < self._at + EVERY or not now.bodies:
            return
        self._at = time
        shown = np.concatenate([drawn(body) for body in now.bodies[:4]], axis=1)
        if self._image is None:
            gui = self._server.gui
            with gui.add_folder(f"Camera {now.camera}"):
                self._image = gui.add_image(shown, format="jpeg", jpeg_quality=80)
                self._text = gui.add_html(text(now))
            return
        self._image.image = shown
        self._text.content = text(now)
