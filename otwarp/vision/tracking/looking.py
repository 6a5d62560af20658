"""Several robots in one frame: found, cut out, and shown to a network; a table of what it says, and a picture."""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.vision.networks.estimate import ANGLES, QUANTITIES, Estimate
from otwarp.vision.networks.learnt import exceeded
from otwarp.vision.networks.run import Estimator
from otwarp.vision.tracking.facing import better, beyond, estimated, guesses, source_of
from otwarp.vision.tracking.finding import Found, crop, find
from otwarp.vision.tracking.source import NetworkSource

ROUNDS = 2
"""Times that a piece is cut out anew around where the network has the robot, which it learnt to see near the middle."""

SEVERAL = 1.5
"""Sides of a network's image beyond which a box is not that of one robot and its fringes."""


LONG = 2.0
"""Length over width of contrast from which on it says how a robot points."""

ASKEW = 20.0
"""Degrees beyond the learnt azimuths from which on that counts: fringes of what lies near turn contrast as well."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sighting:
    """One of the bodies in a frame.

    Attributes:
        found: Where the frame differs from its background.
        estimate: Of a network, from the middle pixel (width // 2, height // 2) of the whole frame; None without one.
        pixel: Of the frame [µm]; 0 where it is not known.
        middle: Column and row of the frame's middle pixel.
        note: What speaks against the estimate, or empty.
    """

    found: Found
    estimate: Estimate | None
    pixel: float
    middle: tuple[int, int]
    note: str = ""

    @property
    def place(self) -> tuple[float, float]:
        """Column and row of the centre [pixels]: as the network has it, or else of the contrast."""
        if self.estimate is None:
            return self.found.x, self.found.y
        return self.middle[0] + self.estimate.x / self.pixel, self.middle[1] + self.estimate.y / self.pixel

    def row(self) -> dict[str, Any]:
        """For a table: pixels, then µm and degrees, standard deviations, covariance [µm, rad]."""
        f, (x, y) = self.found, self.place
        row: dict[str, Any] = {"column": x, "row": y, "left": f.left, "low": f.low, "right": f.right, "high": f.high,
                               "contrast": f.contrast}  # fmt: skip
        if self.pixel:
            row |= {"x_um": (x - self.middle[0]) * self.pixel, "y_um": (y - self.middle[1]) * self.pixel}
        if self.estimate is not None:
            e, deviation = self.estimate, np.sqrt(np.diag(self.estimate.covariance))
            row |= {"depth_um": e.depth, "tilt_deg": math.degrees(e.tilt), "yaw_deg": math.degrees(e.yaw)}
            for name, sigma in zip(QUANTITIES, deviation, strict=True):
                row[f"sd_{name}_{'deg' if name in ANGLES else 'um'}"] = (
                    math.degrees(sigma) if name in ANGLES else float(sigma)
                )
            for m, first in enumerate(QUANTITIES):
                for n, last in enumerate(QUANTITIES[m:], start=m):
                    row[f"cov_{first}_{last}"] = float(e.covariance[m, n])
        return row | {"note": self.note}


def sightings(
    frame: np.ndarray,
    net: Estimator | None = None,
    *,
    pixel: float | None = None,
    scale: float = 4.0,
    smallest: float = 6.0,
    threshold: float = 8.0,
    join: float = 0.0,
) -> list[Sighting]:
    """Find the bodies in a frame, cut a piece around each, and ask a network how it lies there.

    Args:
        frame: (height, width) grey levels, row 0 the lowest; uint8 for a network.
        net: Of `otwarp.vision.networks.load`; None: places alone.
        pixel: Of the frame [µm]; None: the network's.
        scale, smallest, threshold, join: As of `find` [pixels].

    Raises:
        InputError: No image, one that the network cannot take, or numbers out of range.
    """
    if net is not None:
        if frame.dtype != np.uint8:
            raise InputError(f"IMAGE has levels of {frame.dtype}; allowed with --net: uint8, as it was trained on")
        if pixel is not None and abs(net.pixel / pixel - 1.0) > 0.02:
            raise InputError(f"--pixel is {pixel:g} µm; allowed with --net: its own, {net.pixel:g} µm")
    size = pixel or (net.pixel if net is not None else 0.0)
    middle = frame.shape[1] // 2, frame.shape[0] // 2
    found = find(frame, scale=scale, smallest=smallest, threshold=threshold, join=join)
    if net is None:
        return [Sighting(found=f, estimate=None, pixel=size, middle=middle, note=_cut(f, frame)) for f in found]
    source = source_of(net)
    return [_looked(frame, f, source, size, middle) for f in found]


def _looked(frame: np.ndarray, f: Found, source: NetworkSource, pixel: float, middle: tuple[int, int]) -> Sighting:
    """What a network says of a piece around something that was found; turned where it points elsewhere than learnt."""
    net, ways = source.net, guesses(f, source)
    notes = [_cut(f, frame)]
    if f.right - f.left > SEVERAL * net.shape[1] or f.high - f.low > SEVERAL * net.shape[0]:
        notes.append("several robots, or none: larger than the network's images")
    if ways is None:
        estimate, by = _estimate(frame, f, dataclasses.replace(source, azimuth=None), pixel, None), 0.0
        other = _askew(f, net)
    else:
        assert source.azimuth is not None
        estimate, other = better(net, *(_estimate(frame, f, source, pixel, way) for way in ways))
        by = f.azimuth - source.azimuth
        by += math.pi * (math.cos(estimate.yaw - f.azimuth) < 0.0)  # the way that was taken
    there = middle[0] + estimate.x / pixel, middle[1] + estimate.y / pixel
    if not (f.left <= there[0] <= f.right and f.low <= there[1] <= f.high):
        notes.append("the network has its centre elsewhere")
    notes.append(other)
    unknown = exceeded(net.about, estimated(estimate, by))
    if unknown:
        notes.append(f"beyond what the network has learnt: {', '.join(unknown)}")
    return Sighting(found=f, estimate=estimate, pixel=pixel, middle=middle, note="; ".join(n for n in notes if n))


def _estimate(frame: np.ndarray, f: Found, source: NetworkSource, pixel: float, guess: np.ndarray | None) -> Estimate:
    """From the middle pixel of the frame, of a piece that is cut out anew around where the network has the robot."""
    rows, columns = frame.shape
    height, width = source.net.shape if source.azimuth is None else (source.side,) * 2
    x, y, at, estimate = f.x, f.y, (0, 0), None
    for _ in range(1 + ROUNDS):
        piece, at = crop(frame, x, y, width, height)
        estimate = source.look(piece, guess)[0]
        there = at[0] + estimate.x / pixel, at[1] + estimate.y / pixel
        if not (0.0 <= there[0] <= columns - 1 and 0.0 <= there[1] <= rows - 1) or _near(there, at):
            break
        x, y = there
    assert estimate is not None
    place = {"x": (at[0] - columns // 2) * pixel, "y": (at[1] - rows // 2) * pixel}
    return dataclasses.replace(estimate, **{name: getattr(estimate, name) + by for name, by in place.items()})


def _near(there: tuple[float, float], at: tuple[int, int]) -> bool:
    """Whether a piece that is cut out anew would be the same one."""
    return all(math.floor(p + 0.5) == q for p, q in zip(there, at, strict=True))


def _askew(f: Found, net: Estimator) -> str:
    """What is said where long contrast points far from all azimuths that a network has learnt, modulo half a turn."""
    first, last = net.about.get("learnt", {}).get("yaw", (-180.0, 180.0))
    if f.length < LONG * f.width or math.degrees(beyond(f, net)) < ASKEW:
        return ""
    learnt = f"{first:.4g}" if first == last else f"{first:.4g} to {last:.4g}"
    return (
        f"its contrast points along {math.degrees(f.azimuth):.0f}°: the network has learnt azimuths of {learnt}° alone"
    )


def _cut(f: Found, frame: np.ndarray) -> str:
    edge = f.left <= 0 or f.low <= 0 or f.right >= frame.shape[1] or f.high >= frame.shape[0]
    return "cut by the edge of the frame" if edge else ""


def save_table(file: Path, seen: Sequence[Sighting]) -> Path:
    """Write a line for each body (CSV); units stand in the names of columns, covariances are of µm and rad.

    Raises:
        InputError: The file cannot be written.
    """
    rows = [s.row() for s in seen]
    # readers of tables need a head where nothing was found as well
    nothing = Sighting(found=Found(*(0,) * len(dataclasses.fields(Found))), estimate=None, pixel=0.0, middle=(0, 0))
    with written(file, f"--out {file}") as part, part.open("w", newline="", encoding="utf-8") as opened:
        table = csv.DictWriter(opened, rows[0] if rows else nothing.row())
        table.writeheader()
        table.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    return file


def draw_sightings(file: Path, frame: np.ndarray, seen: Sequence[Sighting]) -> Path:
    """Write the frame with a box around each body, its centre, and its long axis as it points in the image (PNG).

    Raises:
        InputError: The file cannot be written.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    rows, columns = frame.shape
    figure = Figure(figsize=(7.0, 7.0 * rows / columns), layout="constrained")
    axes = figure.add_subplot()
    low, high = np.percentile(frame, (0.1, 99.9))
    axes.imshow(frame, cmap="gray", origin="lower", vmin=low, vmax=max(high, low + 1e-9))
    for n, one in enumerate(seen, start=1):
        f, (x, y) = one.found, one.place
        color = "#d62728" if one.note else "#2ca02c"
        axes.add_patch(
            Rectangle((f.left - 0.5, f.low - 0.5), f.right - f.left, f.high - f.low, fill=False, color=color)
        )
        words = str(n)
        if one.estimate is not None:
            words += _drawn(axes, one, f, color)
        axes.plot(x, y, "+", color=color, markersize=8)
        axes.text(f.left, f.high + 2, words, color=color, fontsize=8, va="bottom", clip_on=True)
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(-0.5, rows - 0.5)
    axes.set_xlabel("column [pixels]", fontsize=8)
    axes.set_ylabel("row [pixels]", fontsize=8)
    axes.tick_params(labelsize=7)
    with written(file, f"--out {file}") as part:
        figure.savefig(part, dpi=130, format="png")
    return file


def _drawn(axes: Any, one: Sighting, f: Found, color: str) -> str:
    """Draw the axis of a robot, and say depth and tilt."""
    e, (x, y) = one.estimate, one.place
    assert e is not None
    words = f": {e.depth:+.2f} ± {2 * math.sqrt(e.covariance[2, 2]):.2g} µm" if "depth" in e.known else ""
    if "tilt" in e.known:
        half = 0.5 * max(f.right - f.left, f.high - f.low) * math.cos(e.tilt)
        along = half * math.cos(e.yaw), half * math.sin(e.yaw)
        axes.plot([x - along[0], x + along[0]], [y - along[1], y + along[1]], color=color, linewidth=1.0)
        words += f", {math.degrees(e.tilt):.1f}°"
    return words
