"""Bodies that carry each other along, in whole runs: drift, noise, contact, and what two trapped beads do together.

Bounds of statistical tests are five standard errors; seeds are fixed.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from otwarp.scene import Flow, Medium, Scene
from otwarp.simulation.packing.bodies import union_volume, weight
from otwarp.simulation.simulation import Simulation
from tests.reference import coupling as reference
from tests.reference.rotations import exponential, matrix, multiply
from tests.simulation.setups import (
    CELL,
    COLD,
    ENERGY,
    STIFFNESS,
    VISCOSITY,
    drag,
    five_sphere_mobility,
    harmonic,
    neutral,
    obstacle,
    robot,
    sphere_body,
)

SIGMAS = 5.0
ROUNDING = 2e-6
"""Rounding of float32 coordinates of up to 4 µm, and of displacements of 0.1 µm [µm, rad]."""
RATE = STIFFNESS / drag(1.0)
"""Relaxation of a lone bead of 1 µm in a trap [1/s]."""
TURN = (0.5, 0.5, -0.5, 0.5)
NEUTRAL = Medium().density
HANDLE = np.array([0.3, -0.6, 4.0])
"""Where the trap of `mixed` is, near one sphere of its robot [µm]."""
REACH = 1.0
"""Of that trap: it acts on one sphere [µm]."""


def coupled(scene: Scene, **settings) -> Scene:
    """The scene with coupling, and other settings."""
    return dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, coupling=True, **settings))


def mixed(dt: float, *, temperature: float = Medium.temperature, **more) -> Scene:
    """A robot, a bead near its middle and a large bead beside both; a trap at one handle, weight on all but one."""
    bodies = (
        robot("Robot", (0.0, 0.0, 1.0), TURN),
        sphere_body("Bead", (2.3, 0.4, 1.2), trapped=False, radius=0.7, density=4000e-12),
        sphere_body("Large", (-4.0, 3.0, 0.0), trapped=False, radius=2.0, density=NEUTRAL),
    )
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY, temperature=temperature),
        bodies=bodies,
        traps=(harmonic("Trap", HANDLE, cutoff=REACH),),
        flow=Flow(prim="/World/Flow", kind="uniform", speed=20.0),
    )
    return coupled(scene, time_step=dt, gravity=True, **more)


def own_mobilities(scene: Scene) -> list[np.ndarray]:
    """(6, 6) of each body at unit viscosity: spheres by Stokes's laws, the robot by the hydrodynamics room."""
    out = []
    for body in scene.bodies:
        a = body.spheres[0].radius
        sphere = np.diag([1 / (6 * np.pi * a)] * 3 + [1 / (8 * np.pi * a**3)] * 3)
        out.append(five_sphere_mobility().mobility if len(body.spheres) > 1 else sphere)
    return out


def mixed_loads(scene: Scene, position: np.ndarray, turn: list[np.ndarray]) -> np.ndarray:
    """(3, 6) wrenches of trap and weight about the centres of diffusion, where the trap reaches one sphere."""
    load = np.zeros((3, 6))
    reference_point = five_sphere_mobility().reference
    for sphere in scene.bodies[0].spheres:
        arm = turn[0] @ (np.array(sphere.offset) - reference_point)
        away = position[0] + arm - HANDLE
        if np.linalg.norm(away) < REACH:
            load[0] += np.concatenate([-STIFFNESS * away, np.cross(arm, -STIFFNESS * away)])
    for b, body in enumerate(scene.bodies):
        arm = turn[b] @ (union_volume(body)[1] - (reference_point if b == 0 else 0.0))
        pull = np.array([0.0, 0.0, -weight(scene, body)])
        load[b] += np.concatenate([pull, np.cross(arm, pull)])
    return load


def mixed_drift(scene: Scene, dt: float, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """(3, 6) displacement per step without noise: everything the twin knows of the scene."""
    turn = [matrix(orientation), np.eye(3), np.eye(3)]
    whole = reference.whole_mobility(position, turn, own_mobilities(scene))
    move = reference.moves(whole, mixed_loads(scene, position, turn), dt / VISCOSITY)
    move[:, 0] += 20.0 * dt
    # beads do not turn in a scene: nothing depends on it
    move[1:, 3:] = 0.0
    return move


def rotation_vector(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(..., 3) of the small turn between quaternions."""
    turn = multiply(after.T, (before * [-1, -1, -1, 1]).T)
    return (2.0 * np.sign(turn[3]) * turn[:3]).T


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "heun"])
def test_a_step_of_three_bodies(integrator, device):
    """Trap, weight and flow on a robot and two beads against the twin, forces and pairs anew at Heun's end."""
    dt = 1e-4
    scene = mixed(dt, temperature=COLD, integrator=integrator)
    sim = Simulation(scene, device=device, allow_large_step=True)
    start, turned = sim.state.position.numpy()[0].astype(float), sim.state.orientation.numpy()[0].astype(float)
    move = mixed_drift(scene, dt, start, turned[0])
    first = move
    if integrator == "heun":
        later = mixed_drift(scene, dt, start + first[:, :3], multiply(exponential(first[0, 3:]), turned[0]))
        later[:, 3:] -= 0.5 * np.cross(first[:, 3:], later[:, 3:])
        move = 0.5 * (first + later)
    sim.step()
    # the robot's handle goes a tenth of a micrometre, and the beads a quarter of that
    assert np.abs(first[1:, :3]).max() > 0.1 * np.abs(first).max()
    np.testing.assert_allclose(sim.state.position.numpy()[0] - start, move[:, :3], atol=ROUNDING)
    found = rotation_vector(sim.state.orientation.numpy()[0, 0].astype(float), turned[0])
    np.testing.assert_allclose(found, move[0, 3:], atol=ROUNDING)


def test_covariance_of_the_noise(device):
    """One step of 12 degrees of freedom: 2 k_B T M dt. Standard error of C_ij: √((C_ii C_jj + C_ij²)/worlds)."""
    worlds, dt = 40_000, 1e-4
    scene = mixed(dt, integrator="eulerMaruyama")
    sim = Simulation(scene, worlds=worlds, seed=11, device=device, allow_large_step=True)
    start, turned = sim.state.position.numpy().astype(float), sim.state.orientation.numpy().astype(float)
    sim.step()
    shift = (sim.state.position.numpy() - start).reshape(worlds, 9)
    angle = rotation_vector(sim.state.orientation.numpy()[:, 0].astype(float), turned[:, 0])
    found = np.cov(np.hstack([shift[:, :3], angle, shift[:, 3:]]).T)
    turn = [matrix(turned[0, 0]), np.eye(3), np.eye(3)]
    whole = reference.whole_mobility(start[0], turn, own_mobilities(scene))
    assert np.linalg.eigvalsh(whole)[0] > 0.0
    kept = [*range(9), 12, 13, 14]
    expected = 2.0 * ENERGY * dt / VISCOSITY * whole[np.ix_(kept, kept)]
    error = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / worlds)
    assert np.abs((found - expected) / error).max() < SIGMAS
    # the coupling is well above the error
    assert np.abs(expected[0:3, 6:9] / error[0:3, 6:9]).max() > 10.0 * SIGMAS


def test_the_whole_matrix_is_positive_definite():
    """Three long robots anywhere, crossing too: eigenvalues above 0, as the equivalent radii promise.

    With the radius of the mean mobility they would not be.
    """
    rng = np.random.default_rng(8)
    own = [five_sphere_mobility().mobility] * 3
    least, mean = np.inf, np.inf
    radius = 1.0 / (2.0 * np.pi * np.trace(own[0][:3, :3]))
    for _ in range(25):
        q = rng.normal(size=(3, 4))
        turn = [matrix(v / np.linalg.norm(v)) for v in q]
        place = rng.uniform(0.1, 4.0) * rng.normal(size=(3, 3))
        whole = reference.whole_mobility(place, turn, own)
        least = min(least, np.linalg.eigvalsh(whole)[0])
        for i, j in itertools.permutations(range(3), 2):
            block = reference.pair_mobility(place[i] - place[j], radius, radius)
            whole[6 * i : 6 * i + 3, 6 * j : 6 * j + 3] = block
        mean = min(mean, np.linalg.eigvalsh(whole)[0])
    assert mean < 0.0 < least


def trapped_pair(distance: float, **settings) -> Scene:
    """Two beads of 1 µm along x, each in its trap."""
    places = ((0.0, 0.0, 0.0), (distance, 0.0, 0.0))
    return coupled(
        Scene(
            medium=Medium(viscosity=VISCOSITY),
            bodies=tuple(sphere_body(f"Bead{i}", p) for i, p in enumerate(places)),
            traps=tuple(harmonic(f"Trap{i}", p, cutoff=1.4) for i, p in enumerate(places)),
        ),
        **settings,
    )


def test_two_trapped_beads_are_anticorrelated(device):
    """⟨x₁(0)x₂(τ)⟩ = k_B T/2k (e^{−λ₊τ} − e^{−λ₋τ}), λ± = k(μ ± P), along and across: 0 at once, negative later.

    Meiners & Quake 1999, doi:10.1103/PhysRevLett.82.2211. Each of the beads stays in equilibrium. The beads stray by
    14 nm of 3 µm, so P is constant to 1e-4. Standard errors: k_B T/k/√worlds of correlations of what is uncorrelated,
    √2 times that of variances.
    """
    worlds, distance = 20_000, 3.0
    scene = trapped_pair(distance, time_step=0.05 / RATE)
    sim = Simulation(scene, worlds=worlds, seed=12, device=device)
    variance = ENERGY / STIFFNESS
    rest = np.array([[0.0, 0, 0], [distance, 0, 0]])
    start = rest + np.random.default_rng(2).normal(scale=np.sqrt(variance), size=(worlds, 2, 3))
    sim.set_state(position=start)
    sim.step(20)
    before, after = start - rest, sim.state.position.numpy() - rest
    tau = 20 * 0.05 / RATE
    pair = 6.0 * np.pi * np.diag(reference.pair_mobility(np.array([distance, 0, 0]), 1.0, 1.0))
    bound = SIGMAS / np.sqrt(worlds)
    for d in range(3):
        slow, fast = np.exp(-RATE * (1 - pair[d]) * tau), np.exp(-RATE * (1 + pair[d]) * tau)
        own, cross = 0.5 * (fast + slow), 0.5 * (fast - slow)
        assert cross < -2 * bound
        lagged = np.einsum("wi,wj->ij", before[:, :, d], after[:, :, d]) / (worlds * variance)
        np.testing.assert_allclose(lagged, [[own, cross], [cross, own]], atol=bound * np.sqrt(1 + own**2))
        now = np.einsum("wi,wj->ij", after[:, :, d], after[:, :, d]) / (worlds * variance)
        np.testing.assert_allclose(now, np.eye(2), atol=np.sqrt(2) * bound)


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "heun"])
def test_beads_that_share_a_trap_are_distributed_as_if_alone(integrator, device):
    """Two beads in one wide trap, from apart to one within the other: P changes by its own size, and ⟨r²⟩ = 6k_B T/k.

    A drift that is wrong by ∇·M, or noise of another matrix, would show in the moments of the distance: r² is
    2k_B T/k times χ²₃. Standard errors: √(2/3)/√worlds of ⟨r²⟩, and √(1.71/worlds) of ⟨r⁴⟩. Error of the step: z/2 of
    Euler–Maruyama's variance, made good below; less than 1e-3 of Heun's.
    """
    worlds, radius, z = 20_000, 0.1, 0.02
    spread = 0.15
    stiffness = ENERGY / spread**2
    # the second trap is dark: with it the step is that of `test_order_of_the_drift`
    traps = (harmonic("Trap", power=20.0 * stiffness / STIFFNESS), harmonic("Dark", power=0.0))
    bodies = tuple(sphere_body(f"B{i}", radius=radius) for i in range(2))
    scene = coupled(
        Scene(medium=Medium(viscosity=VISCOSITY), bodies=bodies, traps=traps),
        time_step=z * drag(radius) / stiffness,
        integrator=integrator,
    )
    sim = Simulation(scene, worlds=worlds, seed=13, device=device)
    assert sim.model.features.integrator == integrator
    sim.set_state(position=np.random.default_rng(4).normal(scale=spread, size=(worlds, 2, 3)))
    sim.step(150)
    x = sim.state.position.numpy().astype(float)
    bias = 0.02 if integrator == "eulerMaruyama" else 2e-3
    r2 = np.sum((x[:, 0] - x[:, 1]) ** 2, axis=1) / (2.0 * spread**2)
    assert r2.mean() == pytest.approx(3.0, rel=SIGMAS * np.sqrt(2.0 / 3.0 / worlds) + bias)
    assert (r2**2).mean() == pytest.approx(15.0, rel=SIGMAS * np.sqrt((945.0 / 225.0 - 1.0) / worlds) + 2 * bias)
    # a quarter of them overlap: 2a = 0.94 of the spread of one coordinate of the distance
    assert 0.1 < (r2 < 2.0 * radius**2 / spread**2).mean() < 0.4


def falling(*places, radius: float = 1.0, still: int = -1, **settings) -> Scene:
    """Beads that sink by weight alone, but for a neutral one."""
    densities = [NEUTRAL if i == still else 2.0 * NEUTRAL for i in range(len(places))]
    bodies = [
        sphere_body(f"B{i}", p, radius=radius, trapped=False, density=d)
        for i, (p, d) in enumerate(zip(places, densities, strict=True))
    ]
    scene = Scene(medium=Medium(viscosity=VISCOSITY), bodies=tuple(bodies))
    return coupled(scene, gravity=True, brownian=False, **settings)


@pytest.mark.parametrize(("way", "gain"), [((0, 0, 3.0), 3 / 2 / 3 - 1 / 27), ((3.0, 0, 0), 3 / 4 / 3 + 1 / 54)])
def test_a_pair_falls_faster(way, gain, device):
    """μ(1 + 3a/2r − a³/r³) one above the other, μ(1 + 3a/4r + a³/2r³) side by side, with r = 3a."""
    scene = falling((0.0, 0.0, 0.0), way, time_step=1e-3)
    sim = Simulation(scene, device=device)
    sim.step(100)
    alone = -weight(scene, scene.bodies[0]) / drag(1.0) * 0.1
    moved = sim.state.position.numpy()[0] - [[0, 0, 0], way]
    np.testing.assert_allclose(moved, [[0, 0, alone * (1 + gain)]] * 2, atol=1e-4 * abs(alone))


def test_a_falling_bead_drags_its_neighbour(device):
    """What feels no force moves by P F, and the falling bead as if it were alone."""
    scene = falling((0.0, 0.0, 0.0), (2.5, 0.0, 1.0), still=1, time_step=1e-4)
    sim = Simulation(scene, device=device)
    sim.step(10)
    force = np.array([0.0, 0.0, -weight(scene, scene.bodies[0])])
    pair = reference.pair_mobility(np.array([2.5, 0.0, 1.0]), 1.0, 1.0) / VISCOSITY
    expected = 1e-3 * np.array([force / drag(1.0), pair @ force])
    moved = sim.state.position.numpy()[0] - [[0, 0, 0], [2.5, 0, 1.0]]
    # in 1 ms they move by a thousandth of their distance
    np.testing.assert_allclose(moved, expected, atol=3e-3 * abs(expected).max())


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "heun"])
def test_what_rests_on_a_floor_drags_nothing(integrator, device):
    """Weight and contact force cancel, so the far field of a bead at rest does too; without the floor it is there."""
    bead = sphere_body("Bead", (0.0, 0.0, 1.0), collides=True, trapped=False, density=2.0 * NEUTRAL)
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(bead, neutral("Neighbour", (2.5, 0.0, 2.0))),
        obstacles=(obstacle("Floor", "plane", (0.0, 0.0, 0.0)),),
    )
    scene = coupled(scene, gravity=True, brownian=False, time_step=1e-3, integrator=integrator)
    sim = Simulation(scene, device=device)
    sim.step(20)
    before = sim.state.position.numpy()[0].astype(float)
    sim.step(200)
    dragged = weight(scene, bead) * reference.pair_mobility(np.array([2.5, 0, 1.0]), 1.0, 1.0)[2, 2] / VISCOSITY * 0.2
    assert dragged > 0.1
    moved = np.abs(sim.state.position.numpy()[0] - before).max()
    assert moved < 0.01 * dragged


def test_beads_in_contact_are_distributed_as_boltzmann_has_them(device):
    """Two soft beads in one trap stay as they are put: density r² e^{−(kr²/4 + U(r))/k_B T}, whatever their friction.

    Contact forces that moved only the two beads by themselves would leave 26 % too few in contact. Standard error of
    the mean distance 1.6 % of its spread, and of the number in contact 3.1 %.
    """
    worlds, pull, material = 4000, 0.02, dataclasses.replace(CELL, youngs_modulus=20.0)
    bodies = tuple(sphere_body(f"B{i}", (x, 0, 0), collides=True, material=material) for i, x in enumerate((-1.0, 1.0)))
    # a reach that nothing gets to: the step is that of the pair in `test_contact_thermal`
    trap = harmonic("Trap", power=20.0 * pull / STIFFNESS, cutoff=50.0)
    scene = Scene(medium=Medium(viscosity=VISCOSITY), bodies=bodies, traps=(trap,))
    sim = Simulation(coupled(scene, time_step=1e-3 * drag(1.0) / pull), worlds=worlds, seed=14, device=device)

    grid = np.linspace(1.5, 6.0, 20_001)
    stiff = 4.0 / 3.0 * np.sqrt(0.5) * material.youngs_modulus / (2.0 * (1.0 - material.poisson_ratio**2))
    energy = 0.25 * pull * grid**2 + 0.4 * stiff * np.clip(2.0 - grid, 0.0, None) ** 2.5
    density = grid**2 * np.exp(-(energy - energy.min()) / ENERGY)
    density /= density.sum()
    mean, closed = float(density @ grid), float(density[grid < 2.0].sum())
    spread = float(np.sqrt(density @ (grid - mean) ** 2))

    rng = np.random.default_rng(1)
    way = rng.normal(size=(worlds, 3))
    way *= (0.5 * rng.choice(grid, size=worlds, p=density) / np.linalg.norm(way, axis=1))[:, None]
    middle = rng.normal(scale=np.sqrt(0.5 * ENERGY / pull), size=(worlds, 3))
    sim.set_state(position=np.stack([middle - way, middle + way], axis=1))
    sim.step(300)
    x = sim.state.position.numpy().astype(float)
    r = np.linalg.norm(x[:, 0] - x[:, 1], axis=1)
    assert r.mean() == pytest.approx(mean, abs=SIGMAS * spread / np.sqrt(worlds))
    assert (r < 2.0).mean() == pytest.approx(closed, abs=SIGMAS * np.sqrt(closed * (1.0 - closed) / worlds))
