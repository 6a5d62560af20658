"""The rungs of the ladder from exact force to spring: each gives Q at points, and says how far it is from exact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.laws.table import Interpolation
from otwarp.optics.analysis import TrapProperties, trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.exact import checked_points
from otwarp.optics.field import Field, force
from otwarp.optics.fit import CurveFit, ForceCurves, fit_piecewise, pull, sample_curves
from otwarp.optics.mie import Particle
from otwarp.optics.table import ForceTable, check_accuracy
from otwarp.optics.table_build import build_table

MODELS: dict[str, str] = {
    "exact": "generalised Lorenz–Mie theory",
    "table": "nested (ρ, z) grids within a tolerance",
    "piecewise": "the paper's eq. 1, radial and axial",
    "piecewise-isotropic": "the paper's eq. 1, one curve for all directions",
    "harmonic": "the stiffness at the equilibrium, radial and axial",
}
"""Force models, from exact downward."""


@dataclass(frozen=True, kw_only=True)
class ModelError:
    """Difference of a model from the exact force on a set of points.

    Attributes:
        largest, rms: Of |Q − Q_exact|.
        peak: Peak |Q| that they may be compared with.
        points: How many points they were taken on.
    """

    largest: float
    rms: float
    peak: float
    points: int


@dataclass(frozen=True, kw_only=True)
class Ladder:
    """All force models of one beam and sphere; what a model needs is made when it is first asked for.

    Attributes:
        beam, sphere: What the models stand for.
        tolerance, interpolation: Of the table.
        continuous: Whether the piecewise laws join at δ and end at zero.
        cache: Of the table: True for the user's folder, a folder, or False.
        device: Warp device for exact forces; None for NumPy.

    Raises:
        InputError: A tolerance out of range, an unknown interpolation, or a sphere of the medium's own index.
    """

    beam: Beam
    sphere: Particle
    tolerance: float = 1e-3
    interpolation: Interpolation = "bilinear"
    continuous: bool = True
    cache: Path | bool = True
    device: str | None = None

    def __post_init__(self) -> None:
        check_accuracy(self.tolerance, self.interpolation)
        if complex(self.sphere.index) == self.beam.medium_index:
            raise InputError(
                f"sphere index is {self.beam.medium_index:g}, that of the medium: no force; allowed: any other"
            )

    @cached_property
    def table(self) -> ForceTable:
        """The table, from the cache or made now."""
        return build_table(
            self.beam,
            self.sphere,
            tolerance=self.tolerance,
            interpolation=self.interpolation,
            cache=self.cache,
            device=self.device,
        )

    @cached_property
    def properties(self) -> TrapProperties:
        """Equilibrium, stiffness, escape at the beam's power."""
        return trap_properties(self.beam, self.sphere)

    @cached_property
    def curves(self) -> ForceCurves:
        """Exact curves over the trap region."""
        return sample_curves(self.beam, self.sphere, device=self.device)

    @cached_property
    def piecewise(self) -> dict[str, CurveFit]:
        """The paper's law, fitted to the curves at the beam's power."""
        return fit_piecewise(self.beam, self.sphere, continuous=self.continuous, curves=self.curves)

    def force(self, name: str) -> Field:
        """The model `name` as a function from points (n, 3) [µm] to Q (n, 3), for a beam along +z with its focus at 0.

        `piecewise` and `harmonic` are directed to the equilibrium, as in the kernels; `harmonic` has no cut-off here.

        Raises:
            InputError: No such model, or one that needs an equilibrium where the beam has none. The function raises it
                for points of the wrong shape or not finite.
        """
        if name not in MODELS:
            raise InputError(f"force model is {name!r}; allowed: {', '.join(MODELS)}")
        if name == "exact":
            return lambda points: force(self.beam, self.sphere, points, device=self.device)
        made = {
            "table": lambda: self.table.force,
            "piecewise": self._split,
            "piecewise-isotropic": self._isotropic,
            "harmonic": self._spring,
        }[name]()
        return lambda points: made(checked_points(self.beam, self.sphere, points)[0])

    def _centred(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) displacement from the equilibrium [µm]."""
        return points - np.array([0.0, 0.0, self.properties.equilibrium])

    def _split(self) -> Field:
        scale = self.beam.force_scale
        radial, axial = self.piecewise["radial"].law, self.piecewise["axial"].law
        reach = max(radial.cutoff, axial.cutoff)

        def q(points: np.ndarray) -> np.ndarray:
            """Across and along the beam, each by its own curve."""
            d = self._centred(points)
            across = np.hypot(d[:, 0], d[:, 1])
            ratio = np.divide(pull(radial, across), across, out=np.zeros_like(across), where=across > 0.0)
            along = np.sign(d[:, 2]) * pull(axial, np.abs(d[:, 2]))
            inward = np.stack([ratio * d[:, 0], ratio * d[:, 1], along], axis=1)
            return np.where(np.linalg.norm(d, axis=1)[:, None] < reach, -inward / scale, 0.0)

        return q

    def _isotropic(self) -> Field:
        scale, law = self.beam.force_scale, self.piecewise["isotropic"].law

        def q(points: np.ndarray) -> np.ndarray:
            """Towards the equilibrium, by distance alone."""
            d = self._centred(points)
            distance = np.linalg.norm(d, axis=1)
            ratio = np.divide(pull(law, distance), distance, out=np.zeros_like(distance), where=distance > 0.0)
            return -ratio[:, None] * d / scale

        return q

    def _spring(self) -> Field:
        x, y, z = self.properties.stiffness
        radial = 0.5 * (x + y)
        stiffness = np.array([radial, radial, z]) / self.beam.force_scale
        return lambda points: -stiffness * self._centred(points)

    def peak(self, name: str) -> float:
        """Peak |Q|: for the `name` table over the whole field; for other models the largest on the exact curves."""
        if name == "table":
            return self.table.peak
        return float(max(np.abs(q).max() for _, q in self.curves.values()))

    def error(self, name: str, points: np.ndarray, *, exact: np.ndarray | None = None) -> ModelError:
        """Difference of a model from exact on these points.

        Args:
            name: Of the model, as `force`.
            points: (n, 3) sphere centres from the focus [µm], at least one.
            exact: (n, 3) exact Q there, if it is at hand.

        Raises:
            InputError: As `force`, or no points.
        """
        if len(points) == 0:
            raise InputError("an error needs points to be taken on; allowed: 1 or more")
        found = self.force(name)(points)
        truth = self.force("exact")(points) if exact is None else exact
        gap = np.linalg.norm(found - truth, axis=1)
        return ModelError(
            largest=float(gap.max()),
            rms=float(np.sqrt(np.mean(gap**2))),
            peak=self.peak(name),
            points=len(points),
        )
