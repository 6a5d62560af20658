"""Case a in JAX: a compiled loop over steps, whole arrays at a time, the key folded with the step."""

from __future__ import annotations

import importlib.util
import os
from functools import partial


def missing(kind: str) -> str | None:
    """With jax, on CUDA with a build for it."""
    if not importlib.util.find_spec("jax"):
        return "jax is not installed"
    # not to take all of the memory of a GPU that others work on
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    import jax

    try:
        return None if jax.devices("gpu" if kind == "cuda" else "cpu") else "no such device"
    except RuntimeError:
        return "this jax has no CUDA"


class Peer:
    """See `otwarp.bench.speed.peers`."""

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        import jax
        import jax.numpy as jnp

        self.name = f"JAX {jax.__version__}"
        self.device = jax.devices("gpu" if kind == "cuda" else "cpu")[0]
        with jax.default_device(self.device):
            self.centre = jnp.array([3.0, 5.0, 7.0], dtype=jnp.float32)
            self.position = jnp.tile(self.centre, (beads, 1))
            self.key = jax.random.key(seed)
        self.taken = 0

        @partial(jax.jit, donate_argnums=0)
        def run(position, key, first, steps):
            def one(i, x):
                noise = jax.random.normal(jax.random.fold_in(key, first + i), x.shape, jnp.float32)
                return x + jnp.float32(relaxation) * (self.centre - x) + jnp.float32(kick) * noise

            return jax.lax.fori_loop(0, steps, one, position)

        self.run = run

    def step(self, steps: int) -> None:
        import jax

        with jax.default_device(self.device):
            self.position = self.run(self.position, self.key, self.taken, steps)
        self.position.block_until_ready()
        self.taken += steps

    def variance(self) -> float:
        import numpy as np

        return float(np.mean((np.asarray(self.position, dtype=float) - np.asarray(self.centre)) ** 2))
