"""`render`: a specimen in, images in focal planes out; every choice of method, spectrum and condenser in one place."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, grid_of
from otwarp.vision.illumination import Illumination, illumination
from otwarp.vision.image import images
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import METHODS, propagate
from otwarp.vision.specimen import Specimen

ALL_METHODS = (*METHODS, "mie")


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """How images are computed.

    Attributes:
        method: `two_index`, `beam`, `projection`, or `mie` for spheres, which is exact.
        thickness: Of slices, at most [µm].
        rings: Of source points over the condenser's opening.
        azimuth: By which these are turned [rad].
        margin: Around the image [µm], so that light that leaves it does not come in on the other side.
        spacing: Of points where light is computed, at most [µm]; None: 0.29 wavelengths.

    Raises:
        InputError: No such method.
    """

    method: str = "two_index"
    thickness: float = 0.1
    rings: int = 4
    azimuth: float = 0.0
    margin: float = 3.0
    spacing: float | None = None

    def __post_init__(self) -> None:
        if self.method not in ALL_METHODS:
            raise InputError(f"method is {self.method!r}; allowed: {', '.join(ALL_METHODS)}")


@dataclass(frozen=True, eq=False)
class Exposed:
    """Light that has passed a specimen: focal planes, objectives and aberrations need nothing more.

    Attributes:
        parts: Per wavelength: microscope, illumination, spectra and share.
        grid: Of all of them.
        fourier: Where they are.
    """

    parts: tuple[tuple[Microscope, Illumination, Any, float], ...]
    grid: Grid
    fourier: Fourier

    def images(
        self,
        focus: Sequence[float] | np.ndarray,
        *,
        objective: Microscope | Sequence[Microscope] | None = None,
        shift: Sequence[Sequence[float]] | np.ndarray | None = None,
    ) -> np.ndarray:
        """(f, height, width) intensities in focal planes [µm], 1 where light is unhindered; row 0 is the lowest.

        Args:
            focus: (f) heights of the planes.
            objective: Another microscope to look through, of the same light, condenser, medium and pixel, with its own
                contrast; or one for each plane.
            shift: (f, 2) by which the specimen is seen moved in each plane (x, y) [µm], within the margin.

        Raises:
            InputError: It differs in more.
        """
        total, moved = 0.0, None if shift is None else np.asarray(shift, dtype=float).reshape(len(focus), 2)
        for microscope, light, spectra, share in self.parts:
            if objective is None or isinstance(objective, Microscope):
                through = microscope if objective is None else _other(microscope, objective)
            else:
                through = [_other(microscope, one) for one in objective]
            total = total + share * images(spectra, through, light, self.grid, self.fourier, focus, moved)
        return self.grid.image(np.asarray(total))


def expose(
    specimen: Specimen,
    microscope: Microscope,
    width: int,
    height: int | None = None,
    *,
    rendering: Rendering | None = None,
    fourier: Fourier | None = None,
) -> Exposed:
    """Lead light through a specimen.

    Args:
        specimen: With the optical axis at x = y = 0, which is the middle of the image.
        microscope: All of it.
        width, height: Of the image, in pixels; a square where only one is given.
        rendering: How.
        fourier: On what; None: a GPU if there is one.

    Raises:
        InputError: A specimen that does not fit the image and its margin, or that the method cannot take.
    """
    how, where = rendering or Rendering(), fourier or Fourier()
    grid = grid_of(microscope, width, height, margin=how.margin, spacing=how.spacing)
    parts = []
    for wavelength, share in microscope.lines():
        one = microscope if microscope.bandwidth <= 0.0 else microscope.at(wavelength)
        light = illumination(one, grid.length, rings=how.rings, azimuth=how.azimuth)
        if how.method == "mie":
            if one.illumination_curvature:
                raise InputError("illumination_curvature is of waves that are not plane; allowed for mie: 0")
            spectra = scattered_spectra(specimen, one, light, grid, where)
        else:
            spectra = propagate(specimen, one, light, grid, where, method=how.method, thickness=how.thickness)  # type: ignore[arg-type]
        parts.append((one, light, spectra, share))
    return Exposed(tuple(parts), grid, where)


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
    """(f, height, width) images of a specimen in focal planes [µm]: `expose`, and look."""
    return expose(specimen, microscope, width, height, rendering=rendering, fourier=fourier).images(focus)


def _other(microscope: Microscope, objective: Microscope) -> Microscope:
    """The objective of one microscope over the light of another."""
    own = ("numerical_aperture", "immersion_index", "depth", "contrast", "ring_transmission", "shear", "shear_angle")
    given = {name: getattr(objective, name) for name in own}
    return dataclasses.replace(microscope, **given, **objective.paths(microscope.wavelength))
