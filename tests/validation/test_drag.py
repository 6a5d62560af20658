"""A bead that a moving trap drags through the liquid: how far it lags behind, and when it is lost.

In the frame of the trap the drag is a constant force, so the potential is U = kr²/2 + γv·x, and the time of escape
from the centre solves the backward Smoluchowski equation in the ball that the trap reaches. It is solved by finite
volumes. What Kramers' theory says of it while the barrier that the drag leaves is high is the expression of Dudko,
Hummer & Szabo 2006, doi:10.1103/PhysRevLett.96.108101, for a well that ends in a cusp.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.reference.fokker_planck import ball
from tests.simulation.setups import ENERGY, STIFFNESS, drag, harmonic, line, sphere_body
from tests.validation.laws import across_worlds
from tests.validation.test_first_passage import first_escapes, rim

GAMMA = drag(1.0)
RATE = STIFFNESS / GAMMA
ACCURACY = 0.01
DEPTH = 8.0
"""Of the trap at rest [k_B T]."""


def dragged(speed: float, seconds: float, cutoff: float, settings: Settings) -> Scene:
    track = line((0.0, (0.0, 0.0, 0.0)), (seconds, (speed * seconds, 0.0, 0.0)))
    return Scene(bodies=(sphere_body("Bead"),), traps=(harmonic("Trap", track, cutoff=cutoff),), settings=settings)


def check_lag(expect_law, device: str, worlds: int, samples: int) -> None:
    speed = 30.0
    settled, every = 12.0 / RATE, 3.0 / RATE
    sim = Simulation(dragged(speed, 1.0, np.inf, Settings(accuracy=ACCURACY)), worlds=worlds, seed=91, device=device)
    sim.run(settled)
    lag = []
    for _ in range(samples):
        sim.run(every)
        x = sim.state.position.numpy()[:, 0].astype(float)
        lag.append(x - [speed * sim.time, 0.0, 0.0])
    assert sim.time < 1.0
    lag = np.array(lag)
    mean, error = across_worlds(lag.mean(axis=0))
    # float32 positions 20 µm from the origin are rounded to 1 nm, without a preference
    expect_law("mean lag behind the trap [µm]", mean[0], -GAMMA * speed / STIFFNESS, error[0], bias=1e-6)
    expect_law("mean displacement across [µm]", mean[1:], 0.0, error[1:], bias=1e-6)
    spread, error = across_worlds(((lag - mean) ** 2).mean(axis=0) * STIFFNESS / ENERGY)
    expect_law("spread about it, ⟨δx²⟩ k/k_B T", spread, 1.0, error, bias=1.02 * ACCURACY)


@pytest.mark.thorough
def test_lag(expect_law, device):
    """⟨x − x_trap⟩ = −γv/k, with the same thermal spread as at rest.

    Source: Stokes' law; van Zon & Cohen 2003, doi:10.1103/PhysRevE.67.046102, for the Gaussian about the lag.
    """
    check_lag(expect_law, device, 4000, 5)


@pytest.mark.validate
def test_lag_precisely(expect_law, device):
    """⟨x − x_trap⟩ = −γv/k, with the same thermal spread as at rest.

    Source: Stokes' law; van Zon & Cohen 2003, doi:10.1103/PhysRevE.67.046102, for the Gaussian about the lag.
    """
    check_lag(expect_law, device, 50_000, 30)


def escape_time(pull: float, depth: float = DEPTH, *, shells: int = 240, sectors: int = 80) -> float:
    """Mean time from the centre to the rim under a drag of `pull`·k_B T/rim [s]."""
    force = pull * ENERGY / rim(depth)
    grid = ball(
        lambda r, mu: 0.5 * STIFFNESS * r**2 + force * r * mu,
        rim(depth),
        shells=shells,
        sectors=sectors,
        diffusion=ENERGY / GAMMA,
        energy=ENERGY,
    )
    # the innermost shell surrounds the centre
    return float(grid.exit_time()[:sectors].mean())


def test_the_solution_has_converged():
    """Half as many cells along r and cos θ change the escape time by less than a fifth of the accuracy."""
    assert escape_time(6.0, shells=120, sectors=40) == pytest.approx(escape_time(6.0), rel=0.2 * ACCURACY)


def check_escape(expect_law, device: str, pull: float, worlds: int) -> None:
    speed = pull * ENERGY / rim(DEPTH) / GAMMA
    expected = escape_time(pull)
    longest = 40.0 * expected
    scene = dragged(speed, longest, rim(DEPTH), Settings(accuracy=ACCURACY))
    sim = Simulation(scene, worlds=worlds, seed=92, device=device)
    mean, error = across_worlds(first_escapes(sim, longest))
    name = f"mean escape time from {DEPTH:g} k_B T dragged with {pull:g} k_B T/rim, over the law"
    expect_law(name, mean / expected, 1.0, error / expected, bias=ACCURACY)


@pytest.mark.thorough
def test_escape_under_drag(expect_law, device):
    """Mean time after which a bead is lost by a moving trap, against the backward Smoluchowski equation.

    Source: Dudko, Hummer & Szabo 2006, doi:10.1103/PhysRevLett.96.108101; Kramers 1940.
    """
    check_escape(expect_law, device, 8.0, 2000)


@pytest.mark.validate
@pytest.mark.parametrize("pull", [4.0, 8.0, 12.0])
def test_escape_under_drag_precisely(expect_law, device, pull):
    """Mean time after which a bead is lost by a moving trap, against the backward Smoluchowski equation.

    Source: Dudko, Hummer & Szabo 2006, doi:10.1103/PhysRevLett.96.108101; Kramers 1940.
    """
    check_escape(expect_law, device, pull, {4.0: 15_000, 8.0: 50_000, 12.0: 50_000}[pull])


def barrier(pull: ArrayLike, depth: float) -> np.ndarray:
    """ΔG(1 − νFx‡/ΔG)^(1/ν) that the drag leaves, ν = 1/2 [k_B T]."""
    return depth * (1.0 - 0.5 * np.asarray(pull) / depth) ** 2


def dudko(pull: float, depth: float) -> float:
    """Mean lifetime by eq. 2 of Dudko, Hummer & Szabo 2006 with ν = 1/2, for the rim of a ball [s].

    τ(F) = τ₀ (1 − νFx‡/ΔG)^(1 − 1/ν) exp(−ΔG[1 − (1 − νFx‡/ΔG)^(1/ν)]/k_B T), x‡ the rim and ΔG the depth, with
    Kramers' τ₀ = (γ/k) √(π k_B T/ΔG) e^{ΔG/k_B T} of a cusp. That is one direction. Across it the energy on the rim
    of a ball rises as F s²/2x‡, where in the well it rises as k s²/2: of the two directions the rate has the factor
    k x‡/F (Langer 1969, doi:10.1016/0003-4916(69)90153-5).
    """
    share = 0.5 * pull / depth
    intrinsic = np.sqrt(np.pi / depth) * np.exp(depth) / RATE
    one_direction = intrinsic / (1.0 - share) * np.exp(-depth * (1.0 - (1.0 - share) ** 2))
    return float(one_direction * share)


KRAMERS = 1.5
"""Kramers' theory is the first term of a series in 1/barrier; the second is between 1 and 1.5 of it at these wells."""


def test_dudko_theory_is_the_limit_of_high_barriers(expect_law):
    """Smoluchowski's mean escape times over the theory's: 1 but for 1.5 k_B T/barrier, at barriers of 3 to 16 k_B T.

    Source: Dudko, Hummer & Szabo 2006, doi:10.1103/PhysRevLett.96.108101, with a Kramers rate for the cusp.
    """
    depth = 30.0
    pulls = np.array([16.0, 20.0, 28.0, 36.0, 40.0])
    left = barrier(pulls, depth)
    # the grid leaves 1.5 % of the escape time of so deep a well
    exact = np.array([escape_time(pull, depth) for pull in pulls])
    theory = np.array([dudko(pull, depth) for pull in pulls])
    expect_law("mean escape time from 30 k_B T, over Dudko's", exact / theory, 1.0, 0.003, bias=KRAMERS / left)
    # more than four decades of time, of which the theory misses little
    assert exact[0] / exact[-1] > 1e4
    expect_law(
        "ln of the times' ratio between drags of 16 and 40 k_B T/rim",
        np.log(exact[0] / exact[-1]),
        np.log(theory[0] / theory[-1]),
        0.004,
        bias=KRAMERS * (1.0 / left[-1] - 1.0 / left[0]),
    )


@pytest.mark.thorough
@pytest.mark.parametrize("pull", [8.0, 10.0, 12.0])
def test_escapes_follow_dudko(expect_law, device, pull):
    """Mean time after which a moving trap of 12 k_B T loses its bead, where barriers of 3 to 5 k_B T are left.

    Source: Dudko, Hummer & Szabo 2006, doi:10.1103/PhysRevLett.96.108101; its bias is 1.5 k_B T/barrier.
    """
    depth = 12.0
    speed = pull * ENERGY / rim(depth) / GAMMA
    longest = 40.0 * dudko(pull, depth)
    sim = Simulation(
        dragged(speed, longest, rim(depth), Settings(accuracy=ACCURACY)), worlds=4000, seed=93, device=device
    )
    mean, error = across_worlds(first_escapes(sim, longest))
    name = f"mean escape time from {depth:g} k_B T dragged with {pull:g} k_B T/rim, over"
    theory, exact = dudko(pull, depth), escape_time(pull, depth)
    expect_law(f"{name} Dudko's", mean / theory, 1.0, error / theory, bias=KRAMERS / barrier(pull, depth))
    expect_law(f"{name} Smoluchowski's", mean / exact, 1.0, error / exact, bias=ACCURACY)
