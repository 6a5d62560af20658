"""Case b in numba for one core: Verlet lists with a skin from sorted cells, in loops as one writes them in numba.

The same plan as in C, see `c_crowd`; noise comes from a NumPy generator, which compiled code may draw from. The loops
are in `numba_crowd_loops`.
"""

from __future__ import annotations

import importlib.util

import numpy as np

from otwarp.bench.speed.many_body import spheres

SKIN = 0.6
"""In diameters: lists last for about twenty steps, and neither 0.4 nor 0.5 is faster."""

MOST = 40
"""Room for listed neighbours per sphere."""


def missing(kind: str) -> str | None:
    """On a CPU with numba."""
    if kind != "cpu":
        return "runs on the CPU alone"
    return None if importlib.util.find_spec("numba") else "numba is not installed"


class Peer:
    """`count` spheres of `otwarp.bench.speed.many_body`; `step(steps)`, and `positions()` in the order of the start."""

    def __init__(self, count: int, *, seed: int = 7, kind: str = "cpu"):
        import numba

        from benchmarks.peers import numba_crowd_loops

        what = spheres(count)
        self.name = f"numba {numba.__version__}, Verlet lists"
        self.run = numba_crowd_loops.run
        self.place, self.tag = what.start.copy(), np.arange(count, dtype=np.int32)
        self.arrays = [np.zeros((count, 3), np.float32) for _ in range(2)]
        self.near = [np.zeros(count, np.int32), np.zeros((count, MOST), np.int32)]
        law = (what.diameter, what.hardness, what.mobility, what.kick, SKIN * what.diameter)
        self.constants = [np.float32(v) for v in law]
        self.fresh, self.rng, self.made = False, np.random.default_rng(seed), 0

    def step(self, steps: int) -> None:
        arrays = (self.place, self.tag, *self.arrays, *self.near)
        self.fresh, made = self.run(*arrays, *self.constants, self.fresh, steps, self.rng)
        if made < 0:
            raise RuntimeError(f"more than {MOST} neighbours of one sphere")
        self.made += made

    def positions(self) -> np.ndarray:
        """(count, 3) [µm]."""
        out = np.empty_like(self.place)
        out[self.tag] = self.place
        return out
