"""How long a bead stays in a trap that ends: mean first-passage time out of a harmonic well of 3 to 6 k_B T.

The closed double integral for a radially symmetric well (Gardiner 2009, Stochastic Methods, §5.5; Kramers 1940,
doi:10.1016/S0031-8914(40)90098-2) is exact at any depth. Inside the well every integrator's chain is a sampled
Ornstein–Uhlenbeck process, of slightly other rate and width; the integral is taken for those, so that what is left is
what the detection of escapes does between the steps.
"""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.reference.fokker_planck import ball, mean_first_passage
from tests.simulation.setups import ENERGY, STIFFNESS, drag, harmonic, sphere_body
from tests.validation import scheme
from tests.validation.laws import across_worlds

RATE = STIFFNESS / drag(1.0)
OVERSHOOT = 0.5826
"""−ζ(1/2)/√(2π): seen at times dt apart, a boundary lies this many standard deviations of a step further out
(Broadie, Glasserman & Kou 1997, doi:10.1111/1467-9965.00035)."""

ACCURACY = 0.01
"""Wanted of escape times; what the flat boundary and the ends of the force leave is less."""


def well(depth: float, settings: Settings) -> Scene:
    """A bead in a trap that ends where the potential is `depth` k_B T."""
    return Scene(bodies=(sphere_body("Bead"),), traps=(harmonic("Trap", cutoff=rim(depth)),), settings=settings)


def rim(depth: float) -> float:
    return float(np.sqrt(2.0 * depth * ENERGY / STIFFNESS))


def sampled_process(h: float) -> tuple[float, float]:
    """(rate [1/s] · γ/k, variance · k/k_B T) of the process that the default integrator's chain samples."""
    a, _, c = scheme.CHAINS[scheme.DEFAULT](h)
    assert c == 0.0, "with noise of two steps the chain is no sampled Ornstein–Uhlenbeck process"
    return -np.log(a) / h, scheme.variance(scheme.DEFAULT, h)


def escape_time(depth: float, h: float, *, further: float = 0.0) -> float:
    """Mean time from the centre to the rim, or `further` out [s].

    The force of a step is that at its start, inside: between two steps the well goes on beyond the rim.
    """
    rate, variance = sampled_process(h)
    energy = ENERGY * variance
    return mean_first_passage(
        lambda r: 0.5 * STIFFNESS * r**2,
        rim(depth) + further,
        diffusion=RATE * rate * energy / STIFFNESS,
        energy=energy,
    )


def test_the_double_integral_for_a_flat_well():
    """Without a force the sphere is left after R²/6D."""
    assert mean_first_passage(np.zeros_like, 2.0, diffusion=0.3, energy=1.0) == pytest.approx(4.0 / 1.8, rel=1e-6)


def test_two_solutions_agree():
    """Finite volumes in a ball against the double integral."""
    radius = rim(4.0)
    grid = ball(
        lambda r, mu: 0.5 * STIFFNESS * r**2, radius, shells=200, sectors=4, diffusion=ENERGY / drag(1.0), energy=ENERGY
    )
    exact = mean_first_passage(lambda r: 0.5 * STIFFNESS * r**2, radius, diffusion=ENERGY / drag(1.0), energy=ENERGY)
    assert grid.exit_time()[0] == pytest.approx(exact, rel=1e-3)


def first_escapes(sim: Simulation, longest: float) -> np.ndarray:
    """(W,) times at which the trap lost its bead [s], the middle of the step in which it did."""
    steps = np.full(sim.model.worlds, -1.0)
    while sim.time < longest and np.any(steps < 0):
        sim.step(500)
        steps = sim.readout.escape_step.numpy()[:, 0].astype(float)
    assert np.all(steps >= 0), "all beads escape within the longest time"
    return (steps - 0.5) * sim.time_step


def check_escapes(expect_law, device: str, depth: float, worlds: int, settings: Settings) -> None:
    sim = Simulation(well(depth, settings), worlds=worlds, seed=81, device=device)
    h = RATE * sim.time_step
    expected = escape_time(depth, h)
    mean, error = across_worlds(first_escapes(sim, 40.0 * expected))
    plain = mean_first_passage(
        lambda r: 0.5 * STIFFNESS * r**2, rim(depth), diffusion=ENERGY / drag(1.0), energy=ENERGY
    )
    expect_law(
        f"mean escape time from {depth:g} k_B T at h = {h:.3g}, over the law",
        mean / plain,
        1.0,
        error / plain,
        bias=ACCURACY,
    )


def test_mean_escape_time(expect_law, device):
    """T = (1/D)∫dr r⁻² e^(U/k_BT) ∫ds s² e^(−U/k_BT) from the centre to the end of the trap, with the chosen step.

    Source: Kramers 1940, doi:10.1016/S0031-8914(40)90098-2; Gardiner 2009, Stochastic Methods.
    """
    check_escapes(expect_law, device, 3.0, 3000, Settings(accuracy=ACCURACY))


@pytest.mark.validate
@pytest.mark.parametrize("depth", [3.0, 4.5, 6.0])
def test_mean_escape_time_precisely(expect_law, device, depth):
    """T = (1/D)∫dr r⁻² e^(U/k_BT) ∫ds s² e^(−U/k_BT) from the centre to the end of the trap, with the chosen step.

    Source: Kramers 1940, doi:10.1016/S0031-8914(40)90098-2; Gardiner 2009, Stochastic Methods.
    """
    check_escapes(
        expect_law, device, depth, {3.0: 60_000, 4.5: 30_000, 6.0: 10_000}[depth], Settings(accuracy=ACCURACY)
    )


def check_monitoring(expect_law, device: str, h: float, worlds: int) -> None:
    depth = 3.0
    sim = Simulation(well(depth, Settings(time_step=h / RATE)), worlds=worlds, seed=82, device=device)
    rate, variance = sampled_process(h)
    step = np.sqrt(2.0 * RATE * rate * ENERGY * variance / STIFFNESS * sim.time_step)
    late, plain = escape_time(depth, h, further=OVERSHOOT * step), escape_time(depth, h)
    seen = np.full(worlds, -1)
    # the force ends with the trap: whatever comes after the first step outside does not matter
    while np.any(seen < 0):
        sim.step()
        x = sim.state.position.numpy()[:, 0]
        seen[(seen < 0) & ((x**2).sum(axis=1) > rim(depth) ** 2)] = sim.state.step
    mean, error = across_worlds(seen * sim.time_step)
    assert late / plain - 1.0 > 8.0 * error / plain, "the lateness must be seen"
    # the curvature of the rim is the next order, a fraction of h; so is a second stage that feels no force outside
    expect_law(
        f"mean time seen outside at steps of h = {h:g}, over the law",
        mean / plain,
        late / plain,
        error / plain,
        bias=0.5 * h,
    )


@pytest.mark.validate
@pytest.mark.parametrize("h", [0.09, 0.0225])
def test_watching_at_steps_alone_is_late(expect_law, device, h):
    """Escapes seen at the ends of steps are late as if the rim were 0.5826 √(2D dt) further out: order 1/2.

    Source: Broadie, Glasserman & Kou 1997, doi:10.1111/1467-9965.00035.
    """
    check_monitoring(expect_law, device, h, 20_000)


def test_the_lateness_is_what_the_correction_is_for(device):
    """Half as late for a quarter of the step, and 10 % at the step that 1 % of variance asks for."""
    steps = np.array([0.08, 0.02])
    late = [
        escape_time(3.0, h, further=OVERSHOOT * np.sqrt(2.0 * h * ENERGY / STIFFNESS)) / escape_time(3.0, h) - 1.0
        for h in steps
    ]
    assert late[0] / late[1] == pytest.approx(2.0, rel=0.15)
    assert late[1] > 0.08
