"""Case a in NumPy: a loop over steps, whole arrays at a time, no temporaries, a fast bit generator."""

from __future__ import annotations

import numpy as np

from benchmarks.numpy_bead import NumpyBeads


def missing(kind: str) -> str | None:
    """NumPy is everywhere, but on the CPU alone."""
    return None if kind == "cpu" else "runs on the CPU alone"


class Peer:
    """See `benchmarks.peers`."""

    name = f"NumPy {np.__version__}"

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        self.beads = NumpyBeads(np.array([3.0, 5.0, 7.0]), beads, relaxation, kick, seed)

    def step(self, steps: int) -> None:
        self.beads.step(steps)

    def variance(self) -> float:
        return float(np.mean((self.beads.position.astype(float) - self.beads.centre) ** 2))
