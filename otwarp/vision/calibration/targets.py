"""Synthetic targets, rendered by the microscope: a grid of dots, a bead that a stage moves, beads at known heights."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Exposed, Rendering, expose
from otwarp.vision.sensor import Sensor
from otwarp.vision.specimen import Specimen

DOT_INDEX = 1.59
"""Refractive index of the dots of a grid."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bench:
    """A microscope with its sensor, on which targets are looked at.

    Attributes:
        microscope, sensor: As they are.
        rendering: How images are computed.
        width: Of the images, square [pixels].
        bead_radius: [µm].
        bead_index: Refractive index of beads.
        seed: Of the noise.
    """

    microscope: Microscope
    sensor: Sensor
    rendering: Rendering = dataclasses.field(default_factory=Rendering)
    width: int = 128
    bead_radius: float = 0.75
    bead_index: float = 1.45
    seed: int = 0

    @property
    def margin(self) -> float:
        """Around an image, where light is computed as well [µm]."""
        return 3.0 if self.rendering.margin == "auto" else self.rendering.margin

    def recorded(self, intensity: np.ndarray, first: int = 0) -> np.ndarray:
        """Grey levels as light, 1 about where it is unhindered; `first` numbers the images of the noise.

        A bead is a lens: the lamp is turned down until its brightest point is within full scale.
        """
        brightness = min(self.sensor.brightness, 0.9 / float(intensity.max()))
        sensor, top = dataclasses.replace(self.sensor, brightness=brightness), 2**self.sensor.bits - 1
        pages = [sensor.levels(page, seed=self.seed, image=first + n) for n, page in enumerate(intensity)]
        return (np.stack(pages) / top) ** sensor.gamma / brightness

    def bead(self, fourier: Fourier) -> Exposed:
        """Light that has passed a bead at the origin."""
        ball = Specimen.of_spheres([[0.0, 0.0, 0.0]], self.bead_radius, self.bead_index)
        self._check(self.bead_radius)
        return expose(ball, self.microscope, self.width, rendering=self.rendering, fourier=fourier)

    def check_pitch(self, pitch: float, name: str = "pitch") -> None:
        """Refuse a grid of which the image does not hold four steps, or of which dots are not resolved.

        Args:
            pitch: Of the grid [µm].
            name: How a message calls it.

        Raises:
            InputError: It is out of range, or there is none that would do.
        """
        m = self.microscope
        side = self.width * m.pixel
        finest = 2.0 * m.wavelength / min(m.numerical_aperture, m.medium_index)
        if finest > side / 4.0:
            least = 8.0 * m.wavelength / side
            raise InputError(f"numericalAperture of the camera is {m.numerical_aperture:g}, with which no grid is "
                             f"resolved four times in {side:.3g} µm; allowed: {least:.3g} or more")  # fmt: skip
        if not finest <= pitch <= side / 4.0:
            raise InputError(f"{name} is {pitch:g} µm; allowed: {finest:.3g} to {side / 4.0:.3g} µm, resolved and four "
                             "times in the image")  # fmt: skip

    def grid(self, pitch: float, angle: float, fourier: Fourier) -> np.ndarray:
        """(width, width) a square grid of dots of a third of the pitch across, turned by an angle [deg].

        The focal plane lies as far above the dots as they are wide, where each is a bright point.

        Raises:
            InputError: As `check_pitch`.
        """
        self.check_pitch(pitch)
        m = self.microscope
        half = 0.5 * self.width * m.pixel
        reach = math.ceil(math.sqrt(2.0) * half / pitch)
        steps = np.arange(-reach, reach + 1) * pitch
        turn = np.exp(1j * math.radians(angle))
        place = (turn * (steps[None, :] + 1j * steps[:, None])).ravel()
        inside = np.maximum(np.abs(place.real), np.abs(place.imag)) < half + self.margin - pitch / 6.0
        place = place[inside]
        dots = Specimen.of_spheres(np.stack([place.real, place.imag, 0.0 * place.real], axis=1), pitch / 6.0,
                                   DOT_INDEX)  # fmt: skip
        seen = expose(dots, m, self.width, rendering=self.rendering, fourier=fourier)
        return self.recorded(seen.images([pitch / 3.0]))[0]

    def steps(self, bead: Exposed, stage: np.ndarray) -> np.ndarray:
        """(k, width, width) a stuck bead, out of focus by its radius, while the stage is at (k, 2) places [µm]."""
        self._check(self.bead_radius + float(np.abs(stage).max()))
        return self.recorded(bead.images(np.full(len(stage), self.bead_radius), shift=stage), 1000)

    def sweep(self, bead: Exposed, focus: np.ndarray, height: float) -> np.ndarray:
        """(f, width, width) a bead at a height above the camera's own focal plane, at positions of the focus [µm]."""
        return self.recorded(bead.images(np.asarray(focus) - height), 2000)

    def refocused(self, bead: Exposed, nominal: np.ndarray, height: float) -> np.ndarray:
        """(f, width, width) a bead stuck at a distance below the cover glass, at nominal refocus distances [µm].

        Where immersion and liquid differ, the paraxial focus is at n/n′ of the nominal distance, and what is left of
        the phase aberrates.
        """
        m = self.microscope
        depth = np.asarray(nominal) * m.medium_index / m.immersion_index
        through = [dataclasses.replace(m, depth=float(d)) for d in depth]
        number = 3000 + round(1000.0 * height)
        return self.recorded(bead.images(height - depth, objective=through), number)

    def _check(self, reach: float) -> None:
        half = 0.5 * self.width * self.microscope.pixel
        if reach > half:
            raise InputError(
                f"the bead reaches {reach:.3g} µm from the middle; allowed: up to {half:.3g} µm, the image"
            )
