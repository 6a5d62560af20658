"""Scale bar and time stamp, drawn onto a finished picture."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from otwarp.preview.studio import nice_length

_UNITS = ((1e6, "m"), (1e3, "mm"), (1.0, "µm"), (1e-3, "nm"))
BAR_SHARE = 0.2
"""The scale bar is the longest round length that fits into this share of the picture's width."""


def length_text(micrometres: float) -> str:
    """A round length with its unit: `10 µm`, `500 nm`."""
    for factor, symbol in _UNITS:
        if micrometres >= factor * (1.0 - 1e-9):
            return f"{micrometres / factor:g} {symbol}"
    return f"{micrometres * 1e3:g} nm"


def scale_bar(width: int, pixel_size: float) -> tuple[float, int]:
    """Length of the scale bar [µm] and its length in pixels, for a picture `width` pixels wide.

    Args:
        width: Pixels.
        pixel_size: Length one pixel covers [µm], as from `View.pixel_size`.
    """
    length = nice_length(BAR_SHARE * width * pixel_size)
    return length, max(1, round(length / pixel_size))


@cache
def _font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    """DejaVu Sans from matplotlib's own data: Pillow's built-in font has no µ. Matplotlib itself is not imported."""
    package = find_spec("matplotlib")
    if package is not None and package.origin is not None:
        file = Path(package.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if file.is_file():
            return ImageFont.truetype(str(file), size)
    return ImageFont.load_default(size=size)


def _ink(image: np.ndarray) -> tuple[int, int, int]:
    """White on dark corners, near black on light ones."""
    height, width = image.shape[:2]
    return (245, 248, 250) if image[int(0.85 * height) :, int(0.7 * width) :].mean() < 150.0 else (24, 30, 38)


def annotate(
    image: np.ndarray, *, pixel_size: float | None = None, time: float | None = None, title: str | None = None
) -> np.ndarray:
    """Write a scale bar (lower right), a time stamp (lower left) and a title (upper left) onto a copy of `image`.

    Args:
        image: (h, w, 3) uint8.
        pixel_size: Length that one pixel covers at the focus distance [µm]; None for no scale bar.
        time: Seconds; None for no time stamp.
        title: One line; None for none.

    Returns:
        (h, w, 3) uint8.
    """
    height, width = image.shape[:2]
    picture = Image.fromarray(image)
    pen = ImageDraw.Draw(picture)
    margin, ink = max(4, round(0.035 * height)), _ink(image)
    font = _font(max(9, round(0.028 * height)))
    if pixel_size is not None:
        length, pixels = scale_bar(width, pixel_size)
        thick = max(2, round(0.006 * height))
        right, bottom = width - margin, height - margin
        pen.rectangle((right - pixels, bottom - thick + 1, right - 1, bottom), fill=ink)
        pen.text((right - pixels / 2, bottom - thick - 0.3 * margin), length_text(length), ink, font, anchor="mb")
    if time is not None:
        pen.text((margin, height - margin), f"t = {time:.3f} s", ink, font, anchor="lb")
    if title:
        pen.text((margin, margin), title, ink, font, anchor="lt")
    return np.asarray(picture)
