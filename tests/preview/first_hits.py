"""What the camera sees first at each pixel, by the tracing of the pictures."""

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.preview.kernels.raycast import camera_ray
from otwarp.preview.kernels.shading import Studio
from otwarp.preview.kernels.tracing import World, nearest
from otwarp.preview.studio import PictureStyle, arrange
from otwarp.scene.drawing.draw_list import Drawables


@wp.kernel(enable_backward=False)
def find_first(world: World, studio: Studio, distance: wp.array(dtype=float), index: wp.array(dtype=int)):
    """Distance [µm] (1e30 for none) and index (−1 for none) of the first surface at the centre of every pixel."""
    tid = wp.tid()
    x = (2.0 * float(tid % studio.width) + 1.0) / float(studio.width) - 1.0
    y = 1.0 - (2.0 * float(tid // studio.width) + 1.0) / float(studio.height)
    ray = camera_ray(studio, x, y)
    hit = nearest(world, ray.origin, ray.direction, studio.near * ray.stretch, studio.far * ray.stretch)
    index[tid] = hit.index
    distance[tid] = wp.where(hit.index < 0, 1.0e30, hit.t)


def first_hits(drawables: Drawables, look: PictureStyle, device: str | None = "cpu") -> tuple[np.ndarray, np.ndarray]:
    """What the camera sees first at each pixel's centre.

    Returns:
        (height, width) distance along the ray [µm], 1e30 where nothing is hit, and (height, width) index of the shape
        among the infinite planes and then the other surfaces of `drawables`, −1 for none. Beams are looked through.
    """
    chosen, pixels = pick_device(device), look.width * look.height
    ready = arrange(drawables, look, chosen)
    distance = wp.empty(pixels, dtype=float, device=chosen)
    index = wp.empty(pixels, dtype=int, device=chosen)
    wp.launch(find_first, dim=pixels, inputs=[ready.world, ready.studio, distance, index], device=chosen)
    return distance.numpy().reshape(look.height, look.width), index.numpy().reshape(look.height, look.width)
