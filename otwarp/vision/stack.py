"""Stacks of images on disk: panels with their focal planes, grey levels as TIFF, numbers as NumPy's file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written

ENDINGS = (".png", ".tif", ".npy")


def check_ending(file: Path) -> None:
    """Refuse a file whose ending says nothing that can be written.

    Raises:
        InputError: Another ending.
    """
    if file.suffix not in ENDINGS:
        raise InputError(f"--out is {file}; allowed: a file that ends with {', '.join(ENDINGS)}")


def save_stack(file: Path, intensity: np.ndarray, levels: np.ndarray, focus: np.ndarray, pixel: float) -> Path:
    """Write images: as panels side by side (PNG), all grey levels (TIFF, a page each), or intensities (NumPy).

    Args:
        file: Where; its ending says what.
        intensity: (f, height, width), unhindered light is 1, row 0 the lowest.
        levels: The same as the sensor's grey levels.
        focus: (f) heights of the focal planes relative to the camera's own [µm].
        pixel: [µm].

    Raises:
        InputError: Another ending, or a file that cannot be written.
    """
    check_ending(file)
    with written(file, f"--out {file}") as part:
        if file.suffix == ".npy":
            np.save(part, intensity.astype(np.float32))
        elif file.suffix == ".tif":
            from PIL import Image

            pages = [Image.fromarray(page[::-1]) for page in levels]
            pages[0].save(part, save_all=True, append_images=pages[1:])
        else:
            _panels(part, levels, focus, pixel)
    return file


def _panels(file: Path, levels: np.ndarray, focus: np.ndarray, pixel: float) -> None:
    from matplotlib.figure import Figure

    count, height, width = levels.shape
    columns = min(count, 7)
    rows = -(-count // columns)
    figure = Figure(figsize=(2.0 * columns, 2.0 * rows * height / width + 0.3 * rows), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.05)  # type: ignore[union-attr]
    top = 255 if levels.dtype == np.uint8 else 65535
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
