"""Crowds whose contacts are soft: explicit forces in one kernel, over slots that are sorted now and then."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.errors import SimulationError
from otwarp.kernels.drivers.grid import soft
from otwarp.scene import Scene
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation
from tests.reference.contact import sphere_obstacle
from tests.simulation.crowds import SOFT, crowd, jumbled, places
from tests.simulation.setups import drag, harmonic, line, neutral, obstacle

HOT = 298.15

ROUNDING = 3e-6
"""Of a displacement computed from coordinates of 10 µm in float32 [µm]."""


def packed(**more) -> Scene:
    """Sixty spheres of two sizes that overlap here and there, above a floor that some touch."""
    where = jumbled(60) + np.array([0.0, 0.0, 4.5])
    radii = np.where(np.arange(60) % 3 == 0, 0.9, 1.0)
    return crowd(where, radii, obstacles=(obstacle("Floor", "plane", (0, 0, 0)),), time_step=8e-4, **more)


def soft_simulation(scene: Scene, **more) -> Simulation:
    """A simulation that takes contact forces explicitly."""
    sim = Simulation(scene, **{"integrator": "eulerMaruyama", "allow_large_step": True, **more})
    assert sim.model.features.soft_contacts
    return sim


def bits(sim: Simulation, worlds: int | None = None) -> dict[str, bytes]:
    """Every array of the state and the readout, of the first `worlds` worlds."""
    arrays = {k: v for g in (sim.state, sim.readout) for k, v in vars(g).items() if isinstance(v, wp.array)}
    return {k: v.numpy()[:worlds].tobytes() for k, v in arrays.items() if k != "fault_count"}


@pytest.fixture(params=[True, False], ids=["soft", "swept"])
def make(request, monkeypatch, device):
    """Builds hot crowds that make new lists every few steps, by both forms of the grid driver."""
    if not request.param:
        monkeypatch.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", 0.0)

    def build(worlds: int = 3, seed: int = 5) -> Simulation:
        sim = Simulation(packed(temperature=HOT), worlds=worlds, seed=seed, device=device)
        assert sim.model.features.soft_contacts == request.param
        return sim

    return build


def test_neither_grouping_nor_other_worlds_change_a_bit(make):
    """New lists and sorted slots come at other times in each of these runs."""
    whole, parts, alone, single = make(), make(), make(worlds=1), make()
    whole.step(60)
    for n in (1, 2, 17, 40):
        parts.step(n)
    alone.step(60)
    for _ in range(60):
        single.step()
    assert isinstance(whole._stepper, GridStepper | BlockStepper | GridPhasesStepper)
    assert whole._stepper.scratch.near.builds.numpy()[0] >= 2
    assert bits(parts) == bits(whole) == bits(single)
    assert bits(whole, worlds=1) == bits(alone)
    other = make(seed=6)
    other.step(60)
    assert not np.any(places(other) == places(whole))


def test_a_run_continues_from_its_state(make):
    """State alone: lists and slots of a new simulation are others, the bits are not."""
    whole, first, second = make(), make(), make()
    whole.step(50)
    first.step(23)
    second.set_state(position=first.state.position.numpy())
    second.state.step = 23
    second.step(27)
    assert bits(second)["position"] == bits(whole)["position"]


@pytest.mark.cpu_forms
@pytest.mark.parametrize("floor", [True, False], ids=["above a floor", "alone"])
@pytest.mark.parametrize("gravity", [True, False], ids=["heavy", "neutral"])
def test_blocks_of_moves_have_the_bits_of_single_ones(gravity, floor, device, monkeypatch):
    """Of two sizes in no order, so that some blocks are of one and others of both; a tail fills no block."""
    where = jumbled(150) + np.array([0.0, 0.0, 6.6])
    radii = np.where(np.arange(150) < 50, 0.9, 1.0)
    obstacles = (obstacle("Floor", "plane", (0, 0, 0)),) if floor else ()
    scene = crowd(where, radii, obstacles=obstacles, time_step=8e-4, temperature=HOT)
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, gravity=gravity))
    found = []
    for blocks in (True, False):
        if not blocks:
            monkeypatch.setattr("otwarp.kernels.drivers.grid.soft.moves_in_blocks", lambda f: False)
        sim = soft_simulation(scene, worlds=2, seed=4, device=device)
        assert soft.moves_in_blocks(sim.model.features) == blocks
        sim.step(40)
        found.append(bits(sim))
    assert found[0] == found[1]


def test_third_law(device):
    """No floor: whatever the crowd does to itself, it does not push itself away."""
    sim = soft_simulation(crowd(jumbled(80), temperature=HOT), device=device, seed=3)
    for _ in range(20):
        sim.step(5)
        net = sim.readout.contact_force.numpy()[0].astype(float)
        assert np.abs(net).max() > 0.01
        assert np.abs(net.sum(axis=0)).max() < 1e-6 * np.abs(net).sum()


@pytest.mark.parametrize("stiffness", [0.5, 1.0])
def test_explicit_and_implicit_steps_err_by_half_a_rate_to_either_side(stiffness, device, monkeypatch):
    """Two spheres part for a time t; the gap that a step of h = k·give leaves off is h/2 of the decay, of either sign.

    The exact course is that of a step sixty-four times shorter, extrapolated.
    """
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    step = 4e-3 * stiffness

    def overlap_after(time_step: float, explicit: bool) -> float:
        monkeypatch.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", np.inf if explicit else 0.0)
        start = np.array([[0.0, 0.0, 0.0], [1.8, 0.0, 0.0]])
        sim = Simulation(crowd(start, time_step=time_step), device=device)
        assert sim.model.features.soft_contacts == explicit
        sim.run(8 * step)
        where = places(sim)[0]
        return 2.0 - float(np.linalg.norm(where[0] - where[1]))

    exact = 0.5 * (overlap_after(step / 64, True) + overlap_after(step / 64, False))
    explicit, implicit = overlap_after(step, True) - exact, overlap_after(step, False) - exact
    assert explicit < 0.0 < implicit
    assert -explicit == pytest.approx(implicit, rel=0.15)
    halved = overlap_after(0.5 * step, True) - exact
    assert halved == pytest.approx(0.5 * explicit, rel=0.1)


def test_the_bound_keeps_the_densest_packing_stable(device, monkeypatch):
    """A close-packed cluster compressed to the deepest overlap, at the longest step that counts as soft: it comes to

    rest, its overlaps shrinking from step to step, and no sphere is thrown.
    """
    lattice = np.array([(i, j, k) for i in range(-2, 3) for j in range(-2, 3) for k in range(-2, 3)])
    chosen = lattice[lattice.sum(axis=1) % 2 == 0]
    where = chosen * (1.55 / np.sqrt(2.0))
    step = 1.69e-3
    with monkeypatch.context() as longer:
        longer.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", np.inf)
        soft_simulation(crowd(where, time_step=step), device=device)
    assert soft_simulation(crowd(where, time_step=step), device=device)
    assert not Simulation(crowd(where, time_step=1.2 * step), device=device).model.features.soft_contacts
    rng = np.random.default_rng(0)
    sim = soft_simulation(crowd(where + rng.normal(0.0, 0.01, where.shape), time_step=step), device=device)
    loads, speeds = [], []
    for _ in range(60):
        before = places(sim)
        sim.step()
        loads.append(float(sim.readout.contact_load.numpy().max()))
        speeds.append(float(np.linalg.norm(places(sim) - before, axis=2).max()))
    assert np.all(np.diff(loads) < 1e-3 * loads[0])
    assert np.all(np.diff(speeds[5:]) < 0.02 * speeds[0])


@pytest.mark.parametrize("change", ["stiff", "rigid", "few"])
def test_what_is_not_soft_is_swept(change, device):
    """Stiff surfaces, rotation, or few bodies, of which one thread takes care."""
    scene = crowd(jumbled(30))
    if change == "stiff":
        stiff = tuple(
            dataclasses.replace(b, material=dataclasses.replace(SOFT, youngs_modulus=1e3)) for b in scene.bodies
        )
        scene = dataclasses.replace(scene, bodies=stiff)
    elif change == "rigid":
        first = scene.bodies[0]
        pair = dataclasses.replace(
            first, spheres=(*first.spheres, dataclasses.replace(first.spheres[0], prim="/World/X", offset=(0, 0, 1.0)))
        )
        scene = dataclasses.replace(scene, bodies=(pair, *scene.bodies[1:]))
    else:
        scene = dataclasses.replace(scene, bodies=scene.bodies[:4])
    assert not Model.build(scene, device=device).features.soft_contacts


def test_traps_hold_and_lose_their_sphere_wherever_its_slot_is(device):
    """A trap drags body 0 out of the crowd; when it turns away faster than the drag allows, that escape is its own."""
    path = line((0.0, (40.0, 0, 0)), (0.2, (44.0, 0, 0)), (0.21, (90.0, 0, 0)))
    where = np.concatenate([[[40.0, 0.0, 0.0]], jumbled(40)])
    traps = (harmonic("T", path, cutoff=1.0, power=20.0),)
    sim = soft_simulation(crowd(where, traps=traps, trapped=1, time_step=2e-4), device=device)
    sim.run(0.2)
    assert sim.readout.escape_step.numpy()[0, 0] == -1
    lag = drag(1.0) * 20.0 / 20.0
    np.testing.assert_allclose(places(sim)[0, 0], [44.0 - lag, 0.0, 0.0], atol=2e-3)
    sim.run(0.05)
    assert 1000 < sim.readout.escape_step.numpy()[0, 0] < 1060
    assert places(sim)[0, 0, 0] < 47.0


def test_a_moving_wall_pushes(device):
    """A box advances at 40 µm/s; the sphere that it meets rides ahead of its face, pressed by its drag."""
    speed, half = 40.0, 2.0
    box = obstacle("Box", "box", line((0.0, (-6.0, 0, 0)), (10.0, (speed * 10 - 6.0, 0, 0))), (half, 3.0, 3.0))
    where = np.concatenate([[[-2.0, 0.0, 0.0]], jumbled(30) + np.array([0.0, 40.0, 0.0])])
    sim = soft_simulation(crowd(where, obstacles=(box,)), device=device)
    sim.run(0.3)
    push = drag(1.0) * speed
    overlap = 1.0 - (places(sim)[0, 0, 0] - (speed * sim.time - 6.0 + half))
    assert sphere_obstacle(SOFT, 1.0, 1.0 - overlap)[0] == pytest.approx(push, rel=0.1)
    np.testing.assert_allclose(sim.readout.contact_force.numpy()[0, 0], [push, 0, 0], rtol=0.1, atol=1e-3)


def test_faults_name_the_body_and_spare_the_others(device):
    """Two spheres too deep in each other stop the run; they stay, the rest of the step is taken."""
    where = jumbled(40, 3.0)
    where[31] = where[12] + np.array([1.2, 0.0, 0.0])
    sim = soft_simulation(crowd(where, temperature=HOT), device=device)
    start = places(sim)
    with pytest.raises(SimulationError, match=r"overlap by more than half the smaller radius.*body /World/B12, step 0"):
        sim.step(3)
    stayed = np.all(places(sim) == start, axis=2)[0]
    assert set(np.flatnonzero(stayed)) == {12, 31}


def test_what_does_not_collide_passes_through(device):
    """It keeps its slot, and its noise."""
    scene = crowd(jumbled(40, 4.0, jitter=0.0), temperature=HOT)
    ghost = dataclasses.replace(
        scene.bodies[5], spheres=(dataclasses.replace(scene.bodies[5].spheres[0], collides=False),)
    )
    bodies = (*scene.bodies[:5], dataclasses.replace(ghost, position=scene.bodies[6].position), *scene.bodies[6:])
    sim = soft_simulation(dataclasses.replace(scene, bodies=bodies), device=device)
    sim.step(5)
    np.testing.assert_array_equal(sim.readout.contact_load.numpy()[0, [5, 6]], 0.0)
    moved = places(sim)[0] - np.array([b.position for b in bodies])
    assert np.all(np.abs(moved[[5, 6]]).max(axis=1) > 0.0)
    assert not np.any(moved[5] == moved[6])


def test_a_swept_crowd_agrees_with_the_world_driver(device, monkeypatch):
    """Stiff beads pushed together by noise: the same contacts and nearly the same loads, whoever solves for them."""
    rng = np.random.default_rng(4)
    where = jumbled(20, 2.02, jitter=0.04) + rng.normal(0.0, 0.01, (20, 3))
    beads = tuple(neutral(f"B{i}", tuple(p)) for i, p in enumerate(where))
    base = crowd(where, temperature=HOT, time_step=1e-3)
    scene = dataclasses.replace(base, bodies=beads)
    world = Simulation(scene, device=device, seed=2, integrator="eulerMaruyama")
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    grid = Simulation(scene, device=device, seed=2, integrator="eulerMaruyama")
    assert (world.model.features.driver, grid.model.features.driver) == ("world", "grid")
    for sim in (world, grid):
        sim.step()
    loads = [sim.readout.contact_load.numpy()[0] for sim in (world, grid)]
    assert (loads[0] > 0.0).sum() > 5
    # sweeps stop at 1e-6 µm of gap, the law is followed to 1e-4 of the radius by the world driver
    np.testing.assert_allclose(places(grid), places(world), rtol=0, atol=3e-4)
    np.testing.assert_allclose(loads[1], loads[0], rtol=0.05, atol=0.02 * loads[0].max())
