"""What stands in the light: spheres and capsules, each of one refractive index, in the frame of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError


@dataclass(frozen=True, eq=False)
class Specimen:
    """Transparent solids; light travels along +z, y points up in the image.

    Attributes:
        start, end: (n, 3) centres of their rounded ends [µm], equal for spheres.
        radius: (n) [µm].
        index: (n) refractive indices. Where solids of one index overlap they are one solid.

    Raises:
        InputError: Numbers that are not finite, a radius that is not above 0, an index below 1.
    """

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray
    index: np.ndarray

    @classmethod
    def of_spheres(cls, centers: Sequence[Sequence[float]] | np.ndarray, radius: object, index: object) -> Specimen:
        """Spheres alone.

        Args:
            centers: (n, 3) [µm].
            radius: [µm], one for all or one for each.
            index: Refractive index, likewise.

        Raises:
            InputError: As `Specimen`.
        """
        place = np.atleast_2d(np.asarray(centers, dtype=float))
        return cls(place, place, *(np.broadcast_to(np.asarray(v, dtype=float), len(place)) for v in (radius, index)))

    def __post_init__(self) -> None:
        for name in ("start", "end", "radius", "index"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise InputError(f"{name} of the specimen has values that are not finite; allowed: finite numbers")
        if np.any(self.radius <= 0.0):
            raise InputError(f"radius of the specimen is {self.radius.min():g} µm; allowed: above 0")
        if np.any(self.index < 1.0):
            raise InputError(f"index of the specimen is {self.index.min():g}; allowed: 1 or more")

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def low(self) -> np.ndarray:
        """(3) lower corner of all solids [µm]."""
        return self.boxes()[0].min(axis=0)

    @property
    def high(self) -> np.ndarray:
        """(3) upper corner of all solids [µm]."""
        return self.boxes()[1].max(axis=0)

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) lower and upper corners of each solid [µm]."""
        thick = self.radius[:, None]
        return np.minimum(self.start, self.end) - thick, np.maximum(self.start, self.end) + thick

    def some(self, which: Sequence[int] | np.ndarray) -> Specimen:
        """Some of the solids.

        Args:
            which: (k) their numbers, from 0.
        """
        n = np.asarray(which, dtype=int)
        return Specimen(self.start[n], self.end[n], self.radius[n], self.index[n])

    def moved(self, by: Sequence[float] | np.ndarray) -> Specimen:
        """The same solids moved by a vector `by` (3) [µm]."""
        return Specimen(self.start + np.asarray(by), self.end + np.asarray(by), self.radius, self.index)

    def indices(self) -> np.ndarray:
        """The refractive indices there are, in order."""
        return np.unique(self.index)
