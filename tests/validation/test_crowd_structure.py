"""Distances of pairs in a crowd of soft or hard spheres in a periodic box, beside Monte Carlo of the same energy.

Hertz's energy of two equal spheres of radius a that overlap by δ is 2/5·K·δ^{5/2}, K = 4/3·E*·√(a/2). Monte Carlo
(Metropolis et al. 1953, doi:10.1063/1.1699114) knows neither time steps nor contacts, so that it holds the contact
forces, the neighbour lists, the images and the noise of the grid driver to Boltzmann's distribution.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Material, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.crowds import SOFT, crowd
from tests.simulation.setups import CELL, ENERGY

SIDE, LENGTH, RADIUS = 6, 14.4, 1.0
COUNT = SIDE**3
"""At a volume fraction of 0.30."""
WORLDS, FRAMES = 8, 40
EDGES = np.concatenate([[1.5], np.arange(1.8, 2.6, 0.1), np.arange(2.6, 7.2, 0.2)])
"""Of the distances that are counted [µm]: up to half the period."""


def lattice() -> np.ndarray:
    """(COUNT, 3) a cubic lattice that fills the cell [µm]."""
    axis = (np.arange(SIDE) + 0.5) * LENGTH / SIDE - 0.5 * LENGTH
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)


def counts(places: np.ndarray) -> np.ndarray:
    """(W, bins) how many pairs of nearest images are how far apart; `places` (W, COUNT, 3) [µm]."""
    first, second = np.triu_indices(places.shape[1], 1)
    out = []
    for world in places:
        away = world[first] - world[second]
        away -= LENGTH * np.rint(away / LENGTH)
        out.append(np.histogram(np.linalg.norm(away, axis=1), EDGES)[0])
    return np.array(out, dtype=float)


def hertz(material: Material, distance: np.ndarray) -> np.ndarray:
    """Energy of pairs [pN·µm]."""
    modulus = material.youngs_modulus / (2.0 * (1.0 - material.poisson_ratio**2))
    overlap = np.maximum(2.0 * RADIUS - distance, 0.0)
    return 0.4 * 4.0 / 3.0 * modulus * np.sqrt(0.5 * RADIUS) * overlap**2.5


def monte_carlo(material: Material, *, settle: int, apart: int) -> np.ndarray:
    """(W, bins) mean counts of chains, one a world: `settle` sweeps, then a frame every `apart` sweeps."""
    rng = np.random.default_rng(4)
    places = np.broadcast_to(lattice(), (WORLDS, COUNT, 3)).copy()
    worlds, total = np.arange(WORLDS), np.zeros((WORLDS, len(EDGES) - 1))

    def energy(at: np.ndarray, but: int) -> np.ndarray:
        away = places - at[:, None]
        away -= LENGTH * np.rint(away / LENGTH)
        distance = np.linalg.norm(away, axis=2)
        distance[:, but] = np.inf
        return hertz(material, distance).sum(axis=1)

    for sweep in range(1, settle + apart * FRAMES + 1):
        for i in rng.permutation(COUNT):
            there = places[:, i] + rng.uniform(-0.3, 0.3, (WORLDS, 3))
            rise = energy(there, i) - energy(places[:, i], i)
            taken = rng.random(WORLDS) < np.exp(-np.maximum(rise, 0.0) / ENERGY)
            places[worlds[taken], i] = there[taken]
        if sweep > settle and (sweep - settle) % apart == 0:
            total += counts(places)
    return total / FRAMES


def brownian(material: Material, device: str, *, step: float, settle: float, apart: float) -> np.ndarray:
    """(W, bins) mean counts of a simulation: after `settle` seconds a frame every `apart` seconds."""
    scene = crowd(lattice(), RADIUS, temperature=298.15, time_step=step)
    settings: Settings = dataclasses.replace(scene.settings, period=(LENGTH,) * 3)
    bodies = tuple(dataclasses.replace(body, material=material) for body in scene.bodies)
    scene = dataclasses.replace(scene, settings=settings, bodies=bodies)
    sim = Simulation(scene, worlds=WORLDS, seed=3, device=device)
    assert sim.model.features.driver == "grid" and sim.model.features.soft_contacts == (material is SOFT)
    sim.run(settle)
    total = np.zeros((WORLDS, len(EDGES) - 1))
    for _ in range(FRAMES):
        sim.run(apart)
        total += counts(sim.state.position.numpy().astype(float))
    return total / FRAMES


@pytest.mark.validate
@pytest.mark.parametrize(("name", "material", "step"), [("soft", SOFT, 2.5e-4), ("hard", CELL, 5e-4)])
def test_pair_distances_are_those_of_monte_carlo(name, material, step, expect_law, device):
    """g(r) bin by bin, by the spread over worlds and over chains."""
    found = brownian(material, device, step=step, settle=4.0, apart=0.2)
    expected = monte_carlo(material, settle=200, apart=15)
    mean = expected.mean(axis=0)
    error = np.sqrt((found.var(axis=0, ddof=1) + expected.var(axis=0, ddof=1)) / WORLDS)
    # the spread of eight worlds is known to a quarter: it is never less than that of independent counts
    error = np.maximum(error, np.sqrt(np.maximum(mean, 1.0 / FRAMES) / (FRAMES * WORLDS)))
    shell = 4.0 / 3.0 * np.pi * np.diff(EDGES**3) * COUNT * (COUNT - 1) / 2.0 / LENGTH**3
    expect_law(f"g(r) of {name} spheres", found.mean(axis=0) / shell, mean / shell, error / shell)
    assert (mean / shell)[EDGES[:-1] < 2.3].max() > 1.3, "the crowd has no structure to compare"
