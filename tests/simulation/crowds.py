"""Crowds of spheres that several tests share."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Body, Material, Medium, Obstacle, Scene, Settings, Sphere, Trap
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import VISCOSITY

SOFT = Material(youngs_modulus=3.0, poisson_ratio=0.4)
"""So soft that contacts of spheres of 1 µm are explicit up to steps of 1.7 ms."""
SOFT_STEP = 1.0e-3


def ball(name: str, position: np.ndarray, *, radius: float = 1.0, collides: bool = True, trapped: bool = False) -> Body:
    """A lone sphere of the density of the medium and of the material SOFT."""
    sphere = Sphere(prim=f"/World/{name}/S", radius=radius, collides=collides, trapped=trapped)
    place = (float(position[0]), float(position[1]), float(position[2]))
    return Body(prim=f"/World/{name}", position=place, spheres=(sphere,), material=SOFT, density=Medium().density)


def crowd(
    places: np.ndarray,
    radii: np.ndarray | float = 1.0,
    *,
    obstacles: tuple[Obstacle, ...] = (),
    traps: tuple[Trap, ...] = (),
    trapped: int = 0,
    temperature: float | None = None,
    time_step: float = SOFT_STEP,
) -> Scene:
    """Soft spheres at `places` (n, 3) [µm]; traps act on the first `trapped`; no noise without a temperature."""
    sizes = np.broadcast_to(np.asarray(radii, dtype=float), len(places))
    bodies = tuple(
        ball(f"B{i}", p, radius=float(r), trapped=i < trapped)
        for i, (p, r) in enumerate(zip(places, sizes, strict=True))
    )
    return Scene(
        medium=Medium(temperature=temperature or Medium().temperature, viscosity=VISCOSITY),
        bodies=bodies,
        traps=traps,
        obstacles=obstacles,
        settings=Settings(time_step=time_step, brownian=temperature is not None),
    )


def jumbled(count: int, spacing: float = 1.9, *, seed: int = 0, jitter: float = 0.15) -> np.ndarray:
    """(count, 3) places on a cubic lattice with jitter, in an order that has nothing to do with where they are [µm]."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(round(count ** (1.0 / 3.0), 6)))
    lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    chosen = lattice[rng.permutation(len(lattice))[:count]]
    return spacing * (chosen - 0.5 * side) + rng.uniform(-jitter, jitter, (count, 3))


def places(sim: Simulation) -> np.ndarray:
    """(W, B, 3) float64."""
    return sim.state.position.numpy().astype(float)
