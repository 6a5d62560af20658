"""Brownian beads in harmonic traps as most people write them: a NumPy loop over steps, whole arrays at a time."""

from __future__ import annotations

import numpy as np


class NumpyBeads:
    """N independent beads by the Euler–Maruyama scheme in float32.

    x ← x + h·(c − x) + s·ξ, with h = k·dt/γ and s = √(2 k_B T dt/γ) (Ermak and McCammon 1978,
    doi:10.1063/1.436761). Written for speed within NumPy: no temporaries, a fast bit generator.

    Args:
        centre: (3,) trap position [µm].
        beads: N.
        relaxation: h [1].
        kick: s [µm].
        seed: Of the bit generator.
    """

    def __init__(self, centre: np.ndarray, beads: int, relaxation: float, kick: float, seed: int):
        self.random = np.random.Generator(np.random.SFC64(seed))
        self.centre = np.asarray(centre, dtype=np.float32)
        self.position = np.tile(self.centre, (beads, 1))
        self.relaxation, self.kick = np.float32(relaxation), np.float32(kick)
        self.noise, self.pull = np.empty_like(self.position), np.empty_like(self.position)

    def step(self, steps: int = 1) -> None:
        """Take `steps` steps."""
        for _ in range(steps):
            self.random.standard_normal(out=self.noise, dtype=np.float32)
            np.multiply(self.noise, self.kick, out=self.noise)
            np.subtract(self.centre, self.position, out=self.pull)
            np.multiply(self.pull, self.relaxation, out=self.pull)
            np.add(self.position, self.pull, out=self.position)
            np.add(self.position, self.noise, out=self.position)
