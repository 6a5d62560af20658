"""The two wells of `otwarp bench integrators`, and what a bead does in them by the Fokker–Planck equation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RectBivariateSpline

from otwarp.bench.integrators.fokker_planck import Estimate, Force, Lags, mean_exit_time, stationary_averages
from otwarp.bench.rungs import TrappedBead
from otwarp.errors import InputError
from otwarp.optics import Beam, Particle, force
from otwarp.optics.table import layer_count

DEEP, SHALLOW = 20.0, 5.0
"""Depth [k_B T] of the well in which a bead stays and of the one that it leaves."""

ROUNDED = 1.0 + 1e-9
"""A depth rounded down would be below what a bead needs to have an equilibrium."""

SPLINE_NODES = 11
"""Nodes per wavelength in the medium of the spline through exact forces."""


@dataclass(frozen=True, eq=False)
class Well:
    """A bead in its trap at one power.

    Attributes:
        bead: The bead, at that power.
    """

    bead: TrappedBead

    @classmethod
    def of_depth(cls, beam: Beam, sphere: Particle, depth: float) -> Well:
        """At the power that makes the trap `depth` k_B T deep.

        Raises:
            InputError: The beam does not hold the sphere, or its force depends on the azimuth.
        """
        if layer_count(beam) > 1:
            raise InputError(
                f"--polarization is {beam.polarization!r}, whose force depends on the azimuth; allowed: circular, left"
            )
        at_hand = TrappedBead(beam, sphere)
        power = beam.power * depth * ROUNDED * at_hand.energy / at_hand.properties.depth
        return cls(TrappedBead(beam.with_power(power), sphere))

    @property
    def power(self) -> float:
        """Power of the beam [mW]."""
        return self.bead.beam.power

    @property
    def drag(self) -> float:
        """Stokes friction γ of the bead [pN·s/µm]."""
        return 6.0 * math.pi * self.bead.medium.viscosity * self.bead.sphere.radius

    @property
    def relaxation(self) -> float:
        """γ/k of the stiffest direction [s]."""
        return self.drag / max(self.bead.properties.stiffness)

    @property
    def lags(self) -> tuple[int, int, int]:
        """Relaxation times over which x, z and z again are correlated: one, about half and one along the beam."""
        stiffness = self.bead.properties.stiffness
        whole = max(2, round(max(stiffness) / stiffness[2]))
        return 1, whole // 2, whole

    def start(self, worlds: int) -> np.ndarray:
        """(worlds, 3) places of a trapped bead [µm]."""
        return self.bead.thermal_points(worlds, np.random.default_rng(worlds))

    def about_centre(self, dimensionless: Callable[[np.ndarray], np.ndarray]) -> Force:
        """Force in pN at points from the equilibrium, from Q at points from the focus."""
        scale, centre = self.bead.beam.force_scale, self.bead.centre
        return lambda points: scale * dimensionless(points + centre)

    def averages(self, at: Force) -> dict[str, Estimate]:
        """Stationary observables; the ball is the trap region, which a bead in the deep well does not leave."""
        across, half, along = (lag * self.relaxation for lag in self.lags)
        diffusion = self.bead.energy / self.drag
        lags = Lags(across=across, half=half, along=along)
        return stationary_averages(at, self.bead.region, lags, diffusion=diffusion, energy=self.bead.energy)

    def escape(self, at: Force, reach: float) -> Estimate:
        """Mean time from the equilibrium to the distance `reach` [µm] from it [s]."""
        return mean_exit_time(at, reach, diffusion=self.bead.energy / self.drag, energy=self.bead.energy)


@dataclass(frozen=True, eq=False)
class SplinedForce:
    """Exact force of a beam without azimuth by quintic splines in (ρ, z): few exact values for many cells.

    Attributes:
        beam, sphere: The pair.
        reach: Distance from the focus up to which it serves [µm].
        device: Name of the Warp device that evaluates exact forces.
    """

    beam: Beam
    sphere: Particle
    reach: float
    device: str

    @cached_property
    def splines(self) -> tuple[RectBivariateSpline, ...]:
        """Splines of the components Q_ρ, Q_φ, Q_z."""
        spacing = self.beam.wavelength / self.beam.medium_index / SPLINE_NODES
        nodes = math.ceil(self.reach / spacing) + 3
        half, z = spacing * np.arange(nodes), spacing * np.arange(-nodes, nodes + 1)
        rho, height = (a.ravel() for a in np.meshgrid(half, z, indexing="ij"))
        points = np.stack([rho, np.zeros_like(rho), height], axis=1)
        exact = force(self.beam, self.sphere, points, device=self.device).reshape(nodes, len(z), 3)
        # mirrored about the axis, where the spline would else be one-sided: F_ρ and F_φ are odd in ρ
        whole = np.concatenate([exact[:0:-1] * [-1.0, -1.0, 1.0], exact])
        axis = np.concatenate([-half[:0:-1], half])
        return tuple(RectBivariateSpline(axis, z, whole[..., i], kx=5, ky=5) for i in range(3))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Q at points (n, 3) with y = 0, x ≥ 0 from the focus [µm]."""
        return np.stack([s.ev(points[:, 0], points[:, 2]) for s in self.splines], axis=1)
