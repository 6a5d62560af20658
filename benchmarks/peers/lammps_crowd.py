"""Case b in LAMMPS: `fix brownian` with a tabulated pair force, in float64, Gaussian noise.

The spheres are those of `benchmarks.crowd`: same places at the start, same time step, open space. Hertz repulsion comes
from a table against the squared distance, because the granular styles carry rotations and histories that this
workload has not. The contact is explicit, as in other codes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.peers import lammps_bead
from otwarp.bench.speed.many_body import Spheres, spheres

SKIN = 0.5
"""In diameters: neither 0.3 nor 0.7 is faster."""

NEAREST = 0.25
"""Where the table begins, in diameters; LAMMPS stops where spheres are nearer."""

POINTS = 4000
"""Of the table."""


def missing(kind: str) -> str | None:
    """On a CPU with lammps and MPI."""
    return lammps_bead.missing(kind)


def table(what: Spheres) -> str:
    """Energy and force in LAMMPS's format, even in the squared distance."""
    low, high = NEAREST * what.diameter, what.diameter
    distance = np.sqrt(np.linspace(low**2, high**2, POINTS))
    overlap = np.maximum(what.diameter - distance, 0.0)
    rows = zip(distance, what.energy(distance), what.hardness * overlap**1.5, strict=True)
    lines = [f"{i} {r:.15g} {e:.15g} {f:.15g}" for i, (r, e, f) in enumerate(rows, start=1)]
    return "\n".join(["HERTZ", f"N {POINTS} RSQ {low:.15g} {high:.15g}", "", *lines, ""])


class Peer:
    """`count` spheres of `otwarp.bench.speed.many_body`; `step(steps)`, and `positions()` in the order of the start."""

    def __init__(self, count: int, *, seed: int = 7, kind: str = "cpu"):
        what = spheres(count)
        self.lmp = lammps_bead.begun(what.start, "sort 1000 0.0", "s")
        self.name = f"LAMMPS {self.lmp.version()}, pair table, float64"
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "hertz.table"
            file.write_text(table(what))
            self.lmp.commands_string(f"""
pair_style table linear {POINTS}
pair_coeff 1 1 {file} HERTZ {what.diameter}""")
        # with a time step of one
        self.lmp.commands_string(f"""
neighbor {SKIN * what.diameter} bin
neigh_modify every 1 delay 0 check yes
fix move all brownian {what.thermal} {seed} gamma_t {1.0 / what.mobility} rng gaussian
timestep 1.0
run 0""")

    def step(self, steps: int) -> None:
        self.lmp.command(f"run {steps} pre no post no")

    def positions(self) -> np.ndarray:
        """(count, 3) [µm]."""
        return lammps_bead.places_of(self.lmp)
