"""Case a in numba for one core: the loop that numba's manual teaches, with a NumPy generator inside.

With a `numpy.random.Generator` the loop is almost four times as fast as with `numpy.random.normal`.
"""

from __future__ import annotations

import importlib.util

import numpy as np


def missing(kind: str) -> str | None:
    """On a CPU with numba."""
    if kind != "cpu":
        return "runs on the CPU alone"
    return None if importlib.util.find_spec("numba") else "numba is not installed"


class Peer:
    """See `otwarp.bench.speed.peers`."""

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        import numba  # pyright: ignore[reportMissingImports]

        self.name = f"numba {numba.__version__}"

        @numba.njit(fastmath=True)
        def run(position, centre, relaxation, kick, steps, rng):
            """Euler–Maruyama steps of beads (n, 3) in a spring, in place."""
            for i in range(position.shape[0]):
                x, y, z = position[i, 0], position[i, 1], position[i, 2]
                for _ in range(steps):
                    x += relaxation * (centre[0] - x) + kick * np.float32(rng.standard_normal())
                    y += relaxation * (centre[1] - y) + kick * np.float32(rng.standard_normal())
                    z += relaxation * (centre[2] - z) + kick * np.float32(rng.standard_normal())
                position[i, 0], position[i, 1], position[i, 2] = x, y, z

        self.run = run
        self.centre = np.array([3.0, 5.0, 7.0], dtype=np.float32)
        self.position = np.tile(self.centre, (beads, 1))
        self.constants = (np.float32(relaxation), np.float32(kick))
        self.rng = np.random.default_rng(seed)

    def step(self, steps: int) -> None:
        """Take steps."""
        self.run(self.position, self.centre, *self.constants, steps, self.rng)

    def variance(self) -> float:
        """Of the distance from the trap along one axis [µm²]."""
        return float(np.mean((self.position.astype(float) - self.centre) ** 2))
