"""Pictures and movies on disk. A file appears under its name only when it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import GifImagePlugin, Image

from otwarp.errors import InputError

_CHANGED = 3
"""Levels by which a pixel must differ from the frame before to be written again."""


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a hidden neighbour of `path` for writing; on success it takes the name `path`, else it is removed.

    Raises:
        InputError: The folder does not exist or cannot be written.
    """
    hidden = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        file = hidden.open("wb")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); a file in a writable folder is wanted"
        ) from None
    try:
        with file:
            yield file
        hidden.replace(path)
    except OSError as error:
        hidden.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    except BaseException:
        hidden.unlink(missing_ok=True)
        raise


def save_png(image: np.ndarray, path: str | Path) -> Path:
    """Write an (h, w, 3) uint8 image as PNG.

    Raises:
        InputError: The file cannot be written.
    """
    path = Path(path)
    with atomic_file(path) as file:
        Image.fromarray(image).save(file, format="PNG")
    return path


def _changed_box(before: np.ndarray | None, image: np.ndarray) -> tuple[int, int, int, int]:
    """(left, upper, right, lower) of what differs from the frame before; one pixel if nothing does."""
    height, width = image.shape[:2]
    if before is None:
        return 0, 0, width, height
    different = (np.abs(image.astype(np.int16) - before) > _CHANGED).any(axis=2)
    rows, columns = np.flatnonzero(different.any(axis=1)), np.flatnonzero(different.any(axis=0))
    if len(rows) == 0:
        return 0, 0, 1, 1
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def save_movie(frames: Iterable[np.ndarray], path: str | Path, fps: float) -> int:
    """Write frames, (h, w, 3) uint8 each, as an endless GIF while they come; memory holds two of them.

    Each frame carries its own 256 colours and only the box that changed.

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
    count, shown, before = 0, 0.0, None
    with atomic_file(path) as file:
        for image in frames:
            if before is not None and image.shape != before.shape:
                raise InputError(f"{path}: frame {count} has shape {image.shape}, the ones before {before.shape}")
            left, upper, right, lower = _changed_box(before, image)
            part = Image.fromarray(np.ascontiguousarray(image[upper:lower, left:right]))
            part = part.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
            if before is None:
                header, _ = GifImagePlugin.getheader(part, info={"loop": 0})
                file.write(b"".join(header))
            # GIF counts in hundredths of a second: carry the rounding over, so that the film keeps its length.
            delay = 10 * (round(100.0 * (count + 1) / fps) - round(shown))
            shown += delay / 10
            file.write(
                b"".join(
                    GifImagePlugin.getdata(
                        part, offset=(left, upper), duration=delay, disposal=1, include_color_table=True
                    )
                )
            )
            before, count = image, count + 1
        if count == 0:
            raise InputError(f"{path}: no frames to write, at least 1 wanted")
        file.write(b";")
    return count
