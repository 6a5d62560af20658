"""What all figures of the report share: looks, colours that the colour-blind tell apart, and files."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.files import written

OURS, OURS_TOO, PAPER, THIRD = "#0072b2", "#56b4e9", "#d55e00", "#009e73"
"""Okabe and Ito's: what is ours is blue, what is the paper's vermilion."""
INK, FAINT, PALE = "#20304a", "#8a94a6", "#dfe4ec"

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 7.8,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
}

DPI = 170


@contextmanager
def drawn(path: Path, *, panels: tuple[int, int] = (1, 1), size: tuple[float, float] = (7.2, 2.9)) -> Iterator[Any]:
    """Axes (rows, columns) of a new figure, which is written to `path` at the end, whole or not at all.

    Args:
        path: A PNG.
        panels: Rows and columns.
        size: Width and height [inch].
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(*panels, squeeze=False)
        figure.get_layout_engine().set(w_pad=0.06, h_pad=0.05, wspace=0.04, hspace=0.05)  # type: ignore[union-attr]
        yield axes
        with written(path) as part:
            figure.savefig(part, facecolor="white", format="png")


def letter(axes: Any, which: str, title: str = "") -> None:
    """A panel's letter and title."""
    axes.set_title(f"{which}  {title}" if title else which)


def write_csv(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Columns of equal length, with the names and units of their head, whole or not at all."""
    values = [np.asarray(column) for column in columns.values()]
    with written(path) as part:
        lines = [",".join(columns), *(",".join(f"{v:.8g}" for v in row) for row in zip(*values, strict=True))]
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


SMALL = ((1000, 128), (800, 48), (600, 32))
"""Widths [pixels] and numbers of colours of small pictures, the first that is small enough is taken."""
SMALL_BYTES = 100_000


def write_small(source: Path, path: Path) -> None:
    """A picture as small as a page of documents needs: some `SMALL_BYTES`, in few colours."""
    from PIL import Image

    with Image.open(source) as picture:
        whole = picture.convert("RGB")
    file = io.BytesIO()
    for width, colours in SMALL:
        plain = whole
        if plain.width > width:
            plain = plain.resize((width, round(plain.height * width / plain.width)), Image.Resampling.LANCZOS)
        few = plain.quantize(colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        file = io.BytesIO()
        few.save(file, format="PNG", optimize=True)
        if file.tell() <= SMALL_BYTES:
            break
    with written(path) as part:
        part.write_bytes(file.getvalue())
