"""Case a in NumPy: a loop over steps, whole arrays at a time, no temporaries, a fast bit generator."""

from __future__ import annotations

import numpy as np


def missing(kind: str) -> str | None:
    """NumPy is everywhere, but on the CPU alone."""
    return None if kind == "cpu" else "runs on the CPU alone"


class Peer:
    """See `otwarp.bench.speed.peers`."""

    name = f"NumPy {np.__version__}"

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        self.random = np.random.Generator(np.random.SFC64(seed))
        self.centre = np.array([3.0, 5.0, 7.0], dtype=np.float32)
        self.position = np.tile(self.centre, (beads, 1))
        self.relaxation, self.kick = np.float32(relaxation), np.float32(kick)
        self.noise, self.pull = np.empty_like(self.position), np.empty_like(self.position)

    def step(self, steps: int) -> None:
        """Take steps."""
        for _ in range(steps):
            self.random.standard_normal(out=self.noise, dtype=np.float32)
            np.multiply(self.noise, self.kick, out=self.noise)
            np.subtract(self.centre, self.position, out=self.pull)
            np.multiply(self.pull, self.relaxation, out=self.pull)
            np.add(self.position, self.pull, out=self.position)
            np.add(self.position, self.noise, out=self.position)

    def variance(self) -> float:
        """Of the distance from the trap along one axis [µm²]."""
        return float(np.mean((self.position.astype(float) - self.centre) ** 2))
