"""Hard polymer at ordinary steps: exact loads, no jitter, nothing thrown, no more energy than before."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq

from otwarp.scene import Body, Material, Medium, Rod, Scene, Settings, Sphere
from otwarp.simulation.packing.bodies import weight
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN
from tests.reference.contact import sphere_obstacle, sphere_pair
from tests.simulation.setups import VISCOSITY, contact_scene, drag, harmonic, neutral, obstacle, robot

IP_L = Material(youngs_modulus=3e9, poisson_ratio=0.4)
"""The stiffest two-photon polymer that robots are printed of."""

SPACING = 4.8e-7
"""Of float32 coordinates between 4 and 8 µm [µm]."""


def quiet(scene: Scene, **settings) -> Scene:
    """The scene without noise."""
    return dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, brownian=False, **settings))


@pytest.mark.parametrize("time_step", [2e-5, 2e-4, 2e-3])
@pytest.mark.parametrize("modulus", [1e2, 1e6, 3e9])
def test_a_pressed_bead_lies_still_at_the_hertz_overlap(modulus, time_step, device):
    """A trap of 2 pN/µm presses with 10 pN: where it comes to rest the load is the trap's, and nothing moves at all."""
    material = Material(youngs_modulus=modulus, poisson_ratio=0.4)
    pull, stiffness = 10.0, 2.0
    first, second = neutral("A", (0.0, 0.0, 1.0), material=material), neutral("B", (30.0, 0.0, 8.0))
    power = 20.0 * stiffness / 20.0
    traps = (
        harmonic("TA", (0.0, 0.0, 1.0 - pull / stiffness), power=power, cutoff=9.0),
        harmonic("TB", (30, 0, 8), power=0.0),
    )
    sim = Simulation(quiet(contact_scene(first, second, traps=traps, time_step=time_step)), device=device)
    sim.run(0.15)
    heights, loads = [], []
    for _ in range(60):
        sim.step()
        heights.append(float(sim.state.position.numpy()[0, 0, 2]))
        loads.append(float(sim.readout.contact_load.numpy()[0, 0]))
    overlap = brentq(
        lambda d: sphere_obstacle(material, 1.0, 1.0 - d)[0] - (pull - stiffness * d), 0.0, 0.4, xtol=1e-12
    )
    assert 1.0 - heights[-1] == pytest.approx(overlap, rel=1e-3, abs=2 * SPACING)
    np.testing.assert_allclose(loads, pull - stiffness * overlap, rtol=2e-4)
    assert np.ptp(heights) <= SPACING


def test_noise_presses_no_bead_into_hard_polymer(device):
    """With noise the overlap stays what a load of the size of the thermal kicks, √(2 k_B T γ/dt), makes of it."""
    first, second = neutral("A", (0.0, 0.0, 1.0), material=IP_L), neutral("B", (30.0, 0.0, 8.0))
    traps = (harmonic("TA", (0.0, 0.0, -1.0), cutoff=9.0), harmonic("TB", (30, 0, 8), power=0.0))
    sim = Simulation(contact_scene(first, second, traps=traps, temperature=298.15), seed=5, device=device)
    kick = np.sqrt(2.0 * BOLTZMANN * 298.15 * drag(1.0) / sim.time_step)
    deepest, loads = 0.0, []
    for _ in range(500):
        sim.step()
        deepest = max(deepest, 1.0 - float(sim.state.position.numpy()[0, 0, 2]))
        loads.append(float(sim.readout.contact_load.numpy()[0, 0]))
    largest = brentq(lambda d: sphere_obstacle(IP_L, 1.0, 1.0 - d)[0] - 40.0 - 6.0 * kick, 0.0, 0.1, xtol=1e-12)
    assert deepest < largest + 2 * SPACING
    # the mean load is the trap's; its standard error is that of the kicks, whose sum is bounded by the position
    assert np.mean(loads[100:]) == pytest.approx(40.0, abs=5.0 * kick / np.sqrt(400))


@pytest.mark.parametrize("modulus", [1e3, 3e9, 1e12])
@pytest.mark.parametrize("time_step", [1e-4, 1 / 60])
def test_a_robot_of_nine_collinear_spheres_lies_flat(modulus, time_step, device):
    """More contacts than it has ways to move: the loads carry it together, and no share of them is thrown."""
    row = tuple(((2.1 * i, 0.0, 0.0), 1.0) for i in range(-4, 5))
    body = dataclasses.replace(
        robot("A", (0.0, 0.0, 1.01), shape=row, collides=True),
        density=3000e-12,
        material=Material(youngs_modulus=modulus, poisson_ratio=0.4),
    )
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(body,),
        obstacles=(obstacle("Floor", "plane", (0.0, 0.0, 0.0)),),
        settings=Settings(gravity=True, brownian=False, time_step=time_step),
    )
    sim = Simulation(scene, device=device)
    sim.run(0.4)
    carried = weight(scene, body)
    overlap = brentq(lambda d: 9 * sphere_obstacle(body.material, 1.0, 1.0 - d)[0] - carried, 0.0, 0.1, xtol=1e-13)
    # nine float32 gaps, and 10⁻⁴ of the fall in one step where the floor is rigid
    fall = carried * time_step / (9 * drag(1.0)) * 4
    height = float(sim.state.position.numpy()[0, 0, 2])
    assert 1.0 - height == pytest.approx(overlap, rel=0.02, abs=4 * SPACING + 1e-3 * fall)
    assert sim.readout.contact_force.numpy()[0, 0] == pytest.approx([0.0, 0.0, carried], rel=2e-3, abs=1e-4)
    assert sim.readout.contact_load.numpy()[0, 0] == pytest.approx(carried, rel=0.05)


def energy(bodies: tuple[Body, ...], place: np.ndarray, modulus: float) -> float:
    """Hertz energy 8/15 E*√R δ^{5/2} of all pairs of single spheres [pN·µm]."""
    total = 0.0
    for i, a in enumerate(bodies):
        for j, b in enumerate(bodies[:i]):
            ra, rb = a.spheres[0].radius, b.spheres[0].radius
            overlap = max(ra + rb - float(np.linalg.norm(place[i] - place[j])), 0.0)
            total += 8.0 / 15.0 * modulus * np.sqrt(ra * rb / (ra + rb)) * overlap**2.5
    return total


@pytest.mark.parametrize("modulus", [1e3, 1e6, 3e9])
@pytest.mark.parametrize("time_step", [1e-5, 1e-3])
def test_overlapping_beads_part_without_gaining_energy(modulus, time_step, device):
    """Ten beads that start 1–9 % inside each other, no other force: the elastic energy falls in every step."""
    rng = np.random.default_rng(7)
    material = Material(youngs_modulus=modulus, poisson_ratio=0.4)
    grid = [(i % 3, i // 3 % 2, i // 6) for i in range(10)]
    places = 1.92 * np.array(grid, dtype=float) + rng.uniform(-0.03, 0.03, (10, 3)) + [0.0, 0.0, 20.0]
    bodies = tuple(neutral(f"B{i}", tuple(p), material=material, trapped=False) for i, p in enumerate(places))
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY), bodies=bodies, settings=Settings(brownian=False, time_step=time_step)
    )
    sim = Simulation(scene, device=device)
    effective = modulus / (1.0 - 0.4**2) / 2.0
    last = first = energy(bodies, places, effective)
    assert first > 0.0
    # rounding of the overlaps at 20 µm (2e-6) leaves this much in 20 contacts
    least = 20 * 8.0 / 15.0 * effective * np.sqrt(0.5) * (4e-6) ** 2.5
    middle = places.mean(axis=0)
    for _ in range(40):
        sim.step()
        place = sim.state.position.numpy()[0].astype(float)
        now = energy(bodies, place, effective)
        assert now < last + least
        last = now
        np.testing.assert_allclose(place.mean(axis=0), middle, atol=1e-5)  # equal beads: the third law
    assert np.ptp(place, axis=0).max() < 3 * 1.92 + 1.0
    if modulus * time_step > 1.0:
        # one rigid step parts all pairs, as far as their directions turn in it
        assert last < 0.05 * first


@pytest.mark.parametrize("noise", [False, True], ids=["without noise", "1e-9 K"])
def test_the_pull_off_force_of_hard_polymer(noise, device):
    """A sticky bead of 3 GPa on a glass floor: 0.9 of 2πRW does not lift it, 1.1 does; nor does noise that is none."""
    sticky = dataclasses.replace(IP_L, adhesion=1.0, adhesion_range=0.01)
    pull_off = 2.0 * np.pi * 1.0
    for share in (0.9, 1.1):
        first, second = neutral("A", (0.0, 0.0, 1.0), material=sticky), neutral("B", (30.0, 0.0, 8.0))
        stiffness = 20.0
        place = (0.0, 0.0, 1.0 + share * pull_off / stiffness)
        traps = (harmonic("TA", place, cutoff=9.0), harmonic("TB", (30, 0, 8), power=0.0))
        scene = contact_scene(first, second, traps=traps, time_step=1e-4)
        sim = Simulation(scene if noise else quiet(scene), device=device)
        sim.run(0.2)
        height = float(sim.state.position.numpy()[0, 0, 2])
        force = sim.readout.contact_force.numpy()[0, 0, 2]
        if share < 1.0:
            assert height == pytest.approx(1.0, abs=1e-5)
            assert force == pytest.approx(-share * pull_off, rel=1e-3)
        else:
            assert height == pytest.approx(1.0 + share * pull_off / stiffness, rel=1e-3)
            assert force == 0.0


def test_impact_of_two_beads_is_seen_in_the_same_step(device):
    """One step from a gap to what backward Euler asks for: δ + give·F(δ) = reach, for soft and for hard cells."""
    for modulus in (1e2, 1e4, 3e9):
        material = Material(youngs_modulus=modulus, poisson_ratio=0.45)
        gap, pull, dt = 0.02, 8.0, 2e-4
        beads = (neutral("A", (-1.0 - gap / 2, 0.0, 9.0), material=material),
                 neutral("B", (1.0 + gap / 2, 0.0, 9.0), material=material))  # fmt: skip
        traps = (harmonic("TA", (-1.0 - gap / 2 + pull / 20.0, 0, 9), cutoff=1.0),
                 harmonic("TB", (1.0 + gap / 2 - pull / 20.0, 0, 9), cutoff=1.0))  # fmt: skip
        scene = contact_scene(*beads, traps=traps, time_step=dt)
        # one stage: a second one weighs the trap where the bead arrives
        sim = Simulation(quiet(scene, integrator="eulerMaruyama"), device=device, allow_large_step=True)
        sim.step()
        place = sim.state.position.numpy()[0].astype(float)
        overlap = 2.0 - float(np.linalg.norm(place[0] - place[1]))
        give = 2.0 * dt / drag(1.0)
        reach = give * pull - gap
        expected = brentq(
            lambda d, m=material, g=give, r=reach: d + g * sphere_pair(m, 1.0, m, 1.0, 2.0 - d)[0] - r, 0.0, reach,
            xtol=1e-13,
        )  # fmt: skip
        assert reach > 0.05
        assert overlap == pytest.approx(expected, rel=1e-4, abs=2e-6)


def test_a_rod_carries_its_weight_on_both_ends(device):
    """A robot that touches by its rod alone rests on the floor: Hertz's overlap of half the weight at each end; the
    height is the same at steps of 1 ms and of a frame."""
    material = Material(youngs_modulus=100.0, poisson_ratio=0.3)
    ends = tuple(Sphere(prim=f"/World/A/S{i}", offset=(x, 0.0, 0.0), radius=0.5, collides=False)
                 for i, x in enumerate((-3.0, 3.0)))  # fmt: skip
    rod = Rod(prim="/World/A/Rod", start=(-4.0, 0.0, 0.0), end=(4.0, 0.0, 0.0), radius=0.6)
    body = Body(prim="/World/A", position=(0.3, -0.2, 0.7), spheres=ends, rods=(rod,), density=6000e-12,
                material=material)  # fmt: skip
    for time_step in (1e-3, 1 / 60):
        scene = Scene(
            medium=Medium(viscosity=VISCOSITY),
            bodies=(body,),
            obstacles=(obstacle("Floor", "plane", (0.0, 0.0, 0.0)),),
            settings=Settings(gravity=True, brownian=False, time_step=time_step),
        )
        sim = Simulation(scene, device=device)
        sim.run(2.0)
        carried = weight(scene, body)
        modulus = 100.0 / (1.0 - 0.3**2)
        each = 0.5 * carried
        overlap = (0.75 * each / modulus / np.sqrt(0.6)) ** (2.0 / 3.0)
        assert 0.6 - float(sim.state.position.numpy()[0, 0, 2]) == pytest.approx(overlap, rel=2e-3)
        assert sim.readout.contact_load.numpy()[0, 0] == pytest.approx(carried, rel=1e-3)
        # level, and turned about nothing
        np.testing.assert_allclose(sim.state.orientation.numpy()[0, 0], [0.0, 0.0, 0.0, 1.0], atol=1e-5)
