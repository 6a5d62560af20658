"""The rungs of the accuracy ladder: one bead in one trap, with every force model in turn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from otwarp.bench.typed import check_names
from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.optics import Beam, CurveFit, Particle, TrapProperties, fit_piecewise, trap_properties
from otwarp.scene import Body, Medium, Scene, Settings, Track, Trap
from otwarp.scene import Sphere as BeadSphere
from otwarp.units import BOLTZMANN

HARMONIC = "harmonic"
"""Name of the rung that all others are compared with."""

RELAXATION = 0.02
"""k·dt/γ in the stiffest direction: a variance 1 % too large, as a scene of default accuracy is stepped."""

HELD = 5.0
"""Least depth of the trap [k_B T] for which a bead has an equilibrium to fluctuate about."""


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A force model.

    Attributes:
        name: For the command line and JSON.
        label: For people.
        family: `none`, `harmonic`, `isotropic`, `split`, `bilinear`, `bicubic` or `exact`.
        tolerance: Of the table, relative to the peak force, or None.
    """

    name: str
    label: str
    family: str
    tolerance: float | None = None


def _table(interpolation: str, exponent: int) -> Rung:
    name = f"{interpolation}-1e-{exponent}"
    return Rung(
        name=name, label=f"{interpolation} table 1e-{exponent}", family=interpolation, tolerance=10.0**-exponent
    )


LADDER: tuple[Rung, ...] = (
    Rung(name="none", label="no trap", family="none"),
    Rung(name=HARMONIC, label="harmonic, radial + axial", family="harmonic"),
    Rung(name="piecewise-isotropic", label="piecewise, isotropic", family="isotropic"),
    Rung(name="piecewise", label="piecewise, radial + axial", family="split"),
    *(_table("bilinear", n) for n in (2, 3, 4)),
    *(_table("bicubic", n) for n in (2, 3, 4, 5)),
    Rung(name="exact", label="exact", family="exact"),
)
"""All rungs, from the cheapest model to the most accurate one."""


def chosen_rungs(names: Sequence[str]) -> tuple[Rung, ...]:
    """The rungs of these names in the ladder's order, with the harmonic one in any case; all for no names.

    Raises:
        InputError: A name that is not in `LADDER`.
    """
    known = [rung.name for rung in LADDER]
    check_names("--model", names, known)
    return tuple(rung for rung in LADDER if not names or rung.name in names or rung.name == HARMONIC)


@dataclass(frozen=True, eq=False)
class TrappedBead:
    """The bead, its beam, and what the exact force says about the two.

    Attributes:
        beam: At the power of the run [mW].
        sphere: The bead; its index is real.
        properties: Equilibrium, stiffness and escape at that power.
        medium: The liquid around it.

    Raises:
        InputError: The bead has no stable point, none across the beam, or one too shallow to stay in.
    """

    beam: Beam
    sphere: Particle
    properties: TrapProperties = field(init=False)
    medium: Medium = field(init=False)

    def __post_init__(self) -> None:
        if complex(self.sphere.index).imag != 0.0:
            raise InputError(f"--index is {self.sphere.index}; allowed: a real number, as scenes have it")
        object.__setattr__(self, "medium", Medium(refractive_index=self.beam.medium_index))
        if self.beam.power == 0.0:
            raise InputError("--power is 0 mW; allowed: above 0")
        object.__setattr__(self, "properties", trap_properties(self.beam, self.sphere))
        across = min(self.properties.stiffness[:2])
        if across <= 0.0:
            raise InputError(
                f"a sphere of radius {self.sphere.radius:g} µm and index {self.sphere.index} is pushed out of this "
                f"beam sideways, stiffness {across:.3g} pN/µm; allowed: a beam that holds it"
            )
        depth = self.properties.depth / self.energy
        if depth < HELD:
            raise InputError(
                f"--power is {self.beam.power:g} mW: the trap is {depth:.3g} k_BT deep; allowed: {HELD:g} k_BT or "
                f"more, from {self.beam.power * HELD / depth:.4g} mW on"
            )

    @property
    def energy(self) -> float:
        """k_B T [pN·µm]."""
        return BOLTZMANN * self.medium.temperature

    @property
    def centre(self) -> np.ndarray:
        """(3,) equilibrium from the focus [µm]."""
        return np.array([0.0, 0.0, self.properties.equilibrium])

    @property
    def region(self) -> float:
        """Radius of the trap region [µm]: as far as the trap pulls back in all directions, its nearest way out."""
        nearest = min(self.properties.escape_distance)
        return nearest if math.isfinite(nearest) else 3.0 * self.sphere.radius + 4.0 * self.beam.wavelength

    @property
    def spread(self) -> np.ndarray:
        """(3,) standard deviation of the trapped bead [µm], √(k_B T/k) by equipartition."""
        return np.sqrt(self.energy / np.array(self.properties.stiffness))

    @property
    def time_step(self) -> float:
        """Step that makes the stiffest direction relax by `RELAXATION` [s]."""
        drag = 6.0 * math.pi * self.medium.viscosity * self.sphere.radius
        return RELAXATION * drag / max(self.properties.stiffness)

    def thermal_points(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count, 3) places of a trapped bead [µm]: normal by equipartition, and inside the trap region."""
        out = np.zeros((0, 3))
        while len(out) < count:
            drawn = self.spread * rng.standard_normal((count, 3))
            out = np.concatenate([out, drawn[np.linalg.norm(drawn, axis=1) < self.region]])
        return self.centre + out[:count]

    @cached_property
    def fits(self) -> dict[str, CurveFit]:
        """The paper's law: `radial`, `axial`, `isotropic`."""
        return fit_piecewise(self.beam, self.sphere)

    def scene(self, rung: Rung) -> Scene:
        """The bead at the equilibrium of a trap whose force is this rung's; the focus is the origin."""
        index = complex(self.sphere.index).real
        sphere = BeadSphere(
            prim="/World/Bead/Sphere", radius=self.sphere.radius, refractive_index=index, collides=False
        )
        place = (0.0, 0.0, self.properties.equilibrium)
        body = Body(prim="/World/Bead", position=place, spheres=(sphere,))
        return Scene(
            medium=self.medium,
            settings=Settings(brownian=True),
            bodies=(body,),
            traps=() if rung.family == "none" else (self._trap(rung),),
        )

    def _trap(self, rung: Rung) -> Trap:
        beam = self.beam
        return Trap(
            prim="/World/Trap",
            position=Track.constant((0.0, 0.0, 0.0)),
            power=Track.constant(beam.power),
            wavelength=beam.wavelength,
            numerical_aperture=beam.numerical_aperture,
            polarization=beam.polarization,  # type: ignore[arg-type]
            beam=beam.kind,
            filling=beam.filling,
            charge=beam.charge,
            depth=beam.depth,
            glass_index=beam.glass_index,
            equilibrium=self.properties.equilibrium,
            **self._model(rung),
        )

    def _model(self, rung: Rung) -> dict[str, Any]:
        """The fields of the trap in which the rungs differ."""
        if rung.family == "exact":
            return {"model": "exact"}
        if rung.tolerance is not None:
            return {"model": "table", "interpolation": rung.family, "tolerance": rung.tolerance}
        if rung.family == "isotropic":
            return {"model": "piecewise", "radial": self.fits["isotropic"].law}
        if rung.family == "split":
            return {"model": "piecewise", "radial": self.fits["radial"].law, "axial": self.fits["axial"].law}
        # a spring that ends where the force does, so that every rung also watches for escapes
        across, along = float(np.mean(self.properties.stiffness[:2])), self.properties.stiffness[2]
        radial, axial = (TrapLaw(stiffness=k, cutoff=self.region, power=self.beam.power) for k in (across, along))
        return {"model": "harmonic", "radial": radial, "axial": axial}
