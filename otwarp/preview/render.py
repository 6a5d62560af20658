"""A draw list in, a picture out."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.preview.kernels.raycast import draw_pixels
from otwarp.preview.studio import PictureStyle, Uploaded, arrange
from otwarp.scene.drawing.draw_list import Drawables

_BAND = 16384
"""Pixels per launch on the CPU: small enough that threads share the work evenly."""

EDGE_CONTRAST = 0.02
"""Difference between neighbours, in display units from 0 to 1, above which a pixel gets all its samples."""


def to_display(linear: np.ndarray) -> np.ndarray:
    """Linear colour → sRGB from 0 to 1 (IEC 61966-2-1), with a soft shoulder above 0.7 instead of clipping."""
    x = np.clip(linear, 0.0, None)
    knee = 0.7
    over = np.maximum(x - knee, 0.0)
    x = np.where(x > knee, knee + (1.0 - knee) * over / (over + (1.0 - knee)), x)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(np.maximum(x, 1e-12), 1.0 / 2.4) - 0.055)


def bloom(linear: np.ndarray, strength: float = 0.3) -> np.ndarray:
    """Let what is brighter than white spill a little over its surroundings, as light does in a lens.

    The excess of the mean over 0.6, in the colour of the pixel, is averaged over blocks of 4 × 4 pixels and smoothed
    by three box filters, which together are close to a Gaussian.
    """
    height, width = linear.shape[:2]
    bright = (linear[..., :1] + linear[..., 1:2] + linear[..., 2:]) / 3.0
    excess = linear * (np.clip(bright - 0.6, 0.0, 2.0) / np.maximum(bright, 1e-6))
    padded = np.pad(excess, ((0, -height % 4), (0, -width % 4), (0, 0)), mode="edge")
    small = padded.reshape(padded.shape[0] // 4, 4, padded.shape[1] // 4, 4, 3).mean(axis=(1, 3))
    reach = max(1, width // 320)
    for _ in range(3):
        for axis in (0, 1):
            edge = [(reach + 1, reach) if k == axis else (0, 0) for k in range(3)]
            total = np.cumsum(np.pad(small, edge, mode="edge"), axis=axis, dtype=np.float64)
            size = small.shape[axis]
            upper = np.take(total, range(2 * reach + 1, 2 * reach + 1 + size), axis=axis)
            small = (upper - np.take(total, range(size), axis=axis)) / (2 * reach + 1)
    spread = np.repeat(np.repeat(small, 4, axis=0), 4, axis=1)[:height, :width]
    return linear + (strength * spread).astype(linear.dtype)


def vignette(linear: np.ndarray, strength: float = 0.4) -> np.ndarray:
    """Darken the corners by up to `strength`, and nothing within the middle half, to lead the eye to the scene."""
    height, width = linear.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    r = np.hypot((2.0 * x + 1.0) / width - 1.0, (2.0 * y + 1.0) / height - 1.0) / np.sqrt(2.0)
    t = np.clip((r - 0.4) / 0.6, 0.0, 1.0)
    return linear * (1.0 - strength * t * t * (3.0 - 2.0 * t))[..., None]


def _quantised(display: np.ndarray) -> np.ndarray:
    """(h, w, 3) from 0 to 1 → uint8, with half a level of fixed noise so that dark gradients show no bands."""
    height, width = display.shape[:2]
    row, column = np.mgrid[:height, :width]
    noise = np.modf(52.9829189 * np.modf(0.06711056 * column + 0.00583715 * row)[0])[0] - 0.5
    return np.clip(np.rint(display * 255.0 + 0.9 * noise[..., None]), 0, 255).astype(np.uint8)


def _busy(image: np.ndarray) -> np.ndarray:
    """Flat indices of pixels that differ from a neighbour: edges, shadows' borders, highlights."""
    shown = to_display(image)
    busy = np.zeros(image.shape[:2], dtype=bool)
    for axis in (0, 1):
        steps = np.abs(np.diff(shown, axis=axis)) > EDGE_CONTRAST
        step = steps[..., 0] | steps[..., 1] | steps[..., 2]  # a tenth of the time of NumPy's reduction
        first, second = (slice(None, -1), slice(1, None))
        busy[(first, slice(None)) if axis == 0 else (slice(None), first)] |= step
        busy[(second, slice(None)) if axis == 0 else (slice(None), second)] |= step
    return np.flatnonzero(busy).astype(np.int32)


def _draw(ready: Uploaded, pixels: np.ndarray, first: int, last: int, total: wp.array, device: wp.Device) -> None:
    if len(pixels) == 0 or first >= last:
        return
    listed = wp.array(pixels, dtype=int, device=device)

    def launch(start: int, count: int) -> None:
        """Draw `count` of the listed pixels, from `start` on."""
        wp.launch(
            draw_pixels,
            dim=count,
            inputs=[ready.world, ready.studio, listed, start, first, last, total],
            device=device,
        )

    if device.is_cuda:
        launch(0, len(pixels))
        return
    bands = [(start, min(_BAND, len(pixels) - start)) for start in range(0, len(pixels), _BAND)]
    # A CPU launch runs on one thread and releases the interpreter: bands are independent, so all cores can help.
    with ThreadPoolExecutor(max(1, len(os.sched_getaffinity(0)))) as pool:
        list(pool.map(lambda band: launch(*band), bands))


def render_linear(drawables: Drawables, look: PictureStyle, device: str | None = None) -> np.ndarray:
    """As `render`, but linear colour (height, width, 3) float32 before the tone curve."""
    chosen = pick_device(device)
    ready = arrange(drawables, look, chosen)
    wp.load_module(draw_pixels.module, device=chosen)
    shape = (look.height, look.width, 3)
    total = wp.zeros(look.width * look.height, dtype=wp.vec3, device=chosen)
    everywhere = np.arange(look.width * look.height, dtype=np.int32)
    most = look.samples * look.samples
    # One diagonal of samples first; the others only where the picture is not smooth.
    few = max(1, look.samples - 1)
    _draw(ready, everywhere, 0, few, total, chosen)
    busy = _busy(total.numpy().reshape(shape) / few)
    _draw(ready, busy, few, most, total, chosen)
    count = np.full(len(everywhere), few, dtype=np.float32)
    count[busy] = most
    return total.numpy().reshape(shape) / count.reshape(*shape[:2], 1)


def render(drawables: Drawables, look: PictureStyle | None = None, device: str | None = None) -> np.ndarray:
    """Draw a picture.

    Args:
        drawables: What to draw, with its camera and lights.
        look: Size, samples and style; None takes the defaults of `PictureStyle`.
        device: Warp device; None for the best there is.

    Returns:
        (height, width, 3) uint8 sRGB.

    Raises:
        InputError: No such device.
    """
    look = look or PictureStyle()
    image = render_linear(drawables, look, device)
    return _quantised(to_display(vignette(bloom(image)) if look.style == "dark" else image))
