"""Samples that are finer than the step limit it where a step cannot take in their course."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.laws import TrapLaw
from otwarp.scene import Medium, Scene, Settings, Track, Trap
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.sampling import ASTRAY, astray2, spread2
from tests.simulation.setups import VISCOSITY, harmonic, neutral, obstacle, sphere_body

EVERY = 2e-4
TIMES = np.arange(0.0, 2.0, EVERY)
RADIUS = 0.3
"""Of the circles [µm]."""


def circle(rate: float = 60.0, radius: float = RADIUS) -> Track:
    angle = 2.0 * np.pi * rate * TIMES
    return Track(times=TIMES, values=radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * TIMES], axis=1))


def bent(path: Track, *, power: float = 0.05, **more) -> Trap:
    """A trap whose force bends at 0.6 µm, so weak that the bead relaxes in 0.3 s."""
    law = TrapLaw(stiffness=20.0, threshold=0.6, inverse_square=4.32, cutoff=3.0, power=20.0)
    return dataclasses.replace(harmonic("T", path, power=power, **more), model="piecewise", radial=law)


def scene(trap: Trap, step: float | None = None) -> Scene:
    settings = Settings(brownian=False, time_step=step)
    bead = sphere_body("Bead", (0.9, 0.0, 0.0))
    return Scene(bodies=(bead,), traps=(trap,), medium=Medium(viscosity=VISCOSITY), settings=settings)


@pytest.mark.parametrize("step", [1e-3, 5e-3, 1.0 / 60.0])
def test_spread_of_a_circle_within_a_step(step):
    """R² (1 − sinc²(ωdt/2)), and all of R² where it comes round."""
    path = circle()
    values = np.concatenate([path.values, np.ones((len(TIMES), 1))], axis=1)
    turn = 2.0 * np.pi * 60.0 * step
    exact = RADIUS**2 * (1.0 - (np.sin(0.5 * turn) / (0.5 * turn)) ** 2)
    assert spread2((path.times, values), step) == pytest.approx(exact, rel=0.02)


def test_a_way_that_is_straight_within_steps_is_not_astray():
    path = circle()
    assert astray2((path.times, path.values), EVERY) < 1e-20
    # largest distance of an arc of angle φ from its chord: R (1 − cos φ/2)
    turn = 2.0 * np.pi * 60.0 * 10 * EVERY
    exact = (RADIUS * (1.0 - np.cos(0.5 * turn))) ** 2
    assert astray2((path.times, path.values), 10 * EVERY) == pytest.approx(exact, rel=0.05)


@pytest.mark.thorough
def test_a_focus_that_leaves_the_straight_part_of_its_law_limits_the_step(device):
    """A bead at the bend of the law; with steps of 1/60 s the force of the mean place was 8 % off, and info says so."""
    found = Model.build(scene(bent(circle())), device="cpu").scales
    assert found.chosen_by == "samples of traps and wanted accuracy"
    assert abs(found.errors["commands"]) <= 0.007
    coarse = Model.build(scene(bent(circle()), 1.0 / 60.0), device="cpu", options=StepOptions(allow_large_step=True))
    assert coarse.scales.errors["commands"] > 0.1
    ways = {}
    for step in (found.time_step, EVERY, 1.0 / 60.0):
        sim = Simulation(scene(bent(circle()), step), device=device, allow_large_step=True)
        sim.step(round(0.1 / step))
        ways[step] = (0.9 - sim.state.position.numpy()[0, 0, 0]) * 0.1 / sim.time
    assert ways[found.time_step] == pytest.approx(ways[EVERY], rel=0.01)
    assert ways[1.0 / 60.0] != pytest.approx(ways[EVERY], rel=0.03)


def test_one_leap_asks_for_nothing():
    """Among the 60 steps of a second one leap of 0.1 µm is 1.5e-4 µm² on average."""
    leap = Track(times=np.array([0.0, 0.5, 0.5001, 2.0]), values=np.array([[0.0] * 3] * 2 + [[0.1, 0, 0]] * 2))
    assert Model.build(scene(bent(leap)), device="cpu").scales.chosen_by != "samples of traps and wanted accuracy"


def test_an_obstacle_that_shakes_limits_the_step():
    """30 nm, 500 times a second: nothing moves by a tenth of a radius in a step, but steps would see nothing of it."""
    shaking = Track(times=TIMES, values=np.stack([0 * TIMES, 0 * TIMES, 0.03 * np.sin(1000 * np.pi * TIMES)], axis=1))
    floor = obstacle("Floor", "plane", shaking)
    cell = neutral("Cell", (0.0, 0.0, 2.0))
    found = Model.build(Scene(bodies=(cell,), obstacles=(floor,), settings=Settings(brownian=False)), device="cpu")
    assert found.scales.chosen_by == "samples of obstacles"
    assert astray2((TIMES, shaking.values), found.time_step) <= (ASTRAY * 1.0) ** 2


def test_a_focus_with_a_speed_limit_follows_its_samples():
    """It heads for where the command is at the end of a step: the step is so short that this is on its way."""
    trap = harmonic("T", circle(radius=0.1), power=0.05, speed_limit=500.0)
    found = Model.build(scene(trap), device="cpu").scales
    assert found.chosen_by == "samples of traps with a speed limit"
    assert found.time_step < 2.5e-3
