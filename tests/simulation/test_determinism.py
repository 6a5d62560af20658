"""Bit for bit: results do not depend on threads, the grouping of steps into calls, or other worlds."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import CELL, bead_scene, contact_scene, harmonic, neutral

STEPS = 600


def touching_scene() -> Scene:
    """Two cells that noise and two traps keep pressing together, above a floor that one of them touches."""
    traps = (harmonic("TA", (-1.6, 0, 2.0)), harmonic("TB", (1.6, 0, 2.1)))
    first = neutral("A", (-1.7, 0.1, 2.0), radius=2.0, material=CELL, kind="cell")
    second = neutral("B", (1.7, -0.1, 2.0), radius=1.5, material=CELL, kind="cell")
    # each trap reaches its own cell only
    traps = tuple(dataclasses.replace(t, radial=dataclasses.replace(t.radial, cutoff=1.5)) for t in traps)
    return contact_scene(first, second, traps=traps, temperature=298.15)


def crowd_scene() -> Scene:
    """Thirty cells heaped on the floor, each touching several: too many bodies for the world driver."""
    pair = touching_scene()
    rng = np.random.default_rng(0)
    places = [(1.9 * i, 1.9 * j, 0.95 + 1.9 * k) for k in range(2) for i in range(5) for j in range(3)]
    cells = tuple(
        neutral(f"C{n}", tuple(np.array(p) + rng.normal(size=3) * 0.03), material=CELL, trapped=False)
        for n, p in enumerate(places)
    )
    held = tuple(dataclasses.replace(c, spheres=(dataclasses.replace(c.spheres[0], trapped=True),)) for c in cells[:2])
    return dataclasses.replace(pair, bodies=(*held, *cells[2:]))


@pytest.fixture(params=["solo", *(pytest.param(d, marks=pytest.mark.thorough) for d in ("world", "grid", "crowd"))])
def make(request, monkeypatch, device):
    """Builds a simulation of the driver under test."""
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    scene = {"solo": bead_scene, "crowd": crowd_scene}.get(request.param, touching_scene)()
    driver = "grid" if request.param == "crowd" else request.param

    def build(worlds: int = 8, **more) -> Simulation:
        sim = Simulation(scene, worlds=worlds, seed=31, device=device, **more)
        assert sim.model.features.driver == driver
        return sim

    return build


def bits(sim: Simulation, worlds: int | None = None) -> dict[str, np.ndarray]:
    """Every array of the state and the readout, of the first `worlds` worlds, as bytes-comparable numbers."""
    out = {}
    for group in (sim.state, sim.readout):
        for name, value in vars(group).items():
            if isinstance(value, wp.array) and name != "fault_count":
                out[name] = value.numpy()[:worlds]
    return out


def check_equal(a: Simulation, b: Simulation, worlds: int | None = None) -> None:
    left, right = bits(a, worlds), bits(b, worlds)
    assert left.keys() == right.keys()
    for name, value in left.items():
        assert value.tobytes() == right[name].tobytes(), name


@pytest.mark.thorough
def test_threads_change_nothing(make):
    sims = [make(threads=n) for n in (1, 2, 3)]
    for sim in sims:
        sim.step(STEPS)
    check_equal(sims[0], sims[1])
    check_equal(sims[0], sims[2])


def test_grouping_of_steps_changes_nothing(make):
    whole, parts = make(), make()
    whole.step(STEPS)
    for n in (1, 99, 500):
        parts.step(n)
    assert parts.state.step == whole.state.step == STEPS
    assert parts.time == whole.time == pytest.approx(STEPS * whole.time_step)
    check_equal(whole, parts)


def test_a_world_does_not_notice_the_others(make):
    few, many = make(8), make(64)
    few.step(STEPS)
    many.step(STEPS)
    check_equal(few, many, worlds=8)


def test_two_constructions_are_one(make):
    first, second = make(), make()
    first.step(STEPS)
    second.step(STEPS)
    check_equal(first, second)


def test_worlds_and_seeds_differ(make):
    """The equalities above would hold if nothing moved: worlds must differ, and touch where they can."""
    sim = make()
    sim.step(STEPS)
    x = sim.state.position.numpy()[:, 0]
    assert len(np.unique(x[:, 0])) == len(x)
    if sim.model.features.contacts:
        # free cells of a crowd may all be apart for a moment
        assert np.mean(sim.readout.contact_load.numpy().sum(axis=1) > 0) > 0.5
    other = Simulation(sim.scene, worlds=8, seed=32, device=sim.model.device)
    other.step(STEPS)
    assert not np.any(other.state.position.numpy()[:, 0] == x)
