"""Axial and radial force curves of a trap by every model, and their picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.optics.analysis import TrapProperties
from otwarp.optics.beam import Beam
from otwarp.optics.fit import trap_region, weak_side
from otwarp.optics.mie import Particle
from otwarp.optics.models import MODELS, Ladder
from otwarp.optics.table import layer_count

PICTURES = ("png", "pdf", "svg")
"""Formats of pictures, by the end of the file's name."""

DRAWN = {
    "harmonic": ("#009e73", "-", 1.2),
    "piecewise-isotropic": ("#e69f00", "-", 1.5),
    "piecewise": ("#d55e00", "-", 1.5),
    "table": ("#0072b2", (0, (4, 3)), 1.3),
}
"""Colour (Okabe and Ito's, which the colour-blind tell apart), dashes and width of every model, from beneath upward."""

EXACT = {"x": "#c3ccda", "y": "#e4d5c3", "axial": "#c3ccda"}
"""Colours of the exact curves, wide and pale beneath the models."""

INK, FAINT = "#20304a", "#c8ced8"


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Force along the axis and across it by all models, at the beam's power.

    Attributes:
        beam, sphere: What was evaluated.
        properties: Equilibrium, stiffness, escape force, depth.
        peak: Peak force anywhere [pN].
        weak_side: `downstream` or `upstream`: where the axial piecewise law was fitted.
        distance: (n,) from the equilibrium, over the trap region on both sides [µm].
        force: By model and direction (`axial`, `x`, `y`): (n,) component along that direction [pN].
    """

    beam: Beam
    sphere: Particle
    properties: TrapProperties
    peak: float
    weak_side: str
    distance: np.ndarray
    force: dict[str, dict[str, np.ndarray]]

    def residual(self, model: str, direction: str) -> np.ndarray:
        """(n,) force of a model less the exact one [pN] at `distance`, along a direction of `force`."""
        return self.force[model][direction] - self.force["exact"][direction]

    def rmse(self, model: str, directions: tuple[str, ...]) -> float:
        """Root of the mean squared residual over these directions, in Q."""
        residuals = np.concatenate([self.residual(model, d) for d in directions])
        return float(np.sqrt(np.mean(residuals**2))) / self.beam.force_scale


def force_curves(ladder: Ladder, *, samples: int = 241) -> Curves:
    """Evaluate the exact force and every model of the ladder along z, x and y through the equilibrium.

    Raises:
        InputError: The beam does not hold this sphere.
    """
    properties = ladder.properties
    d = np.linspace(-1.0, 1.0, samples) * trap_region(ladder.beam, ladder.sphere)
    ways = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "axial": np.array([0.0, 0.0, 1.0])}
    centre = np.array([0.0, 0.0, properties.equilibrium])
    points = np.concatenate([centre + d[:, None] * way for way in ways.values()])
    scale = ladder.beam.force_scale
    found = {}
    for model in MODELS:
        q = np.split(ladder.force(model)(points), len(ways))
        found[model] = {name: scale * f @ way for f, (name, way) in zip(q, ways.items(), strict=True)}
    return Curves(
        beam=ladder.beam,
        sphere=ladder.sphere,
        properties=properties,
        peak=scale * ladder.table.peak,
        weak_side=weak_side(ladder.curves),
        distance=d,
        force=found,
    )


def plot_curves(curves: Curves, path: Path) -> None:
    """Draw all models over the exact curves, axial and radial, with the size of their residuals beneath.

    Raises:
        InputError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    c = curves
    figure = Figure(figsize=(10.4, 5.8), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=[2.6, 1.0])
    across = ("x",) if layer_count(c.beam) == 1 else ("x", "y")
    for column, directions in enumerate((("axial",), across)):
        _draw_force(axes[0, column], c, directions)
        _draw_residual(axes[1, column], c, directions)
    axes[0, 0].plot(0.0, 0.0, "o", color=INK, ms=4.5, zorder=9)
    lost = f"equilibrium at z = {c.properties.equilibrium:.3f} µm, laws fitted {c.weak_side}"
    axes[0, 0].set_title(f"axial: {lost}", fontsize=10, color=INK)
    axes[0, 1].set_title("radial: through the equilibrium", fontsize=10, color=INK)
    axes[0, 0].set_ylabel("force (pN)")
    axes[1, 0].set_ylabel("|residual| / peak")
    axes[1, 0].set_xlabel("z from the equilibrium, downstream positive (µm)")
    axes[1, 1].set_xlabel("distance from the equilibrium (µm)")
    figure.suptitle(setup_line(c.beam, c.sphere), fontsize=10.5, color=INK)
    save_picture(figure, path)


def _draw_force(axes: Any, c: Curves, directions: tuple[str, ...]) -> None:
    for direction in directions:
        label = "exact" if len(directions) == 1 else f"exact along {direction}"
        axes.plot(c.distance, c.force["exact"][direction], color=EXACT[direction], lw=6.5, label=label, zorder=2)
    for order, (model, (colour, dashes, width)) in enumerate(DRAWN.items(), 3):
        for direction in directions[: 2 if model == "table" else 1]:
            label = f"{model}  {c.rmse(model, directions):.2g}" if direction == directions[0] else None
            axes.plot(
                c.distance, c.force[model][direction], color=colour, ls=dashes, lw=width, label=label, zorder=order
            )
    axes.axhline(0.0, color=FAINT, lw=0.8, zorder=0)
    shown = [c.force["exact"][d] for d in ("axial", "x", "y")]
    axes.set_ylim(1.2 * min(f.min() for f in shown), 1.2 * max(f.max() for f in shown))
    axes.legend(
        frameon=False, fontsize=8.5, loc="upper right", title="model, RMSE in Q", title_fontsize=8.5, alignment="left"
    )
    _plain(axes)


def _draw_residual(axes: Any, c: Curves, directions: tuple[str, ...]) -> None:
    """On a logarithmic scale, where every model of the ladder can be seen; the worst direction where there are two."""
    for order, (model, (colour, _, width)) in enumerate(DRAWN.items(), 3):
        gap = np.max([np.abs(c.residual(model, d)) for d in directions], axis=0) / c.peak
        axes.plot(c.distance, np.maximum(gap, 1e-9), color=colour, lw=0.8 * width, zorder=order)
    axes.set_yscale("log")
    axes.set_ylim(1e-6, 3.0)
    axes.set_xlim(c.distance[0], c.distance[-1])
    axes.set_yticks([1e-6, 1e-4, 1e-2, 1.0])
    axes.grid(axis="y", color="#e9ecf1", lw=0.8)
    axes.set_axisbelow(True)
    _plain(axes)


def _plain(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9)


def setup_line(beam: Beam, sphere: Particle) -> str:
    """What a picture shows, in one line."""
    index = complex(sphere.index)
    n = f"{index.real:g}" if index.imag == 0.0 else f"{index.real:g} + {index.imag:g}i"
    light = beam.polarization if isinstance(beam.polarization, str) else "elliptical"
    vortex = f", vortex ℓ = {beam.charge}" if beam.charge else ""
    return (
        f"sphere r = {sphere.radius:g} µm, n = {n} in {beam.medium_index:g}    "
        f"{beam.kind} beam, {beam.wavelength:g} µm, NA {beam.numerical_aperture:g}, {light} polarization{vortex}, "
        f"{beam.power:g} mW"
    )


def picture_format(path: Path) -> str:
    """Format of a picture by the end of its name.

    Raises:
        InputError: Another ending than `PICTURES`.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        raise InputError(f"picture {path} ends in {path.suffix or 'nothing'!r}; allowed: .{', .'.join(PICTURES)}")
    return kind


def save_picture(figure: Any, path: Path) -> None:
    """Write a figure to a temporary file that then takes the name.

    Raises:
        InputError: The file cannot be written, or its name ends in none of `PICTURES`.
    """
    kind = picture_format(path)
    with written(path, f"picture {path}") as part:
        figure.savefig(part, dpi=160, format=kind)
