"""`render`: a specimen in, images in focal planes out; every choice of method, spectrum and condenser in one place."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, grid_of
from otwarp.vision.illumination import Illumination, illumination, lattice
from otwarp.vision.image import images, images_many
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate, propagate_many
from otwarp.vision.sampling import distances, margin_needed, points_needed, reaches, rings_needed, usual_planes
from otwarp.vision.slices import METHODS
from otwarp.vision.specimen import Specimen

ALL_METHODS = (*METHODS, "mie")


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """How images are computed.

    Attributes:
        method: `two_index`, `beam`, `projection`, or `mie` for spheres, which is exact.
        thickness: Of slices, at most [µm].
        rings: Of source points over the condenser's opening; `auto`: points of a lattice, as many as the planes need.
        azimuth: By which rings are turned [rad].
        margin: Around the image [µm], so that light that leaves it does not come in on the other side; `auto`: as much
            as the planes need.
        spacing: Of points where light is computed, at most [µm]; None: 0.29 wavelengths.

    Raises:
        InputError: No such method, or a spacing that is not above 0.
    """

    method: str = "two_index"
    thickness: float = 0.2
    rings: int | Literal["auto"] = "auto"
    azimuth: float = 0.0
    margin: float | Literal["auto"] = "auto"
    spacing: float | None = None

    def __post_init__(self) -> None:
        if self.method not in ALL_METHODS:
            raise InputError(f"method is {self.method!r}; allowed: {', '.join(ALL_METHODS)}")
        for name in ("rings", "margin"):
            value = getattr(self, name)
            if isinstance(value, str) and value != "auto":
                raise InputError(f"{name} is {value!r}; allowed: auto, or a number")
        if self.spacing is not None and not self.spacing > 0.0:
            raise InputError(f"spacing is {self.spacing:g} µm; allowed: above 0")


@dataclass(frozen=True, eq=False)
class Exposed:
    """Light that has passed a specimen: focal planes, objectives and aberrations need nothing more.

    Attributes:
        outline: Solids that reach as far as those of the specimen, for which source points are chosen.
        parts: Per wavelength: microscope, illumination, spectra and share.
        grid: Of all of them.
        fourier: Where they are.
    """

    outline: Specimen
    parts: tuple[tuple[Microscope, Illumination, Any, float], ...]
    grid: Grid
    fourier: Fourier

    @property
    def sources(self) -> int:
        """Points of the condenser, those of all wavelengths."""
        return sum(len(light.weights) for _, light, _, _ in self.parts)

    @property
    def margin(self) -> float:
        """Around the image [µm]."""
        return 0.5 * self.grid.pixel * (self.grid.pixels - max(self.grid.width, self.grid.height))

    def images(
        self,
        focus: Sequence[float] | np.ndarray,
        *,
        objective: Microscope | Sequence[Microscope] | None = None,
        shift: Sequence[Sequence[float]] | np.ndarray | None = None,
    ) -> np.ndarray:
        """(f, height, width) intensities in focal planes [µm], 1 where light is unhindered; row 0 is the lowest.

        Of the source points of a lattice, planes near the specimen are looked at with as few as they need.

        Args:
            focus: (f) heights of the planes.
            objective: Another microscope to look through, of the same light, condenser, medium and pixel, with its own
                contrast; or one for each plane.
            shift: (f, 2) by which the specimen is seen moved in each plane (x, y) [µm], within the margin.

        Raises:
            InputError: It differs in more.
        """
        planes = np.asarray(focus, dtype=float)
        moved = None if shift is None else np.asarray(shift, dtype=float).reshape(len(planes), 2)
        total = np.zeros((len(planes), self.grid.height, self.grid.width))
        for microscope, light, spectra, share in self.parts:
            if objective is None or isinstance(objective, Microscope):
                through = [microscope if objective is None else _other(microscope, objective)] * len(planes)
            else:
                through = [_other(microscope, one) for one in objective]
            lights = [light.enough(r) for r in reaches(microscope, self.outline, planes)]
            for count in dict.fromkeys(len(one.weights) for one in lights):
                some = [n for n, one in enumerate(lights) if len(one.weights) == count]
                seen = images(
                    spectra[..., :count, :, :], [through[n] for n in some], lights[some[0]], self.grid, self.fourier,
                    planes[some], None if moved is None else moved[some],
                )  # fmt: skip
                total[some] += share * self.grid.image(seen)
        return total

    def error(self, focus: Sequence[float] | np.ndarray) -> np.ndarray | None:
        """(f) what too few source points may have cost: root mean square over that of the contrast, in each plane.

        Every second point of a lattice gives an image whose own error is at least twice that of all of them
        (`python -m benchmarks.vision`): half the difference of both is a bound. None for rings, or one point.
        """
        found = np.zeros(len(focus))
        for n, plane in enumerate(np.asarray(focus, dtype=float)):
            away, contrast = np.zeros(2)
            for microscope, light, spectra, share in self.parts:
                enough = light.enough(float(reaches(microscope, self.outline, [plane])[0]))
                fewer = enough.halved()
                if fewer is None:
                    return None
                both = [self.grid.image(images(spectra[..., : len(one.weights), :, :], microscope, one, self.grid,
                                               self.fourier, [plane])) for one in (enough, fewer)]  # fmt: skip
                away += share * float(np.mean((both[1] - both[0]) ** 2))
                contrast += share * float(np.mean((both[0] - 1.0) ** 2))
            found[n] = 0.5 * (away / contrast) ** 0.5 if contrast > 0.0 else 0.0
        return found


def expose(
    specimen: Specimen,
    microscope: Microscope,
    width: int,
    height: int | None = None,
    *,
    focus: Sequence[float] | np.ndarray | None = None,
    outline: Specimen | None = None,
    rendering: Rendering | None = None,
    fourier: Fourier | None = None,
) -> Exposed:
    """Lead light through a specimen.

    Args:
        specimen: With the optical axis at x = y = 0, which is the middle of the image.
        microscope: All of it.
        width, height: Of the image, in pixels; a square where only one is given.
        focus: Heights of focal planes that will be looked at, or the ends between which they lie [µm], for which source
            points and margin are chosen; None: from 3 µm below the specimen to 3 µm above it.
        outline: Other solids, for which these are chosen instead, so that they are the same for several specimens.
        rendering: How.
        fourier: On what; None: a GPU if there is one.

    Raises:
        InputError: A specimen that does not fit the image and its margin, or that the method cannot take.
    """
    how, where = rendering or Rendering(), fourier or Fourier()
    around = specimen if outline is None else outline
    planes = usual_planes(around) if focus is None else np.asarray(focus, dtype=float)
    high = width if height is None else height
    grid = grid_for(around, microscope, width, high, planes, how)
    parts = []
    for wavelength, share in microscope.lines():
        one = microscope if microscope.bandwidth <= 0.0 else microscope.at(wavelength)
        light = light_for(around, one, grid, planes, how, where)
        if how.method == "mie":
            if one.illumination_curvature:
                raise InputError("illumination_curvature is of waves that are not plane; allowed for mie: 0")
            spectra = scattered_spectra(specimen, one, light, grid, where)
        else:
            spectra = propagate(specimen, one, light, grid, where, method=how.method, thickness=how.thickness)  # type: ignore[arg-type]
        parts.append((one, light, spectra, share))
    return Exposed(around, tuple(parts), grid, where)


def grid_for(
    specimen: Specimen, microscope: Microscope, width: int, height: int, planes: np.ndarray, how: Rendering
) -> Grid:
    """The grid on which `expose` computes light for planes at these heights [µm]."""
    margin = how.margin
    if margin == "auto":
        margin = margin_needed(microscope, specimen, width, height, planes, lattice=how.rings == "auto")
    return grid_of(microscope, width, height, margin=margin, spacing=how.spacing)


def light_for(
    specimen: Specimen, microscope: Microscope, grid: Grid, planes: np.ndarray, how: Rendering, fourier: Fourier
) -> Illumination:
    """The source points with which `expose` lights a specimen for planes at these heights [µm].

    Raises:
        InputError: More than the memory holds waves of.
    """
    if how.rings != "auto":
        return illumination(microscope, grid.length, rings=how.rings, azimuth=how.azimuth)
    reach = float(reaches(microscope, specimen, planes).max(initial=0.0))
    # far planes need more points than can be made, let alone led through a specimen
    fourier.check_room(points_needed(microscope, grid.length, reach), grid.cells, grid.cells)
    return lattice(microscope, grid.length, reach)


def warn_if_few(
    specimen: Specimen, microscope: Microscope, width: int, height: int, focus: Sequence[float] | np.ndarray,
    how: Rendering,
) -> None:  # fmt: skip
    """Say in a line how many rings, or which margin, would do, where a number was asked for that does not.

    Args:
        specimen, microscope, width, height, how: As of `expose`.
        focus: (f) heights of the planes [µm].

    Warns:
        PlausibilityWarning: There are too few.
    """
    reach = float(reaches(microscope, specimen, focus).max(initial=0.0))
    needed = rings_needed(microscope, reach)
    where = f"for planes up to {float(distances(specimen, focus).max(initial=0.0)):.3g} µm from a solid"
    if how.rings != "auto" and microscope.condenser_aperture > 0.0 and how.rings < needed:
        warnings.warn(f"rings is {how.rings}, too few source points {where}: {needed}, or auto, would do",
                      PlausibilityWarning, stacklevel=3)  # fmt: skip
    margin = margin_needed(microscope, specimen, width, height, focus, lattice=False)
    if how.margin != "auto" and how.margin < margin - 0.05:
        warnings.warn(f"margin is {how.margin:g} µm, too small {where}: {margin:.1f} µm, or auto, would do",
                      PlausibilityWarning, stacklevel=3)  # fmt: skip


def render(
    specimen: Specimen,
    microscope: Microscope,
    width: int,
    height: int | None = None,
    *,
    focus: Sequence[float] | np.ndarray = (0.0,),
    rendering: Rendering | None = None,
    fourier: Fourier | None = None,
) -> np.ndarray:
    """(f, height, width) images of a specimen in focal planes: `expose`, and look.

    Args:
        specimen: With the optical axis at x = y = 0, which is the middle of the image.
        microscope: All of it.
        width, height: Of the image, in pixels; a square where only one is given.
        focus: (f) heights of the planes [µm].
        rendering: How; None: as `Rendering` has it.
        fourier: On what; None: a GPU if there is one.

    Raises:
        InputError: As `expose`.

    Warns:
        PlausibilityWarning: Rings or a margin that are too few for these planes.
    """
    how = rendering or Rendering()
    warn_if_few(specimen, microscope, width, width if height is None else height, focus, how)
    exposed = expose(specimen, microscope, width, height, focus=focus, rendering=how, fourier=fourier)
    return exposed.images(focus)


MANY_BYTES = 2**31
"""Of the spectra of many specimens that a GPU keeps at once."""


def render_many(
    specimens: Sequence[Specimen],
    microscope: Microscope,
    width: int,
    height: int | None = None,
    *,
    focus: Sequence[float] | np.ndarray = (0.0,),
    rendering: Rendering | None = None,
    fourier: Fourier | None = None,
) -> np.ndarray:
    """(p, f, height, width) images of many specimens, of each those of `render`, to rounding; without its warning.

    On a GPU those that need the same grid and source points are computed together, which one alone does not fill.

    Args:
        specimens: (p) of them, or one body in so many poses, with the optical axis at x = y = 0.
        microscope, width, height, focus, rendering, fourier: As of `render`.

    Raises:
        InputError: As `expose`.
    """
    how, where, planes = rendering or Rendering(), fourier or Fourier(), np.asarray(focus, dtype=float)
    high = width if height is None else height
    out = np.zeros((len(specimens), len(planes), high, width))
    if where.device.is_cpu or how.method == "mie":
        for n, specimen in enumerate(specimens):
            exposed = expose(specimen, microscope, width, high, focus=planes, rendering=how, fourier=where)
            out[n] = exposed.images(planes)
        return out
    _render_together(specimens, microscope, planes, how, where, out)
    return out


def _render_together(
    specimens: Sequence[Specimen],
    microscope: Microscope,
    planes: np.ndarray,
    how: Rendering,
    where: Fourier,
    out: np.ndarray,
) -> None:
    """Add images (p, f, height, width) of specimens, those together that need the same grid and source points."""
    high, width = out.shape[2:]
    alike: dict[Any, list[int]] = {}
    lit: dict[Any, list[tuple[Microscope, Illumination, float, list[Illumination]]]] = {}
    for n, specimen in enumerate(specimens):
        grid = grid_for(specimen, microscope, width, high, planes, how)
        parts = []
        for wavelength, share in microscope.lines():
            one = microscope if microscope.bandwidth <= 0.0 else microscope.at(wavelength)
            light = light_for(specimen, one, grid, planes, how, where)
            parts.append((one, light, share, [light.enough(r) for r in reaches(one, specimen, planes)]))
        key = (grid, *((p[1].steps.tobytes(), *(len(e.weights) for e in p[3])) for p in parts))
        alike.setdefault(key, []).append(n)
        lit[key] = parts
    for key, group in alike.items():
        for one, light, share, enough in lit[key]:
            count = max(1, MANY_BYTES // (8 * len(light.weights) * key[0].cells ** 2))
            for start in range(0, len(group), count):
                some = group[start : start + count]
                spectra = propagate_many([specimens[n] for n in some], one, light, key[0], where,
                                         method=how.method, thickness=how.thickness)  # type: ignore[arg-type]  # fmt: skip
                for points in dict.fromkeys(len(e.weights) for e in enough):
                    at = [f for f, e in enumerate(enough) if len(e.weights) == points]
                    seen = images_many(spectra[:, :points], one, enough[at[0]], key[0], where, planes[at])
                    out[np.ix_(some, at)] += share * key[0].image(seen)


def _other(microscope: Microscope, objective: Microscope) -> Microscope:
    """The objective of one microscope over the light of another."""
    own = ("numerical_aperture", "immersion_index", "depth", "contrast", "ring_transmission", "shear", "shear_angle")
    given = {name: getattr(objective, name) for name in own}
    return dataclasses.replace(microscope, **given, **objective.paths(microscope.wavelength))
