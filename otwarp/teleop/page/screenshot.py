"""A picture of the scene as one window shows it, downloaded there."""

from __future__ import annotations

import io
import time
from typing import Any

import numpy as np

from otwarp.teleop.page.protocol import Colour

PICTURE = 2000
"""Most pixels of a side of a screenshot."""
NOTICE = 8.0
"""Seconds for which a notification of a failure stays."""


def send_screenshot(client: Any, background: Colour) -> None:
    """Draw in a window and download there; waits for the window, so it belongs into a thread of viser's.

    Args:
        client: The window, None for one that has gone.
        background: Behind what is drawn.
    """
    if client is None:
        return
    import imageio.v3 as iio

    height, width = client.camera.image_height, client.camera.image_width
    k = min(1.0, PICTURE / max(height, width, 1))
    try:
        image = client.get_render(int(k * height), int(k * width), transport_format="png", timeout=10.0)
    except (RuntimeError, TimeoutError) as error:
        client.add_notification("Screenshot", str(error), auto_close_seconds=NOTICE, color="red")
        return
    clear = image[..., 3:].astype(float) / 255.0
    flat = image[..., :3] * clear + np.array(background) * (1.0 - clear)
    png = io.BytesIO()
    iio.imwrite(png, flat.astype(np.uint8), extension=".png")
    name = time.strftime("otwarp_%Y%m%d_%H%M%S.png")
    client.send_file_download(name, png.getvalue(), save_immediately=True)
