"""Pictures, and movies as GIF, on disk; both appear under their names only when they are whole."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import GifImagePlugin, Image

from otwarp.errors import InputError
from otwarp.files import written

_CHANGED = 3
"""Levels by which a pixel must differ from the frame before to be written again."""


def save_png(image: np.ndarray, path: str | Path) -> Path:
    """Write an (h, w, 3) uint8 image as PNG.

    Raises:
        InputError: The file cannot be written.
    """
    path = Path(path)
    with written(path, str(path)) as part, part.open("wb") as file:
        Image.fromarray(image).save(file, format="PNG")
    return path


def _palette_image(image: np.ndarray, changed: np.ndarray) -> Image.Image:
    """The pixels `changed` (h, w) in 255 colours of their own; all others transparent (index 255)."""
    pixels = Image.fromarray(np.ascontiguousarray(image[changed])[None])
    few = pixels.quantize(255, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    indices = np.full(changed.shape, 255, dtype=np.uint8)
    indices[changed] = np.asarray(few)[0]
    part = Image.fromarray(indices, mode="P")
    part.putpalette((few.getpalette() or [])[: 3 * 255])
    return part


def _box(changed: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns that hold everything `changed`."""
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def save_movie(frames: Iterable[np.ndarray], path: str | Path, fps: float) -> int:
    """Write frames, (h, w, 3) uint8 each, as an endless GIF while they come; memory holds two of them.

    Each frame holds only the pixels that changed, in a palette made for them.

    Args:
        frames: Iterable of equally large images, at least one.
        path: File to write.
        fps: Frames per second, in (0, 50]: viewers slow down shorter delays.

    Returns:
        Number of frames written.

    Raises:
        InputError: No frames, `fps` out of range, frames of different sizes, or the file cannot be written.
    """
    path = Path(path)
    if not 0.0 < fps <= 50.0:
        raise InputError(f"{path}: fps = {fps:g}, allowed (0, 50]")
    count, shown = 0, None
    with written(path, str(path)) as part, part.open("wb") as file:
        for image in frames:
            if shown is None:
                shown = image.astype(np.int16)
                changed = np.ones(image.shape[:2], dtype=bool)
            elif image.shape != shown.shape:
                raise InputError(f"{path}: frame {count} has shape {image.shape}, the ones before {shown.shape}")
            else:
                changed = (np.abs(image - shown) > _CHANGED).any(axis=2)
                shown[changed] = image[changed]
                changed[0, 0] |= not changed.any()  # a frame in which nothing moves still takes its time
            rows, columns = _box(changed)
            part = _palette_image(image[rows, columns], changed[rows, columns])
            if count == 0:
                file.write(b"".join(GifImagePlugin.getheader(part, info={"loop": 0})[0]))
            # GIF counts in hundredths of a second: round the ends of the frames, so that the film keeps its length.
            delay = 10 * (round(100.0 * (count + 1) / fps) - round(100.0 * count / fps))
            blocks = GifImagePlugin.getdata(
                part,
                offset=(int(columns.start), int(rows.start)),
                duration=delay,
                disposal=1,
                transparency=255,
                include_color_table=True,
            )
            file.write(b"".join(blocks))
            count += 1
        if count == 0:
            raise InputError(f"{path}: no frames to write, at least 1 wanted")
        file.write(b";")
    return count
