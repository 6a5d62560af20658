"""Traps whose samples are finer than the step: beads go where the whole course of the command takes them."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.scene import Medium, Scene, Settings, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import POWER, STIFFNESS, VISCOSITY, drag, harmonic, sphere_body

FINE = 1e-5
"""Interval of the reference, which is exact for the mean of a command over it [s]."""

WAYS = [("heun", "float32"), ("heun", "float64"), ("exponential", "float32")]


def scene(trap: Trap, step: float, integrator: str = "heun") -> Scene:
    settings = Settings(brownian=False, time_step=step, integrator=integrator)
    return Scene(bodies=(sphere_body("Bead"),), traps=(trap,), medium=Medium(viscosity=VISCOSITY), settings=settings)


def circling(rate: float, every: float, power: float) -> Trap:
    """A focus on a circle of 0.5 µm, `rate` times a second, sampled `every` so many seconds."""
    times = np.arange(0.0, 1.2, every)
    angle = 2.0 * np.pi * rate * times
    return harmonic("T", Track(times=times, values=0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * times], axis=1)),
                    power=power)  # fmt: skip


def blinking(rate: float, power: float, *, hops: bool = False) -> Trap:
    """A trap that is on for 40 % of the time; `hops`: then on again, somewhere else, for 20 %."""
    phases = [0.0, 0.4, 0.4001, 0.6, 0.6001, 0.8, 0.8001, 0.9999]
    levels = [1.0, 1.0, 0.0, 0.0, 0.5 * hops, 0.5 * hops, 0.0, 0.0]
    times = np.concatenate([(n + np.array(phases)) / rate for n in range(int(1.2 * rate))])
    powers = Track(times=times, values=power * np.tile(levels, int(1.2 * rate))[:, None])
    places = np.tile([0.3, 0.3, 0.3, 0.3, 0.9, 0.9, 0.9, 0.3], int(1.2 * rate))[:, None] * [1.0, 0.0, 0.0]
    place = Track(times=times, values=places if hops else np.tile([0.3, 0.0, 0.0], (len(times), 1)))
    return harmonic("T", place, power=powers)


def exact(trap: Trap, end: float) -> np.ndarray:
    """(n, 3) places of a bead that starts at the origin, every `FINE` seconds."""
    times = np.arange(0.0, end, FINE) + 0.5 * FINE
    place = np.stack([np.interp(times, trap.position.times, c) for c in trap.position.values.T], axis=1)
    kept = np.exp(-STIFFNESS / POWER / drag(1.0) * np.interp(times, trap.power.times, trap.power.values[:, 0]) * FINE)
    x, out = np.zeros(3), [np.zeros(3)]
    for c, k in zip(place, kept, strict=True):
        x = c + (x - c) * k
        out.append(x)
    return np.array(out)


def largest_error(trap: Trap, step: float, integrator: str, precision: str, device: str) -> tuple[float, float]:
    """Of the bead's places after the steps of one second, and how far it goes [µm]."""
    sim = Simulation(scene(trap, step, integrator), device=device, precision=precision)  # type: ignore[arg-type]
    wanted, worst = exact(trap, 1.0 + step), 0.0
    while sim.time + step < 1.0:
        sim.step(1)
        here = sim.state.position.numpy()[0, 0]
        worst = max(worst, float(np.abs(here - wanted[round(sim.time / FINE)]).max()))
    return worst, float(np.abs(wanted).max())


@pytest.mark.parametrize(("integrator", "precision"), WAYS)
def test_a_trap_that_circles_once_a_step(integrator, precision, device):
    """At k·dt/γ = 0.02 the focus was at the same place whenever a step looked, and drew the bead 0.34 µm off."""
    error, far = largest_error(circling(60.0, 5e-4, 0.02), 1.0 / 60.0, integrator, precision, device)
    assert far == pytest.approx(0.0031, abs=2e-4)
    assert error < 1e-4


@pytest.mark.parametrize(("integrator", "precision"), WAYS)
def test_a_trap_that_circles_in_five_steps(integrator, precision, device):
    """k·dt/γ = 0.12, and 1.26 rad a step."""
    error, far = largest_error(circling(100.0, 5e-4, 1.0), 2e-3, integrator, precision, device)
    assert error < 0.05 * far


@pytest.mark.parametrize("hops", [False, True], ids=["blinks", "hops"])
@pytest.mark.parametrize(("integrator", "precision"), WAYS)
def test_a_trap_that_blinks_once_a_step(integrator, precision, hops, device):
    """On for 0.4 of each step, 0.12 = k·dt/γ while on; it was on always."""
    trap = blinking(60.0, 0.12, hops=hops)
    error, far = largest_error(trap, 1.0 / 60.0, integrator, precision, device)
    assert far > 0.25
    assert error < 0.015 * far


def test_readouts_show_the_command_itself(device):
    """What is recorded of a trap is where it is, not what a step makes of its course."""
    trap = circling(60.0, 5e-4, 0.02)
    sim = Simulation(scene(trap, 7e-3), device=device)
    assert sim.model.features.leaps
    for _ in range(3):
        sim.step(5)
        sim.measure()
        np.testing.assert_allclose(sim.readout.trap_position.numpy()[0, 0], trap.position.at(sim.time), atol=1e-5)


@pytest.mark.quick
def test_commands_on_the_grid_of_steps_are_not_touched(device):
    """Samples at the ends of steps: nothing of the step is made for them."""
    assert not Simulation(scene(circling(4.0, 1e-2, 1.0), 5e-3), device=device).model.features.leaps
