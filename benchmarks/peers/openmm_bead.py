"""Case a in OpenMM: a custom external force and its Brownian integrator, on one thread or in float32 on CUDA."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np

PLATFORMS = {"cpu": "CPU", "cuda": "CUDA"}


def missing(kind: str) -> str | None:
    """With openmm, on CUDA with its plugin."""
    if not importlib.util.find_spec("openmm"):
        return "openmm is not installed"
    import openmm

    found = [openmm.Platform.getPlatform(i).getName() for i in range(openmm.Platform.getNumPlatforms())]
    return None if PLATFORMS[kind] in found else "this openmm has no CUDA"


def context(system: Any, places: np.ndarray, *, thermal: float, time_step: float, seed: int, kind: str) -> Any:
    """A system at its places, with friction and masses of one, k_B T = `thermal`, in OpenMM's own units."""
    import openmm
    from openmm import unit

    per_kelvin = unit.MOLAR_GAS_CONSTANT_R.value_in_unit(unit.kilojoule_per_mole / unit.kelvin)
    integrator = openmm.BrownianIntegrator(thermal / per_kelvin, 1.0, time_step)
    integrator.setRandomNumberSeed(seed)
    how = {"Threads": "1"} if kind == "cpu" else {"Precision": "single"}
    out = openmm.Context(system, integrator, openmm.Platform.getPlatformByName(PLATFORMS[kind]), how)
    out.setPositions(places.astype(float))
    return out


def advance(ctx: Any, steps: int, kind: str) -> None:
    """Take steps, and wait for them."""
    ctx.getIntegrator().step(steps)
    if kind == "cuda":
        # nothing less waits for the device
        ctx.getState(getEnergy=True)


def places_of(ctx: Any) -> np.ndarray:
    """(count, 3)."""
    return ctx.getState(getPositions=True).getPositions(asNumpy=True)._value


class Peer:
    """See `otwarp.bench.speed.peers`."""

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        import openmm

        self.kind = kind
        self.name = f"OpenMM {openmm.__version__}, {PLATFORMS[kind]}"
        self.centre = np.array([3.0, 5.0, 7.0])
        system = openmm.System()
        force = openmm.CustomExternalForce("0.5*h*((x-a)^2+(y-b)^2+(z-c)^2)")
        for name, value in zip("habc", (relaxation, *self.centre), strict=True):
            force.addGlobalParameter(name, value)
        for i in range(beads):
            system.addParticle(1.0)
            force.addParticle(i, [])
        system.addForce(force)
        places = np.tile(self.centre, (beads, 1))
        self.context = context(system, places, thermal=0.5 * kick**2, time_step=1.0, seed=seed, kind=kind)

    def step(self, steps: int) -> None:
        advance(self.context, steps, self.kind)

    def variance(self) -> float:
        return float(np.mean((places_of(self.context) - self.centre) ** 2))
