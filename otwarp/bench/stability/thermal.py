"""Cells of the stress tests with noise: equipartition of a bead, of a robot, and of a bead that rests on a floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from otwarp.bench import closed_forms
from otwarp.bench.scenes import ELEMENTS, HELD, PLACE, POWER, STIFFNESS, bead, resting, robot, scene, spring
from otwarp.bench.stability.verdict import Defect, Deviation, against
from otwarp.errors import SimulationError
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN

SEED = 20240731

UNIT = 1e-5
"""Error of a quaternion's length above which it is no rotation any more: a few dozen roundings of float32."""

SETTLE, APART = 6.0, 2.0
"""Relaxation times before the first snapshot, and between two: correlations of squares fall to e⁻⁴."""

SNAPSHOTS = 8

TINY = 1e-300
"""Taken for the nothing that some steps leave of a mode."""

LOOKS = 2000
"""Snapshots of a long run at most."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How hard a stress test tries.

    Attributes:
        device: Where the cells run.
        worlds: Copies of a scene with noise.
        random_scenes: Scenes drawn at random.
        steps: Longest run, in steps.
    """

    device: str | None = None
    worlds: int = 4096
    random_scenes: int = 24
    steps: int = 100_000


def simulate(what: Scene, effort: Effort, **how: object) -> Simulation:
    """A simulation on one thread, as all cells take it; what a large step does is what some of them look at."""
    given = {"device": effort.device, "seed": SEED, "threads": 1, "allow_large_step": True, **how}
    return Simulation(what, **given)  # type: ignore[arg-type]


def told_of(sim: Simulation) -> float:
    """Bound of the error of gaps in contact that `otwarp info` tells."""
    return sim.model.scales.errors.get("contact", 0.0)


def advance(sim: Simulation, steps: int) -> None:
    """Take steps; whatever happens, no number of the state may be non-finite.

    Raises:
        SimulationError: The run stopped, as it should when it cannot go on.
        Defect: A number of the state is not finite, or a quaternion has lost its length.
    """
    try:
        sim.step(steps)
    except SimulationError:
        check_state(sim, "a stopped run")
        raise
    check_state(sim, "a run without error")


def check_state(sim: Simulation, when: str) -> None:
    """Raise `Defect` for a state that must never be."""
    for name in ("position", "orientation"):
        if not np.all(np.isfinite(getattr(sim.state, name).numpy())):
            raise Defect(f"{when} left state.{name} non-finite at step {sim.state.step}")
    error = quaternion_error(sim)
    if error > UNIT:
        raise Defect(f"{when} left a quaternion of length 1 ± {error:.2g} at step {sim.state.step}")


def quaternion_error(sim: Simulation) -> float:
    """Largest deviation of a quaternion's length from 1."""
    q = sim.state.orientation.numpy().astype(float)
    return float(np.abs(np.linalg.norm(q, axis=-1) - 1.0).max(initial=0.0))


def chosen_step(what: Scene, effort: Effort, *, integrator: str = "heun") -> tuple[float, float]:
    """(chosen, largest stable) time step of a scene [s]."""
    scales = simulate(what, effort, integrator=integrator).model.scales
    return scales.time_step, scales.largest_stable


def steps_for(times: float, rate: float, sim: Simulation) -> int:
    """Steps in which modes of that rate [1/s], and of the stiffest trap, forget by e^(−times).

    A step leaves `Integrator.decay` of a mode: near the largest stable step that may be nearly all of it.
    """
    scales, left = sim.model.scales, INTEGRATORS[sim.model.scales.integrator].decay
    rates = [rate] if scales.trap_relaxation is None else [rate, 1.0 / scales.trap_relaxation]
    forgotten = min(-math.log(max(abs(left(r * sim.time_step)), TINY)) for r in rates)
    return max(1, math.ceil(times / forgotten))


def snapshots(sim: Simulation, rate: float, count: int = SNAPSHOTS) -> np.ndarray:
    """(count, W, B, 3) positions at times far enough apart to be independent; `rate` is that of the slowest mode."""
    advance(sim, steps_for(SETTLE, rate, sim))
    found = []
    for _ in range(count):
        advance(sim, steps_for(APART, rate, sim))
        found.append(sim.state.position.numpy().astype(float))
    return np.array(found)


def bead_variance(
    effort: Effort,
    *,
    power: float = POWER,
    temperature: float = 298.15,
    integrator: str = "heun",
    time_step: float | None = None,
    place: tuple[float, float, float] = PLACE,
    commanded: float | None = None,
) -> Deviation:
    """Stationary ⟨x²⟩ = k_BT/k of a bead in a spring; at 0 K its way back to the centre instead, e^{−kt/γ}.

    `commanded` is a power that `Control.set` asks for after the start.
    """
    what = scene(bead(place=place), traps=(spring(place, power=power),), temperature=temperature)
    cold = temperature == 0.0
    worlds = 1 if cold else effort.worlds
    sim = simulate(what, effort, worlds=worlds, integrator=integrator, time_step=time_step)
    if commanded is not None:
        sim.control.set(trap_power=commanded)
    acting = power if commanded is None else commanded
    k = STIFFNESS * acting / POWER
    rate = k / closed_forms.drag(1.0, what.medium.viscosity)
    if cold:
        start = 0.1
        sim.set_state(position=np.array(place) + np.array([[start, 0.0, 0.0]]))
        advance(sim, max(1, round(1.0 / (rate * sim.time_step))))
        moved = float(float(sim.state.position.numpy()[0, 0, 0]) - np.float32(place[0]))
        return Deviation(error=moved / start - math.exp(-rate * sim.time))
    x = snapshots(sim, rate)[:, :, 0] - np.array(place, dtype=np.float32).astype(float)
    energy = BOLTZMANN * temperature
    predicted = sim.model.scales.errors["variance"] if commanded is None else 0.0
    return against(np.mean(x**2, axis=(0, 2)), energy / k, predicted=predicted)


def resting_height(
    effort: Effort,
    *,
    modulus: float,
    below: float,
    power: float = POWER,
    temperature: float = 298.15,
    step: float = 1.0,
) -> Deviation:
    """Mean height of a bead that a spring pulls onto a floor, over its standard deviation by Boltzmann's law.

    `step` is the time step over the chosen one.
    """
    worlds = max(1, effort.worlds // 2)
    what = resting("plane", modulus=modulus, power=power, below=below, temperature=temperature)
    chosen, _ = chosen_step(what, effort)
    sim = simulate(what, effort, worlds=worlds, time_step=step * chosen)
    k = STIFFNESS * power / POWER
    hard = closed_forms.hardness(modulus, 1.0, bodies=1)
    exact, spread = closed_forms.mean_height(k, below, hard, BOLTZMANN * temperature)
    h = snapshots(sim, k / closed_forms.drag(1.0, what.medium.viscosity))[:, :, 0, 2] - PLACE[2]
    samples = h.mean(axis=0) - exact
    error, chance = float(samples.mean()), float(samples.std()) / math.sqrt(worlds)
    return Deviation(error=error / spread, standard_error=chance / spread, told=told_of(sim))


class RobotModes:
    """Normal modes of the robot in its springs, in which motion and noise of each are independent.

    With M = L Lᵀ and K the stiffness about the centre of diffusion, y = Qᵀ L⁻¹ (Δx, θ) has variance k_BT/λ, where Q and
    λ are eigenvectors and eigenvalues of Lᵀ K L: the relaxation rates.
    """

    def __init__(self, sim: Simulation, power: float):
        model = sim.model
        mobility = model.data.body.mobility.numpy()[0].astype(float) / model.scene.medium.viscosity
        root = np.linalg.cholesky(mobility)
        matrix = np.zeros((6, 6))
        for i in HELD:
            x, y, z = np.array([ELEMENTS[i][0], 0.0, ELEMENTS[i][1]]) - model.reference[0]
            lever = np.hstack([np.eye(3), -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])])
            matrix += STIFFNESS * power / POWER * lever.T @ lever
        self.rates, turn = np.linalg.eigh(root.T @ matrix @ root)
        self.project = turn.T @ np.linalg.inv(root)
        self.start = model.start_position()[0].astype(np.float32).astype(float)
        self.energy = BOLTZMANN * model.scene.medium.temperature

    def shares(self, sim: Simulation) -> np.ndarray:
        """(W, 6) λ·y²/k_BT of every mode, 1 in the mean."""
        q = sim.state.orientation.numpy()[:, 0].astype(float)
        q *= np.sign(q[:, 3:])
        sine = np.linalg.norm(q[:, :3], axis=1, keepdims=True)
        turned = q[:, :3] * 2.0 * np.arctan2(sine, q[:, 3:]) / np.maximum(sine, 1e-30)
        moved = sim.state.position.numpy()[:, 0].astype(float) - self.start
        y = np.hstack([moved, turned]) @ self.project.T
        return y**2 * self.rates / self.energy


def robot_equipartition(
    effort: Effort, *, power: float = POWER, factor: float = 1.0, stable: bool = False, integrator: str = "heun"
) -> Deviation:
    """⟨λy²⟩ = k_BT in the stiffest mode of a robot in three springs, and a unit quaternion.

    `factor` is the time step over the chosen one, or over the largest stable one.
    """
    what = robot(power=power)
    step = chosen_step(what, effort, integrator=integrator)[int(stable)]
    sim = simulate(what, effort, worlds=max(1, effort.worlds // 2), time_step=factor * step, integrator=integrator)
    modes = RobotModes(sim, power)
    # modes are independent: only the one that is looked at must have settled
    advance(sim, steps_for(SETTLE, modes.rates[-1], sim))
    found = []
    for _ in range(2 * SNAPSHOTS):
        advance(sim, steps_for(APART, modes.rates[-1], sim))
        found.append(modes.shares(sim)[:, -1])
    return against(np.mean(found, axis=0), 1.0, predicted=sim.model.scales.errors["variance"])


def long_run(effort: Effort, *, steps: int, worlds: int) -> Deviation:
    """Equipartition over all modes in the last tenth of a long run of a robot, and a unit quaternion at its end."""
    sim = simulate(robot(), effort, worlds=worlds)
    modes = RobotModes(sim, POWER)
    apart = max(steps_for(APART, modes.rates[0], sim), steps // 10 // LOOKS)
    advance(sim, steps - steps // 10)
    found = []
    for _ in range(max(1, steps // 10 // apart)):
        advance(sim, apart)
        found.append(modes.shares(sim)[:, 3:].mean(axis=1))
    return against(np.ravel(found), 1.0, predicted=sim.model.scales.errors["variance"])
