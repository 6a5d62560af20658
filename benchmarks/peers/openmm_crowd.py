"""Case b in OpenMM: a custom pair force with a cut-off and its Brownian integrator, on one thread or on CUDA.

The spheres are those of `benchmarks.crowd`: same places at the start, same force, same time step, open space. OpenMM
lists neighbours as it sees fit. The contact is explicit, as in other codes.
"""

from __future__ import annotations

import numpy as np

from benchmarks.peers import openmm_bead
from otwarp.bench.speed.many_body import spheres


def missing(kind: str) -> str | None:
    """With openmm, on CUDA with its plugin."""
    return openmm_bead.missing(kind)


class Peer:
    """`count` spheres of `otwarp.bench.speed.many_body`; `step(steps)`, and `positions()` in the order of the start."""

    def __init__(self, count: int, *, seed: int = 7, kind: str = "cpu"):
        import openmm

        what = spheres(count)
        self.kind = kind
        self.name = f"OpenMM {openmm.__version__}, {openmm_bead.PLATFORMS[kind]}"
        system = openmm.System()
        # nothing is evaluated beyond the cut-off, where the root would be of a negative number
        force = openmm.CustomNonbondedForce("0.4*hardness*deep*deep*sqrt(deep); deep=diameter-r")
        force.addGlobalParameter("hardness", what.hardness)
        force.addGlobalParameter("diameter", what.diameter)
        force.setNonbondedMethod(openmm.CustomNonbondedForce.CutoffNonPeriodic)
        force.setCutoffDistance(what.diameter)
        for _ in range(count):
            system.addParticle(1.0)
            force.addParticle([])
        system.addForce(force)
        # with a friction of one the time step is the mobility
        self.context = openmm_bead.context(
            system, what.start, thermal=what.thermal, time_step=what.mobility, seed=seed, kind=kind
        )

    def step(self, steps: int) -> None:
        openmm_bead.advance(self.context, steps, self.kind)

    def positions(self) -> np.ndarray:
        """(count, 3) [µm]."""
        return openmm_bead.places_of(self.context)
