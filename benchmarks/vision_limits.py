"""What the images of `benchmarks.vision` converge to: slices, points and directions; symmetry; light that is kept."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from otwarp.bench.report import Table
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import Illumination, illumination, lattice
from otwarp.vision.image import images
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate
from otwarp.vision.rendering import Rendering, expose, grid_for
from otwarp.vision.slices import sliced
from otwarp.vision.specimen import Specimen

GRID = Grid(128, 128, 128, 128, 0.11)
FOCUS = np.linspace(-6.0, 6.0, 9)
MICROSCOPE = Microscope(condenser_aperture=0.5, pixel=GRID.pixel)
SLICES = (0.4, 0.2, 0.1, 0.05, 0.025)
CELLS = (74, 88, 128, 176)
BALL = Specimen.of_spheres([[0, 0, 0]], 1.0, 1.52)
LARGE = Specimen.of_spheres([[0, 0, 0]], 2.5, 1.59)
STACK = Specimen.of_spheres([[0, 0, -1], [0, 0, 1]], 1.0, 1.52)
CASES = {"radius 1 µm, index 1.52": BALL, "radius 2.5 µm, index 1.59": LARGE, "two of 1 µm, 1.52, along z": STACK}


def contrast(image: np.ndarray) -> np.ndarray:
    """(f) root mean square of what differs from unhindered light."""
    return np.sqrt(np.mean((image - 1.0) ** 2, axis=(1, 2)))


def error(image: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """(f) root mean square difference over the root mean square contrast."""
    return np.sqrt(np.mean((image - exact) ** 2, axis=(1, 2))) / contrast(exact)


def grids(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Error over thickness of slices, and over the distance of points, of the method that is the default."""
    light, rows = illumination(MICROSCOPE, GRID.length), []
    for name, specimen in CASES.items():
        exact = images(
            scattered_spectra(specimen, MICROSCOPE, light, GRID, fourier), MICROSCOPE, light, GRID, fourier, FOCUS
        )
        found = []
        for thickness, cells in [*((h, GRID.cells) for h in SLICES), *((0.1, c) for c in CELLS)]:
            grid = dataclasses.replace(GRID, cells=cells)
            here = illumination(MICROSCOPE, grid.length)
            spectra = propagate(specimen, MICROSCOPE, here, grid, fourier, thickness=thickness)
            found.append(float(error(images(spectra, MICROSCOPE, here, grid, fourier, FOCUS), exact).mean()))
        rows.append((name, *(f"{e:.3f}" for e in found)))
        data[f"convergence, {name}"] = found
    head = ("specimen", *(f"dz {h:g}" for h in SLICES), *(f"dx {GRID.length / c:.2f}" for c in CELLS))
    note = (
        f"Two-index, condenser 0.5, {len(light.weights)} source points, mean of nine planes; µm; dx is "
        f"{GRID.spacing:g} where dz varies, dz is 0.1 where dx does."
    )
    return Table(title="Error over contrast against exact light: slices, and points", head=head, rows=rows, note=note)


def divided_after(specimen: Specimen, microscope: Microscope, fourier: Fourier, thickness: float) -> np.ndarray:
    """(1, n, n) spectrum of coherent light by two indices as published: a slice's light goes on, then it is divided.

    Brenner and Singer 1993, doi:10.1364/AO.32.004984; one index of solids.
    """
    slices, k = sliced(specimen, GRID, fourier, thickness), microscope.wavenumber
    ((index, filled),), (x, y) = slices.filled.items(), GRID.wavenumbers()
    outside, travels = axial_wavenumbers(k, GRID)
    inside = axial_wavenumbers(2.0 * np.pi / microscope.wavelength * index, GRID)[0]
    on, on_inside = (np.where(travels, np.exp(1j * q * slices.thickness), 0.0) for q in (outside, inside))
    corner = np.exp(1j * (x + y) * 0.5 * (GRID.spacing - GRID.length))  # from the middle of the grid to its first point
    low, high = slices.middle[0] - 0.5 * slices.thickness, slices.middle[-1] + 0.5 * slices.thickness
    light = np.zeros((GRID.cells, GRID.cells), dtype=complex)
    light[0, 0] = 1.0
    light *= np.exp(1j * outside * low) * corner
    (left, bottom), share = slices.corner, np.zeros(light.shape)
    for layer in fourier.numpy(filled):
        share[bottom : bottom + layer.shape[0], left : left + layer.shape[1]] = layer
        light = on * light + np.fft.fft2(share * np.fft.ifft2((on_inside - on) * light))
    return (light / corner * np.where(travels, np.exp(-1j * outside * high), 0.0))[None].astype(np.complex64)


def division(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Error of two indices where light is divided before it goes on, and after, as published forms do."""
    microscope, rows = dataclasses.replace(MICROSCOPE, condenser_aperture=0.0), []
    light = illumination(microscope, GRID.length)
    seen = lambda spectra: images(spectra, microscope, light, GRID, fourier, FOCUS)  # noqa: E731
    for name, specimen in CASES.items():
        exact, found = seen(scattered_spectra(specimen, microscope, light, GRID, fourier)), []
        for thickness in (0.1, 0.05):
            ours = propagate(specimen, microscope, light, GRID, fourier, thickness=thickness)
            theirs = fourier.array(divided_after(specimen, microscope, fourier, thickness))
            found += [float(error(seen(spectra), exact).mean()) for spectra in (ours, theirs)]
        rows.append((name, *(f"{e:.3f}" for e in found)))
        data[f"division, {name}"] = found
    head = ("specimen", "before, 0.1 µm", "after, 0.1 µm", "before, 0.05 µm", "after, 0.05 µm")
    return Table(title="Error over contrast of light divided before or after it goes on", head=head, rows=rows,
                 note="Two-index, coherent light, mean of nine planes.")  # fmt: skip


def every_direction(
    specimen: Specimen, grid: Grid, microscope: Microscope, planes: np.ndarray, fourier: Fourier
) -> np.ndarray:
    """(f, h, w) images of a specimen that turns into itself by 90°, in the light of every direction of the spectrum.

    Of directions that mirrors and turns make equal one is computed.
    """
    light = lattice(microscope, grid.length, 0.5 * grid.length)
    folded: dict[tuple[int, int], float] = {}
    for (x, y), weight in zip(np.abs(light.steps).tolist(), light.weights, strict=True):
        key = (max(x, y), min(x, y))
        folded[key] = folded.get(key, 0.0) + weight
    steps, weights = np.array(list(folded)), np.array(list(folded.values()))
    total = np.zeros((len(planes), grid.pixels, grid.pixels))
    for n in range(0, len(steps), 16):
        part = Illumination(steps[n : n + 16], weights[n : n + 16])
        spectra = propagate(specimen, microscope, part, grid, fourier, thickness=0.2)
        total += part.weights.sum() * images(spectra, microscope, part, grid, fourier, planes)
    seen = grid.image(total)[:, 1:, 1:]  # the middle of the specimen in that of the image
    seen = 0.5 * (seen + np.swapaxes(seen, 1, 2))
    return 0.25 * (seen + np.flip(seen, 1) + np.flip(seen, 2) + np.flip(seen, (1, 2)))


def sources(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Error of source points and margin, against every direction of a square that is far larger."""
    away, width = np.array([0.0, 2.0, 6.0, 10.0]), 96
    planes, rows = np.concatenate([-away[:0:-1], away]), []
    microscope = Microscope(numerical_aperture=1.2, condenser_aperture=0.5, wavelength=0.6, pixel=0.11)
    whole = grid_for(BALL, microscope, width, width, planes, Rendering(margin=16.0))
    reference = every_direction(BALL, whole, microscope, planes, fourier)
    asked: list[tuple[str, dict[str, Any]]] = [
        *((f"{n} rings, margin 3 µm", {"rings": n, "margin": 3.0}) for n in (2, 4, 5)),
        *((f"{n} rings, margin auto", {"rings": n}) for n in (4, 8, 12)),
        ("auto, as shipped", {}),
    ]
    for name, how in asked:
        exposed = expose(BALL, microscope, width, focus=planes, rendering=Rendering(**how), fourier=fourier)
        found = error(exposed.images(planes)[:, 1:, 1:], reference)
        by = [float(found[np.abs(planes) == z].max()) for z in away]
        rows.append((name, str(exposed.sources), f"{exposed.margin:.1f}", *(f"{e:.3f}" for e in by)))
        data[f"sources, {name}"] = by
    head = ("source points", "their number", "margin [µm]", *(f"±{z:g} µm" for z in away))
    note = (
        "Sphere of 1 µm, index 1.52, condenser 0.5, 0.6 µm; the worse of both planes; reference: every direction of a "
        "square of 43 µm."
    )
    return Table(
        title="Error over contrast of few source points and a small margin, by distance of the plane",
        head=head,
        rows=rows,
        note=note,
    )


def symmetry(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Mirrored specimens beside mirrored images; and whether the signs of tilt and depth are seen."""
    place = np.array([[0.9, 0.3, 0.7], [-0.8, -0.4, -0.6]])
    planes, rows = np.array([-6.0, -3.0, 0.0, 3.0, 6.0]), []

    def seen(turn: tuple[int, int, int], away: np.ndarray, aperture: float) -> np.ndarray:
        body = Specimen.of_spheres(place * turn, [0.8, 0.6], 1.52)
        microscope = dataclasses.replace(MICROSCOPE, condenser_aperture=aperture)
        exposed = expose(body, microscope, 102, focus=planes, fourier=fourier)
        return exposed.images(away)[:, 1:, 1:]  # the origin in the middle

    for aperture in (0.0, 0.3, 0.5):
        first = seen((1, 1, 1), planes, aperture)
        both = {
            "x mirrored": np.flip(seen((-1, 1, 1), planes, aperture), 2),
            "y mirrored": np.flip(seen((1, -1, 1), planes, aperture), 1),
            "tilt of the other sign": seen((1, 1, -1), planes, aperture),
            "depth of the other sign": seen((1, 1, 1), -planes, aperture)[planes != 0],
        }
        values = {n: error(i, first if len(i) == len(first) else first[planes != 0]).max() for n, i in both.items()}
        least = error(both["depth of the other sign"], first[planes != 0]).min()
        values["depth of the other sign"] = least
        values["tilt of the other sign"] = error(both["tilt of the other sign"], first).min()
        rows.append((f"condenser {aperture:g}", *(f"{v:.3g}" for v in values.values())))
        data[f"symmetry, condenser {aperture:g}"] = {n: float(v) for n, v in values.items()}
    head = ("light", "x mirrored, image turned back", "y mirrored", "tilt of the other sign", "depth of the other sign")
    note = (
        "Two spheres of 0.8 and 0.6 µm, 1.52, askew; difference of images over their contrast, five planes up to 6 µm "
        "away: the largest where both must agree, the least where the sign must be seen."
    )
    return Table(title="Mirrored specimens, and signs", head=head, rows=rows, note=note)


def energy(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Light that leaves a specimen upwards, over what came in: what is missing has been thrown back."""
    microscope = dataclasses.replace(MICROSCOPE, condenser_aperture=0.0, numerical_aperture=1.4, pixel=0.098)
    light, rows = illumination(microscope, GRID.length), []
    forward, _ = axial_wavenumbers(microscope.wavenumber, GRID)
    flux = lambda spectra: float(np.sum(np.abs(fourier.numpy(spectra)) ** 2 * forward) / microscope.wavenumber)  # noqa: E731
    for name, specimen in CASES.items():
        found = [flux(scattered_spectra(specimen, microscope, light, GRID, fourier))]
        found += [flux(propagate(specimen, microscope, light, GRID, fourier, thickness=h)) for h in (0.2, 0.1, 0.05)]
        found += [flux(propagate(specimen, microscope, light, GRID, fourier, method="beam", thickness=0.1))]
        rows.append((name, *(f"{v:.4f}" for v in found)))
        data[f"energy, {name}"] = found
    head = ("specimen", "exact", *(f"two-index, {h:g} µm" for h in (0.2, 0.1, 0.05)), "beam, 0.1 µm")
    note = "Coherent light through a square of 14 µm; all directions within the medium count."
    return Table(title="Light that goes on, over light that came", head=head, rows=rows, note=note)


TABLES = (grids, division, sources, symmetry, energy)
"""What each of them takes: where, and the numbers for a file."""
