"""Stacks of images on disk: panels with their focal planes, grey levels as TIFF, numbers as NumPy's file; and read."""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written

ENDINGS = (".png", ".tif", ".npy")
READ = (".png", ".tif", ".tiff", ".npy")
"""Endings of files that are read."""
TIFF_DATA = ((273, 279), (324, 325))
"""Tags of where the strips of a page begin, and of their lengths; then of its tiles (TIFF 6.0)."""


def check_ending(file: Path) -> None:
    """Refuse a file whose ending says nothing that can be written.

    Raises:
        InputError: Another ending.
    """
    if file.suffix not in ENDINGS:
        raise InputError(f"--out is {file}; allowed: a file that ends with {', '.join(ENDINGS)}")


def save_stack(
    file: Path, intensity: np.ndarray, levels: np.ndarray, focus: np.ndarray, pixel: float, bits: int = 8
) -> Path:
    """Write images: as panels side by side (PNG), all grey levels (TIFF, a page each), or intensities (NumPy).

    Args:
        file: Where; its ending says what.
        intensity: (f, height, width), unhindered light is 1, row 0 the lowest.
        levels: The same as the sensor's grey levels.
        focus: (f) heights of the focal planes relative to the camera's own [µm].
        pixel: [µm].
        bits: Of a grey level; panels are white at full scale.

    Raises:
        InputError: Another ending, or a file that cannot be written.
        OSError: The disk is full; it names `file`.
    """
    check_ending(file)
    with written(file, f"--out {file}") as part:
        if file.suffix == ".npy":
            made = io.BytesIO()  # NumPy, which writes to a file itself, does not say that the disk is full
            np.save(made, intensity.astype(np.float32))
            part.write_bytes(made.getbuffer())
        elif file.suffix == ".tif":
            from PIL import Image

            pages = [Image.fromarray(page[::-1]) for page in levels]
            pages[0].save(part, save_all=True, append_images=pages[1:])
        else:
            _panels(part, levels, focus, pixel, 2**bits - 1)
    return file


def _panels(file: Path, levels: np.ndarray, focus: np.ndarray, pixel: float, top: int) -> None:
    from matplotlib.figure import Figure

    count, height, width = levels.shape
    columns = min(count, 7)
    rows = -(-count // columns)
    figure = Figure(figsize=(2.0 * columns, 2.0 * rows * height / width + 0.3 * rows), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.05)  # type: ignore[union-attr]
    bar = _round_length(0.3 * width * pixel)
    for n, (page, z) in enumerate(zip(levels, focus, strict=True)):
        axes = figure.add_subplot(rows, columns, n + 1)
        axes.imshow(page, cmap="gray", vmin=0, vmax=top, origin="lower", interpolation="nearest")
        axes.set_title(f"{z:+g} µm", fontsize=8)
        axes.set_axis_off()
        if n == 0:
            y = 0.06 * height
            axes.plot([0.06 * width, 0.06 * width + bar / pixel], [y, y], color="white", linewidth=2)
            axes.text(0.06 * width, y + 0.03 * height, f"{bar:g} µm", color="white", fontsize=7)
    figure.savefig(file, dpi=150, format="png")


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(f * power for f in (1, 2, 5) if f * power <= length * (1 + 1e-9)))


def load_stack(file: str | Path) -> np.ndarray:
    """(f, height, width) images of a file, row 0 the lowest: pages of a TIFF, a PNG, or an array of NumPy's.

    Grey levels are uint8 or uint16, NumPy's files may hold any real numbers, with row 0 the lowest as `save_stack`
    writes them. Colours count as grey where they are equal.

    Raises:
        InputError: Another ending, a file that cannot be read, or images that are not grey.
    """
    path = Path(file)
    if path.suffix.lower() not in READ:
        raise InputError(f"{path}: ending = {path.suffix or 'none'}; allowed: {', '.join(READ)}")
    with _readable(path):
        pages = _array(path) if path.suffix.lower() == ".npy" else _pages(path)
    if pages.ndim == 4 and pages.shape[-1] in (3, 4):
        if np.any(pages[..., :3] != pages[..., :1]):
            raise InputError(f"{path}: images are in colour; allowed: grey ones")
        pages = pages[..., 0]
    if pages.ndim != 3 or not pages.size or pages.dtype.kind not in "uif":
        raise InputError(f"{path}: images are {pages.dtype} {pages.shape}; allowed: (height, width) or (images, "
                         "height, width) of numbers")  # fmt: skip
    if pages.dtype.kind == "f" and not np.all(np.isfinite(pages)):
        raise InputError(f"{path}: images have values that are not finite; allowed: finite numbers")
    return pages


def size_of(file: Path) -> tuple[int, int]:
    """Width and height of a file's images [pixels], by what stands at its beginning; no image is decoded.

    Raises:
        InputError: It cannot be read, or ends before its images do.
    """
    with _readable(file):
        if file.suffix.lower() == ".npy":
            shape = _array(file, "r").shape
            if len(shape) < 3:
                raise ValueError(f"its shape is {shape}")
            return shape[2], shape[1]
        from PIL import Image

        with Image.open(file) as opened:
            ends = {"PNG": _png_ends, "TIFF": _tiff_ends}.get(opened.format or "")
            if ends is not None and not ends(file, opened):
                raise ValueError("it ends before its images do")
            return opened.size


def _png_ends(file: Path, opened: Any) -> bool:
    """Whether the chunks of a PNG lead to the one that ends it; whatever comes after that does not matter."""
    with file.open("rb") as stream:
        stream.seek(8)
        while len(head := stream.read(8)) == 8:
            length, kind = struct.unpack(">I4s", head)
            if kind == b"IEND":
                return True
            stream.seek(length + 4, os.SEEK_CUR)
    return False


def _tiff_ends(file: Path, opened: Any) -> bool:
    """Whether all strips and tiles that the pages of a TIFF name lie within the file."""
    from PIL import ImageSequence

    size = file.stat().st_size
    for page in ImageSequence.Iterator(opened):
        for tags in TIFF_DATA:
            starts, counts = (page.tag_v2.get(tag, ()) for tag in tags)  # type: ignore[attr-defined]
            if any(start + count > size for start, count in zip(starts, counts, strict=False)):
                return False
    return True


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Say in one line why a file of images cannot be read.

    Raises:
        InputError: It cannot.
    """
    try:
        yield
    except (OSError, ValueError, EOFError, SyntaxError) as error:  # SyntaxError is what Pillow makes of a broken PNG
        why = "there is no such file" if isinstance(error, FileNotFoundError) else " ".join(str(error).split())[:120]
        raise InputError(f"{path}: cannot be read ({why}); allowed: images, {', '.join(READ)}") from None


def _array(path: Path, mapped: Literal["r"] | None = None) -> np.ndarray:
    found = np.load(path, mmap_mode=mapped, allow_pickle=False)
    if not isinstance(found, np.ndarray):
        found.close()
        raise ValueError("it is an archive of several arrays")
    return found[None] if found.ndim == 2 else found


def _pages(path: Path) -> np.ndarray:
    from PIL import Image, ImageSequence

    with Image.open(path) as opened:
        pages = []
        for page in ImageSequence.Iterator(opened):
            if page.mode in ("1", "P", "LA", "PA", "CMYK", "YCbCr", "HSV"):
                page = page.convert("RGB")
            pages.append(np.array(page)[::-1])
    if any(page.shape != pages[0].shape for page in pages):
        raise ValueError("its pages differ in size")
    found = np.stack(pages)
    # Pillow has 16 bits of a PNG as whole numbers of 32
    narrow = found.dtype.kind == "i" and found.size and found.min() >= 0 and found.max() <= 65535
    return found.astype(np.uint16) if narrow else found
