"""What forms an image: objective, condenser and light, as the equations of the microscope need them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError

Condenser = Literal["disc", "annulus"]
Contrast = Literal["brightField", "darkField", "phaseContrast", "dic"]
CONTRASTS = ("brightField", "darkField", "phaseContrast", "dic")
"""What stands in the pupils: nothing; a condenser that misses the objective; a ring that delays direct light; two
prisms that show the difference of two sheared images."""


@dataclass(frozen=True, kw_only=True)
class Microscope:
    """Köhler illumination, an objective, and whatever stands in their pupils.

    Attributes:
        numerical_aperture: Of the objective; waves steeper than the medium lets through do not reach it.
        condenser_aperture: Numerical aperture of the condenser; 0 for coherent light along the axis.
        condenser: Shape of its opening: a disc, or an annulus from `condenser_inner` on, as dark field needs.
        condenser_inner: Numerical aperture where an annulus begins.
        condenser_x, condenser_y: Numerical aperture by which that opening is off the axis.
        illumination_curvature: Of the waves that come from a point of the condenser, 1 over the distance from which
            they diverge [1/µm]; 0 for a condenser in focus, whose waves are plane, negative for waves that converge.
        wavelength: In vacuum [µm].
        bandwidth: Full width at half maximum of the spectrum, a Gaussian [µm]; 0 for one wavelength.
        medium_index: Refractive index of the liquid.
        immersion_index: Refractive index of immersion and cover glass, taken as one.
        contrast: One of `CONTRASTS`; the equations are those of `otwarp.vision.pupil`.
        ring_delay: By which the ring of phase contrast delays direct light [wavelengths]; −1/4 shows what is optically
            dense dark (positive phase contrast), 1/4 shows it bright.
        ring_transmission: Share of the direct light that the ring passes.
        shear: Distance of the two images of differential interference contrast in the object plane [µm].
        shear_angle: Of it from the x axis [rad]; with a bias from 0 to 1/2 what gets denser that way is bright.
        bias: By which one of the two images is ahead of the other [wavelengths]; 0 for a dark background.
        depth: Of the focal plane below the cover glass, nominal [µm], where index mismatch aberrates; 0 for none.
        zernike: Wavefront error of the objective: Noll's number → root mean square [wavelengths].
        pixel: Size of a pixel in the object plane [µm].

    Raises:
        InputError: A number out of its range.
    """

    numerical_aperture: float = 1.2
    condenser_aperture: float = 0.4
    condenser: Condenser = "disc"
    condenser_inner: float = 0.0
    condenser_x: float = 0.0
    condenser_y: float = 0.0
    illumination_curvature: float = 0.0
    wavelength: float = 0.55
    bandwidth: float = 0.0
    medium_index: float = 1.33
    immersion_index: float = 1.518
    contrast: Contrast = "brightField"
    ring_delay: float = -0.25
    ring_transmission: float = 0.25
    shear: float = 0.2
    shear_angle: float = 0.0
    bias: float = 0.25
    depth: float = 0.0
    zernike: Mapping[int, float] = field(default_factory=dict, hash=False)
    pixel: float = 0.1

    def __post_init__(self) -> None:
        finest = self.nyquist_pixel if min(self.numerical_aperture, self.medium_index) > 0.0 else math.inf
        limits = {
            "medium_index": (0.0, 4.0, "the largest index"),
            "numerical_aperture": (0.0, self.immersion_index, "the index of the immersion"),
            "condenser_aperture": (-1e-12, self.medium_index, "the index of the medium"),
            "wavelength": (0.1, 10.0, "10 µm"),
            "bandwidth": (-1e-12, 0.5 * self.wavelength, "half the wavelength"),
            "pixel": (0.0, finest * (1.0 + 1e-9), "λ/(4 NA), which resolves what the objective passes"),
        }
        for name, (low, high, what) in limits.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low < value <= high):
                raise InputError(f"{name} of the microscope is {value:g}; allowed: above {max(low, 0.0):g}, "
                                 f"up to {high:.4g}, {what}")  # fmt: skip
        if self.condenser not in ("disc", "annulus"):
            raise InputError(f"condenser is {self.condenser!r}; allowed: disc, annulus")
        if not 0.0 <= self.condenser_inner <= self.condenser_aperture:
            raise InputError(f"condenser_inner is {self.condenser_inner:g}; allowed: 0 to {self.condenser_aperture:g}")
        reach = self.condenser_aperture + math.hypot(self.condenser_x, self.condenser_y)
        if not reach < self.medium_index:
            raise InputError(f"condenser_x and condenser_y of the microscope reach an aperture of {reach:g}; allowed: "
                             f"below {self.medium_index:g}, the index of the medium")  # fmt: skip
        if not abs(self.illumination_curvature) <= 0.02:
            raise InputError(f"illumination_curvature of the microscope is {self.illumination_curvature:g} per µm; "
                             "allowed: -0.02 to 0.02")  # fmt: skip
        self._check_contrast(reach)
        for noll, rms in self.zernike.items():
            if not 1 <= noll <= 45 or not math.isfinite(rms):
                raise InputError(f"zernike has {noll}: {rms}; allowed: Noll's numbers 1 to 45, finite wavelengths")

    def _check_contrast(self, reach: float) -> None:
        """Refuse rings and prisms that cannot be, and a condenser that the contrast has no use for."""
        if self.contrast not in CONTRASTS:
            raise InputError(f"contrast is {self.contrast!r}; allowed: {', '.join(CONTRASTS)}")
        limits = {
            "ring_delay": (-1.0, 1.0, "in [-1, 1] wavelengths"),
            "ring_transmission": (1e-6, 1.0, "in (0, 1]"),
            "shear": (1e-6, 5.0, "in (0, 5] µm"),
            "shear_angle": (-6.3, 6.3, "in [-6.3, 6.3] rad"),
            "bias": (-2.0, 2.0, "in [-2, 2] wavelengths"),
        }
        for name, (low, high, allowed) in limits.items():
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} of the microscope is {getattr(self, name):g}; allowed: {allowed}")
        if self.contrast == "phaseContrast" and reach > self.numerical_aperture:
            raise InputError(f"condenser_aperture of the microscope reaches {reach:g}; allowed for phaseContrast: "
                             f"up to {self.numerical_aperture:g}, numerical_aperture")  # fmt: skip
        off = math.hypot(self.condenser_x, self.condenser_y)
        inner = self.condenser_inner if self.condenser == "annulus" else 0.0
        if self.contrast == "darkField" and inner - off < self.numerical_aperture:
            raise InputError(f"condenser_inner of the microscope is {inner:g}; allowed for darkField: an annulus from "
                             f"{self.numerical_aperture + off:g}, numerical_aperture, on")  # fmt: skip

    @property
    def wavenumber(self) -> float:
        """Of the light in the medium [1/µm]."""
        return 2.0 * math.pi * self.medium_index / self.wavelength

    @property
    def cutoff(self) -> float:
        """Largest transverse wavenumber that reaches the image [1/µm]."""
        return 2.0 * math.pi / self.wavelength * min(self.numerical_aperture, 0.9999 * self.medium_index)

    @property
    def nyquist_pixel(self) -> float:
        """Largest pixel that loses nothing of an image [µm]: two for the finest beat of waves through the objective."""
        return self.wavelength / (4.0 * min(self.numerical_aperture, self.medium_index))

    def at(self, wavelength: float) -> Microscope:
        """The same in light of one wavelength [µm]; all paths in the pupil keep their length."""
        # the pixel is that of the central wavelength
        other = dataclasses.replace(self, bandwidth=0.0, pixel=1e-6)
        for name, value in self.paths(wavelength).items():
            object.__setattr__(other, name, value)
        object.__setattr__(other, "wavelength", wavelength)
        object.__setattr__(other, "pixel", self.pixel)
        return other

    def paths(self, wavelength: float) -> dict[str, Any]:
        """Fields that are paths in wavelengths, of another wavelength [µm]: `zernike`, `ring_delay`, `bias`."""
        factor = self.wavelength / wavelength
        scaled = {noll: rms * factor for noll, rms in self.zernike.items()}
        return {"zernike": scaled, "ring_delay": self.ring_delay * factor, "bias": self.bias * factor}

    def lines(self, count: int = 5) -> list[tuple[float, float]]:
        """Wavelengths [µm] and weights that stand for the spectrum: `count` Gauss–Hermite nodes, or a narrow line."""
        if self.bandwidth <= 0.0:
            return [(self.wavelength, 1.0)]
        nodes, weights = np.polynomial.hermite_e.hermegauss(count)
        sigma = self.bandwidth / math.sqrt(8.0 * math.log(2.0))
        return [
            (self.wavelength + sigma * float(x), float(w / weights.sum())) for x, w in zip(nodes, weights, strict=True)
        ]
