"""What the camera sees first at each pixel's centre: distances and indices, for measurements and tests."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.preview.raycast import find_first
from otwarp.preview.studio import arrange
from otwarp.scene.drawing.draw_list import Drawables


def first_hits(
    drawables: Drawables, *, width: int, height: int, device: str | None = "cpu"
) -> tuple[np.ndarray, np.ndarray]:
    """Depth map.

    Returns:
        (height, width) distance along the ray [µm], 1e30 where nothing is hit, and (height, width) index of the shape
        among the infinite planes and then the other surfaces of `drawables`, −1 for none. Beams are looked through.
    """
    chosen = pick_device(device)
    ready = arrange(drawables, width, height, samples=1, occlusion_rays=0, style="dark", grid=False, device=chosen)
    distance = wp.empty(width * height, dtype=float, device=chosen)
    index = wp.empty(width * height, dtype=int, device=chosen)
    wp.launch(find_first, dim=width * height, inputs=[ready.world, ready.studio, distance, index], device=chosen)
    return distance.numpy().reshape(height, width), index.numpy().reshape(height, width)
