"""Images of spheres by every rung of the ladder: how far from exact, and how long they take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination, illumination
from otwarp.vision.image import images
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import Method, propagate
from otwarp.vision.specimen import Specimen

GRID = Grid(128, 128, 128, 128, 0.11)
"""Light and pixels on one grid, so that every method is looked at in the same points."""

RUNGS: tuple[tuple[Method, float], ...] = (
    ("two_index", 0.2),
    ("two_index", 0.1),
    ("two_index", 0.05),
    ("beam", 0.1),
    ("projection", 0.1),
)
SPHERES = ((0.5, 1.38), (0.5, 1.59), (1.0, 1.38), (1.0, 1.52), (1.0, 1.59), (2.5, 1.38), (2.5, 1.59))
PAIRS = {"along z": (0.0, 0.0, 1.0), "tilted by 45°": (0.5**0.5, 0.0, 0.5**0.5), "side by side": (1.0, 0.0, 0.0)}
FOCUS = np.linspace(-6.0, 6.0, 9)
APERTURES = (0.0, 0.4)


def errors(specimen: Specimen, microscope: Microscope, light: Illumination, fourier: Fourier) -> dict[Any, np.ndarray]:
    """Per rung, of each focal plane the root mean square error over the root mean square contrast."""
    seen = lambda spectra: images(spectra, microscope, light, GRID, fourier, FOCUS)  # noqa: E731
    exact = seen(scattered_spectra(specimen, microscope, light, GRID, fourier))
    contrast = np.sqrt(np.mean((exact - 1.0) ** 2, axis=(1, 2)))
    found = {}
    for method, thickness in RUNGS:
        spectra = propagate(specimen, microscope, light, GRID, fourier, method=method, thickness=thickness)
        image = seen(spectra)
        found[method, thickness] = np.sqrt(np.mean((image - exact) ** 2, axis=(1, 2))) / contrast
    return found


def measure(device: str = "cpu", *, apertures: Sequence[float] = APERTURES, rounds: int = 5) -> Section:
    """Errors of all rungs for spheres and pairs of spheres; time of a pose and of an image."""
    place, fourier = pick_device(device), Fourier(device)
    data: dict[str, Any] = {"errors": {}, "seconds": {}}
    tables = []
    for aperture in apertures:
        microscope = Microscope(condenser_aperture=aperture, pixel=GRID.pixel)
        light = illumination(microscope, GRID.length)
        rows = []
        cases = [(f"radius {r} µm, index {n}", Specimen.of_spheres([[0, 0, 0]], r, n)) for r, n in SPHERES]
        cases += [(f"two of 1 µm, 1.52, {name}", Specimen.of_spheres(np.outer((-1, 1), d), 1.0, 1.52))
                  for name, d in PAIRS.items()]  # fmt: skip
        for name, specimen in cases:
            found = errors(specimen, microscope, light, fourier)
            rows.append((name, *(f"{e.mean():.3f} ({e.max():.2f})" for e in found.values())))
            data["errors"][f"{name}, condenser {aperture}"] = {f"{m} {t}": e.tolist() for (m, t), e in found.items()}
        head = ("specimen", *(f"{m.replace('_', '-')}, {t:g} µm" for m, t in RUNGS))
        what = "coherent light" if aperture == 0.0 else f"condenser {aperture}, {len(light.weights)} source points"
        title = f"Error over contrast, mean and (largest) of nine focal planes; {what}"
        tables.append(Table(title=title, head=head, rows=rows, note="Medium 1.33, 0.55 µm, NA 1.2, −6 to 6 µm."))
    tables.append(_times(fourier, rounds, data))
    kind = "cpu" if place.is_cpu else "cuda"
    asked = "" if tuple(apertures) == APERTURES else f"--apertures {' '.join(f'{a:g}' for a in apertures)}"
    return Section(name="vision", kind=kind, machine=Machine.look(place), tables=tables, data=data, asked=asked)


def _times(fourier: Fourier, rounds: int, data: dict[str, Any]) -> Table:
    """Processor time on a CPU, wall time on a GPU: least of some rounds, as the issue of every rung."""
    grid = Grid(128, 128, 128, 128, 0.16)
    microscope = Microscope(condenser_aperture=0.4)
    light = illumination(microscope, grid.length)
    s = 0.5**0.5
    rod = np.outer(np.linspace(-1.75, 1.75, 5), (s, 0.0, s))  # 5 µm from top to bottom with its spheres
    robot = Specimen.of_spheres(rod, 0.75, 1.52)
    clock = time.process_time if fourier.device.is_cpu else time.perf_counter
    rows = []
    for method, thickness in (rung for rung in RUNGS if rung[1] != 0.05):
        poses, looks, spectra = [], [], None
        for _ in range(rounds + 1):
            begun = clock()
            spectra = propagate(robot, microscope, light, grid, fourier, method=method, thickness=thickness)
            fourier.numpy(spectra[0, 0])
            poses.append(clock() - begun)
            begun = clock()
            images(spectra, microscope, light, grid, fourier, FOCUS)
            looks.append((clock() - begun) / len(FOCUS))
        pose, look = min(poses[1:]), min(looks[1:])
        rows.append((f"{method.replace('_', '-')}, {thickness:g} µm", f"{1 / pose:.3g}", f"{1 / look:.3g}"))
        data["seconds"][f"{method} {thickness}"] = {"pose": pose, "image": look}
    begun = clock()
    scattered_spectra(Specimen.of_spheres(rod[[0, 2, 4]], 0.75, 1.52), microscope, light, grid, fourier)
    rows.append(("exact, three spheres", f"{1 / (clock() - begun):.2g}", rows[0][2]))
    return Table(title="Poses and images a second, 128 × 128 points, 61 source points, a robot 5 µm high",
                 head=("method", "poses/s", "images/s"), rows=rows,
                 note=f"Transforms by {fourier.library}; one core's processor time on a CPU.")  # fmt: skip


if __name__ == "__main__":
    command(
        measure,
        "Errors and speed of the microscope's images.",
        rounds=5,
        apertures={"type": float, "nargs": "+", "default": APERTURES, "help": "numerical apertures of the condenser"},
    )
