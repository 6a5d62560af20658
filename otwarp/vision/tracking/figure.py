"""The picture of a track: frames with estimate and truth drawn on them, and both in the course of time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.files import written
from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.tracking.recorded import RecordedBody, Step, in_camera
from otwarp.vision.tracking.results import Errors
from otwarp.vision.view import camera_of

SHOWN = 6
"""Frames that are drawn."""

TRUTH, TRACK, SEEN = "#2ca02c", "#d62728", "#8c8c8c"


def draw_track(file: Path, recorded: RecordedBody, steps: list[Step], errors: Errors) -> Path:
    """Write the picture as PNG.

    Args:
        file: Where.
        recorded, steps, errors: The run and what came of it.

    Raises:
        InputError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.2), layout="constrained")
    grid = figure.add_gridspec(3, SHOWN, height_ratios=[1.35, 1.0, 1.0])
    for n, k in enumerate(np.linspace(0, len(steps) - 1, SHOWN).round().astype(int)):
        _image(figure.add_subplot(grid[0, n]), recorded, int(k), steps[int(k)], legend=n == 0)
    time, quantities = np.array([s.time for s in steps]), _quantities(recorded, steps)
    panels = [grid[1, :3], grid[1, 3:], grid[2, :3], grid[2, 3:]]
    for place, (name, (truth, track, spread, seen)) in zip(panels[: len(quantities)], quantities, strict=True):
        axes = figure.add_subplot(place)
        axes.plot(time, seen, ".", color=SEEN, markersize=2.5, label="seen")
        axes.fill_between(time, track - 2 * spread, track + 2 * spread, color=TRACK, alpha=0.2, linewidth=0)
        axes.plot(time, track, color=TRACK, linewidth=1.0, label="track ± 2σ")
        axes.plot(time, truth, color=TRUTH, linewidth=0.8, label="truth")
        axes.set_ylabel(name, fontsize=8)
        axes.tick_params(labelsize=7)
        if place is panels[0]:
            # above the curves, which may be anywhere within
            axes.legend(fontsize=7, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
        if place in panels[len(quantities) - 2 :]:
            axes.set_xlabel("time [s]", fontsize=8)
    with written(file, f"--out {file}") as part:
        figure.savefig(part, dpi=130, format="png")
    return file


def _image(axes: Any, recorded: RecordedBody, frame: int, step: Step, *, legend: bool) -> None:
    camera = camera_of(recorded.scene)
    pixel, size = camera.pixel_size, step.image.shape[0]
    low = np.percentile(step.image, 0.5), np.percentile(step.image, 99.5)
    extent = (-(size // 2) - 0.5) * pixel, (size - size // 2 - 0.5) * pixel
    axes.imshow(step.image, cmap="gray", origin="lower", vmin=low[0], vmax=low[1], extent=(*extent, *extent))
    own = recorded.index
    _outline(axes, recorded, step, recorded.position[frame, own], recorded.orientation[frame, own], TRUTH, "-")
    if step.pose is not None:
        _outline(axes, recorded, step, step.pose.position, step.pose.orientation, TRACK, ":")
    axes.set_xlim(extent)
    axes.set_ylim(extent)
    axes.set_title(f"{step.time:.2f} s", fontsize=8)
    axes.set_axis_off()
    if legend:
        bar = 2.0
        axes.plot([extent[0] + 0.6, extent[0] + 0.6 + bar], [extent[0] + 0.8] * 2, color="white", linewidth=2)
        axes.text(extent[0] + 0.6, extent[0] + 1.1, f"{bar:g} µm", color="white", fontsize=7)


def _outline(
    axes: Any, recorded: RecordedBody, step: Step, place: np.ndarray, turn: np.ndarray, color: str, style: str
) -> None:
    """Circles around the spheres of a body."""
    at, frame = in_camera(camera_of(recorded.scene), place, turn)
    angle = np.linspace(0.0, 2.0 * math.pi, 61)
    for sphere in recorded.scene.bodies[recorded.index].spheres:
        x, y, _ = at + frame @ np.array(sphere.offset) - [*step.middle, 0.0]
        axes.plot(
            x + sphere.radius * np.cos(angle), y + sphere.radius * np.sin(angle), color=color, linestyle=style,
            linewidth=1.2,
        )  # fmt: skip


def _quantities(recorded: RecordedBody, steps: list[Step]) -> list[tuple[str, list[np.ndarray]]]:
    """x, y, z of the prim [µm] and, with an axis, its tilt [°]: truth, track, its standard deviation, what was seen."""
    from otwarp.vision.tracking.shape import Shape

    shape = Shape.of(recorded.scene, recorded.body, np.zeros(3))
    own, n = recorded.index, len(steps)
    normal = rotation_matrix(np.array(camera_of(recorded.scene).orientation))[:, 2]
    truth, track, spread, seen = (np.full((n, 4), np.nan) for _ in range(4))
    for k, step in enumerate(steps):
        turn = rotation_matrix(recorded.orientation[k, own])
        truth[k] = *recorded.position[k, own], _tilt(turn @ shape.axis, normal)
        if step.pose is not None:
            its = rotation_matrix(step.pose.orientation)
            lift = np.cross(its @ shape.axis, normal)
            lift = lift / max(float(np.linalg.norm(lift)), 1e-9)
            about = math.sqrt(float(lift @ step.pose.covariance[3:, 3:] @ lift))
            track[k] = *step.pose.position, _tilt(its @ shape.axis, normal)
            spread[k] = *np.sqrt(np.diag(step.pose.covariance)[:3]), math.degrees(about)
            if step.seen is not None:
                seen[k, :3] = step.seen.position - its @ (shape.arm - shape.origin)
        if step.seen is not None and step.seen.axis is not None:
            sign = -1.0 if shape.reversible and step.seen.axis @ (turn @ shape.axis) < 0.0 else 1.0
            seen[k, 3] = _tilt(sign * step.seen.axis, normal)
    # a lone sphere has no axis
    names = ("x [µm]", "y [µm]", "z [µm]", "tilt [°]")[: 4 if np.any(shape.axis) else 3]
    return [(name, [values[:, k] for values in (truth, track, spread, seen)]) for k, name in enumerate(names)]


def _tilt(axis: np.ndarray, normal: np.ndarray) -> float:
    return math.degrees(math.asin(float(np.clip(axis @ normal, -1.0, 1.0))))
