"""Poses and images a second: by method, and by size of the image and number of source points."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.report import NOTHING, Table
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import illumination
from otwarp.vision.image import images_many
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate_many
from otwarp.vision.rendering import Rendering, expose, render_many
from otwarp.vision.slices import Method
from otwarp.vision.specimen import Specimen

RUNGS: tuple[tuple[Method, float], ...] = (
    ("two_index", 0.2),
    ("two_index", 0.1),
    ("two_index", 0.05),
    ("beam", 0.1),
    ("projection", 0.1),
)
FOCUS = np.linspace(-6.0, 6.0, 9)
LEANING = np.outer(np.linspace(-1.75, 1.75, 5), (0.5**0.5, 0.0, 0.5**0.5))
"""Centres of a robot's spheres [µm]."""
TOGETHER = 32
"""Poses that a GPU is timed with."""
SIZES = (128, 256)
"""Pixels of a side of the images that are timed as users get them."""


def label(rung: tuple[Method, float]) -> str:
    """Of a rung in a table."""
    return f"{rung[0].replace('_', '-')}, {rung[1]:g} µm"


def times(fourier: Fourier, rounds: int, data: dict[str, Any]) -> Table:
    """Processor time on a CPU, wall time on a GPU: least of some rounds; on a GPU of many poses together as well."""
    grid = Grid(128, 128, 128, 128, 0.16)
    microscope = Microscope(condenser_aperture=0.4)
    light = illumination(microscope, grid.length)
    robots = [leaning(azimuth) for azimuth in np.arange(TOGETHER) * np.pi / TOGETHER]
    together, rows = (1, TOGETHER) if fourier.device.is_cuda else (1,), []
    for method, thickness in RUNGS:
        cells = []
        for count in together:
            some = robots[:count]
            lead = partial(propagate_many, some, microscope, light, grid, fourier, method=method, thickness=thickness)
            pose, spectra = least(lead, fourier, rounds)
            image, _ = least(partial(images_many, spectra, microscope, light, grid, fourier, FOCUS), fourier, rounds)
            seconds = {"pose": pose / count, "image": image / (count * len(FOCUS))}
            data["seconds"][f"{method} {thickness}" + (f", {count} poses" if count > 1 else "")] = seconds
            cells += [f"{1 / s:.3g}" for s in seconds.values()]
        rows.append((label((method, thickness)), *cells))
    clock = time.process_time if fourier.device.is_cpu else time.perf_counter
    begun = clock()
    scattered_spectra(Specimen.of_spheres(LEANING[[0, 2, 4]], 0.75, 1.52), microscope, light, grid, fourier)
    data["seconds"]["mie"] = {"pose": clock() - begun}
    unmeasured = [NOTHING] * (len(rows[0]) - 2)
    rows.append(("exact, three spheres", f"{1 / data['seconds']['mie']['pose']:.2g}", *unmeasured))
    many = (f"poses/s, {TOGETHER} together", "images/s of these") if len(together) > 1 else ()
    return Table(title="Poses and images a second, 128 × 128 points, 61 source points, a robot 4 µm high",
                 head=("method", "poses/s", "images/s", *many), rows=rows,
                 note=f"Nine planes of each pose; transforms by {fourier.library}; one core's processor time on a CPU, "
                 "wall time with images on the host on a GPU.")  # fmt: skip


def sizes(fourier: Fourier, rounds: int, data: dict[str, Any]) -> Table:
    """Times as of `times` of what `expose` and `render_many` do, by size of the image and source points."""
    microscope, many = Microscope(condenser_aperture=0.4, pixel=0.11), fourier.device.is_cuda
    robots = [leaning(azimuth) for azimuth in np.arange(TOGETHER) * np.pi / TOGETHER]
    rows = []
    for size in SIZES:
        for rings in (4, "auto"):
            how: dict[str, Any] = {"rendering": Rendering(rings=rings), "fourier": fourier, "focus": FOCUS}
            pose, light = least(partial(expose, robots[0], microscope, size, **how), fourier, rounds)
            image, _ = least(partial(light.images, FOCUS), fourier, rounds)
            seconds = {"pose": pose, "image": image / len(FOCUS)}
            points = f"{light.sources}, auto" if rings == "auto" else f"{light.sources}, {rings} rings"
            cells = [f"{1 / s:.3g}" for s in seconds.values()]
            if many:
                whole, _ = least(partial(render_many, robots, microscope, size, **how), fourier, rounds)
                seconds["image of many"] = whole / (TOGETHER * len(FOCUS))
                cells.append(f"{1 / seconds['image of many']:.3g}")
            data["seconds"][f"{size} pixels, {points}"] = seconds
            rows.append((f"{size} × {size}", points, str(light.grid.cells), *cells))
    together = (f"images/s, light of {TOGETHER} poses led through as well",) if many else ()
    return Table(title="Poses and images a second as users get them, two-index, 0.2 µm",
                 head=("pixels", "source points", "points of a side of the grid", "poses/s", "images/s", *together),
                 rows=rows, note="The robot and the nine planes of the table above, −6 to 6 µm, with the margin that "
                 "they need. `auto` holds the error of the far planes, and looks at near ones with fewer of its "
                 "points.")  # fmt: skip


def leaning(azimuth: float) -> Specimen:
    """A robot of five spheres that leans 45° to a side."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    return Specimen.of_spheres(LEANING @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), 0.75, 1.52)


def least(work: Callable[[], Any], fourier: Fourier, rounds: int) -> tuple[float, Any]:
    """Least time of some rounds after the first [s], and what the last returned."""
    clock = time.process_time if fourier.device.is_cpu else time.perf_counter
    times = []
    for _ in range(rounds + 1):
        wp.synchronize_device(fourier.device)
        begun = clock()
        found = work()
        wp.synchronize_device(fourier.device)
        times.append(clock() - begun)
    return min(times[1:]), found
