"""Images of spheres by every rung of the ladder: how far from exact, and how long they take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import vision_limits
from benchmarks.peers import deeptrack_sphere
from benchmarks.report import Section, command
from benchmarks.vision_speed import FOCUS, RUNGS, label, sizes, times
from otwarp.bench.machine import Machine
from otwarp.bench.report import NOTHING, Table
from otwarp.device import pick_device
from otwarp.files import written
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination, illumination
from otwarp.vision.image import images, images_many
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate, propagate_many
from otwarp.vision.specimen import Specimen

GRID = Grid(128, 128, 128, 128, 0.11)
"""Light and pixels on one grid, so that every method is looked at in the same points."""

SPHERES = ((0.5, 1.38), (0.5, 1.59), (1.0, 1.38), (1.0, 1.52), (1.0, 1.59), (2.5, 1.38), (2.5, 1.59))
LEAN = np.radians(30.0)
PAIRS = {
    "along z": (0.0, 0.0, 1.0),
    "22.5° from z": (np.sin(np.pi / 8), 0.0, np.cos(np.pi / 8)),
    "tilted by 45°": (0.5**0.5, 0.0, 0.5**0.5),
    "45°, azimuth 30°": (0.5**0.5 * np.cos(LEAN), 0.5**0.5 * np.sin(LEAN), 0.5**0.5),
    "67.5° from z": (np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8)),
    "side by side": (1.0, 0.0, 0.0),
}
APERTURES = (0.0, 0.3, 0.5)


def compared(
    specimen: Specimen, microscope: Microscope, light: Illumination, fourier: Fourier
) -> dict[Any, np.ndarray]:
    """Per rung, (2, f): error over contrast, root mean square, and correlation with the exact image, in each plane."""
    seen = lambda spectra: images(spectra, microscope, light, GRID, fourier, FOCUS)  # noqa: E731
    exact = seen(scattered_spectra(specimen, microscope, light, GRID, fourier))
    found = {}
    for method, thickness in RUNGS:
        spectra = propagate(specimen, microscope, light, GRID, fourier, method=method, thickness=thickness)
        image = seen(spectra)
        alike = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in zip(image, exact, strict=True)]
        found[method, thickness] = np.array([vision_limits.error(image, exact), alike])
    return found


def cases() -> dict[str, Specimen]:
    """Spheres, and pairs of touching ones."""
    found = {f"radius {r} µm, index {n}": Specimen.of_spheres([[0, 0, 0]], r, n) for r, n in SPHERES}
    pairs = {f"two of 1 µm, 1.52, {name}": np.outer((-1, 1), d) for name, d in PAIRS.items()}
    return found | {name: Specimen.of_spheres(places, 1.0, 1.52) for name, places in pairs.items()}


def accuracy(aperture: float, fourier: Fourier, data: dict[str, Any]) -> list[Table]:
    """Errors and correlations of all rungs for spheres and pairs of spheres, in the light of one condenser."""
    microscope = Microscope(condenser_aperture=aperture, pixel=GRID.pixel)
    light = illumination(microscope, GRID.length)
    off, alike = [], []
    for name, specimen in cases().items():
        found = compared(specimen, microscope, light, fourier)
        off.append((name, *(f"{e.mean():.3f} ({e.max():.2f})" for e, _ in found.values())))
        alike.append((name, *(f"{r.mean():.3f} ({r.min():.2f})" for _, r in found.values())))
        data["errors"][f"{name}, condenser {aperture}"] = {f"{m} {t}": e.tolist() for (m, t), (e, _) in found.items()}
        data["correlation"][f"{name}, condenser {aperture}"] = {
            f"{m} {t}": r.tolist() for (m, t), (_, r) in found.items()
        }
    head = ("specimen", *map(label, RUNGS))
    what = "coherent light" if aperture == 0.0 else f"condenser {aperture}, {len(light.weights)} source points"
    note = "Medium 1.33, 0.55 µm, NA 1.2, −6 to 6 µm."
    return [
        Table(
            title=f"Error over contrast, mean and (largest) of nine focal planes; {what}",
            head=head,
            rows=off,
            note=note,
        ),
        Table(title=f"Correlation with the exact image, mean and (least); {what}", head=head, rows=alike, note=note),
    ]


def measure(
    device: str = "cpu",
    *,
    apertures: Sequence[float] = APERTURES,
    rounds: int = 5,
    figure: Path | None = None,
) -> Section:
    """Errors of all rungs for spheres and pairs of spheres; what they converge to; time of a pose and of an image."""
    place, fourier = pick_device(device), Fourier(device)
    data: dict[str, Any] = {"errors": {}, "correlation": {}, "seconds": {}}
    if place.is_cpu:
        tables = [table for aperture in apertures for table in accuracy(aperture, fourier, data)]
        tables += [table(fourier, data) for table in vision_limits.TABLES]
        tables += [times(fourier, rounds, data), sizes(fourier, rounds, data), beside_deeptrack(fourier, rounds, data)]
    else:  # the same physics: what is to be shown is that it is
        tables = [away_from_cpu(fourier, data), times(fourier, rounds, data), sizes(fourier, rounds, data)]
        tables.append(beside_deeptrack(fourier, rounds, data))
    if figure is not None:
        draw(figure, apertures, data)
    kind = "cpu" if place.is_cpu else "cuda"
    asked = "" if tuple(apertures) == APERTURES else f"--apertures {' '.join(f'{a:g}' for a in apertures)}"
    return Section(name="vision", kind=kind, machine=Machine.look(place), tables=tables, data=data, asked=asked)


def away_from_cpu(fourier: Fourier, data: dict[str, Any]) -> Table:
    """Images of specimens that go through a GPU together, beside those of a CPU, one after the other."""
    host, solids, rows = Fourier("cpu"), list(cases().values()), []
    microscope = Microscope(condenser_aperture=0.4)
    light = illumination(microscope, GRID.length)
    for method, thickness in RUNGS:
        how: dict[str, Any] = {"method": method, "thickness": thickness}
        spectra = propagate_many(solids, microscope, light, GRID, fourier, **how)
        found = images_many(spectra, microscope, light, GRID, fourier, FOCUS)
        alone = [images(propagate(s, microscope, light, GRID, host, **how), microscope, light, GRID, host, FOCUS)
                 for s in solids]  # fmt: skip
        contrast = np.sqrt(np.mean((np.array(alone) - 1.0) ** 2, axis=(2, 3)))
        off = np.sqrt(np.mean((found - np.array(alone)) ** 2, axis=(2, 3))) / contrast
        rows.append((label((method, thickness)), f"{off.mean():.1e}", f"{off.max():.1e}"))
        data[f"away from a CPU, {method} {thickness}"] = {"mean": float(off.mean()), "largest": float(off.max())}
    return Table(title="Images of a GPU beside those of a CPU: difference over contrast",
                 head=("method", "mean", "largest"), rows=rows,
                 note=f"{len(solids)} spheres and pairs, nine planes, condenser 0.4, 61 source points.")  # fmt: skip


def beside_deeptrack(fourier: Fourier, rounds: int, data: dict[str, Any]) -> Table:
    """One image after the other of a sphere whose pose is another each time: light led through anew, and looked at."""
    radius, index, cpu = 1.0, 1.52, fourier.device.is_cpu
    clock = time.process_time if cpu else time.perf_counter
    head = ("code", "light", "images/s", "over DeepTrack2", "error, mean and (largest)")
    title = "An image of a sphere of 1 µm in a pose of its own, 128 × 128 points of 0.11 µm"
    if (why := deeptrack_sphere.missing()) is not None:
        return Table(title=title, head=head, rows=[(why, *4 * (NOTHING,))])
    specimen = Specimen.of_spheres([[0, 0, 0]], radius, index)
    of = {"medium": 1.33, "aperture": 1.2, "wavelength": 0.55, "pixel": GRID.pixel, "count": 128}
    if cpu:
        peer, why = deeptrack_sphere.Peer(radius, index, **of), None
    else:
        peer, why = deeptrack_sphere.on(str(fourier.device), radius, index, **of)
    code = deeptrack_sphere.name() + (" on the host" if why else "")
    found = {}
    for aperture in (0.0, 0.4):
        microscope = Microscope(condenser_aperture=aperture, pixel=GRID.pixel)
        light = illumination(microscope, GRID.length)
        look = lambda spectra, planes, m=microscope, li=light: images(spectra, m, li, GRID, fourier, planes)  # noqa: E731
        exact = look(scattered_spectra(specimen, microscope, light, GRID, fourier), FOCUS)
        shipped = lambda planes, m=microscope, li=light, see=look: see(  # noqa: E731
            propagate(specimen, m, li, GRID, fourier, thickness=0.2), planes
        )
        name = "along the axis" if aperture == 0.0 else f"condenser {aperture}, {len(light.weights)} directions"
        found["otwarp, slices of 0.2 µm", name] = shipped, vision_limits.error(shipped(FOCUS), exact)
        if aperture == 0.0:
            # DeepTrack's pixels are points: the mean over a pixel is taken out of the exact image
            blur = np.sinc(np.fft.fftfreq(128))[:, None] * np.sinc(np.fft.rfftfreq(128))[None, :]
            points = np.fft.irfft2(np.fft.rfft2(exact) / blur, s=(128, 128))
            theirs = lambda planes: np.stack([peer.image(z) for z in planes])  # noqa: E731
            found[code, name] = theirs, vision_limits.error(theirs(FOCUS), points)
    speed = {}
    for key, (run, _) in found.items():
        spent = []
        for _ in range(rounds + 1):
            begun = clock()
            run(FOCUS[3:4])
            spent.append(clock() - begun)
        speed[key] = 1.0 / min(spent[1:])
    reference = next(v for (whose, _), v in speed.items() if whose == code)
    rows = [(whose, light, f"{speed[whose, light]:.3g}", f"{speed[whose, light] / reference:.2g}",
             f"{off.mean():.2f} ({off.max():.2f})") for (whose, light), (_, off) in found.items()]  # fmt: skip
    data["deeptrack"] = {f"{c}, {name}": [speed[c, name], off.tolist()] for (c, name), (_, off) in found.items()}
    note = (
        ("Processor time of one core. " if cpu else "Wall time, images on the host, one after the other. ")
        + "DeepTrack2's bright field is a beam of one index in light along the axis, its "
        "sphere of whole voxels, its image in points: so it is compared. That ours looks in further planes for a tenth "
        "of the time of a pose is not used here."
        + (f" With torch on the GPU it ends in “{why}”, so it is NumPy's." if why else "")
    )
    return Table(title=title, head=head, rows=rows, note=note)


COLORS = {"two_index": "#1f77b4", "beam": "#ff7f0e", "projection": "#7f7f7f"}


def draw(file: Path, apertures: Sequence[float], data: dict[str, Any]) -> None:
    """Error against time of a pose: mean over all specimens, from the best of them to the worst (PNG)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.4 * len(apertures), 3.6), layout="constrained")
    axes = figure.subplots(1, len(apertures), sharey=True, squeeze=False)[0]
    for ax, aperture in zip(axes, apertures, strict=True):
        here = [v for name, v in data["errors"].items() if name.endswith(f", condenser {aperture}")]
        for method, thickness in RUNGS:
            means = np.array([np.mean(v[f"{method} {thickness}"]) for v in here])
            x = 1e3 * data["seconds"][f"{method} {thickness}"]["pose"]
            ax.plot([x, x], [means.min(), means.max()], color=COLORS[method], linewidth=1.5, alpha=0.5)
            ax.plot(x, means.mean(), "o", color=COLORS[method])
            ax.annotate(
                f"{thickness:g}", (x, means.min()), (0, -9), textcoords="offset points", fontsize=7, ha="center"
            )
        x = 1e3 * data["seconds"]["mie"]["pose"]
        ax.axvline(x, color="black", linestyle=":", linewidth=1.0)
        ax.text(x, 0.012, "exact, three spheres ", fontsize=7, rotation=90, ha="right", va="bottom")
        ax.set(xscale="log", yscale="log", xlabel="time of a pose of 61 directions [ms]")
        ax.set_title("coherent light" if aperture == 0.0 else f"condenser {aperture:g}", fontsize=10)
        ax.set_xlim(left=4.0)
        ax.grid(alpha=0.3)
    for method, color in COLORS.items():
        axes[0].plot([], [], "o", color=color, label=method.replace("_", "-"))
    axes[0].legend(fontsize=8, loc="upper right", title="slices in µm", title_fontsize=8)
    axes[0].set_ylabel("error over contrast")
    with written(file, f"--figure {file}") as part:
        figure.savefig(part, dpi=130, format="png")


if __name__ == "__main__":
    command(
        measure,
        "Errors and speed of the microscope's images.",
        rounds=5,
        figure={"type": Path, "default": None, "help": "gets error against time of all methods (PNG)"},
        apertures={"type": float, "nargs": "+", "default": APERTURES, "help": "numerical apertures of the condenser"},
    )
