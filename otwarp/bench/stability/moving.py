"""Cells of the stress tests of what varies within a step: bodies that turn fast, and commands with fine samples."""

from __future__ import annotations

import math

import numpy as np

from otwarp.bench import closed_forms
from otwarp.bench.scenes import PLACE, POWER, STIFFNESS, bead, scene, spring
from otwarp.bench.stability.thermal import Effort, advance, simulate
from otwarp.bench.stability.verdict import Deviation, against
from otwarp.scene import Body, Scene, Sphere, Track
from otwarp.simulation.packing.bodies import mobilities
from otwarp.units import BOLTZMANN

LONGEST = 0.5
"""Time step of a rotor over the time 1/D_r of its axis, at most: then nothing of its orientation is left to compare."""

SAMPLES = 24
"""Of a period, of commands that vary."""


def rod(length: int, radius: float) -> Body:
    """Spheres of one radius [µm] in a row along z, that nothing holds."""
    places = (np.arange(length) - 0.5 * (length - 1)) * 2.0 * radius
    spheres = tuple(
        Sphere(prim=f"/World/rod/s{i}", offset=(0.0, 0.0, float(z)), radius=radius, collides=False, trapped=False)
        for i, z in enumerate(places)
    )
    return Body(prim="/World/rod", position=PLACE, spheres=spheres)


def _diffusion(what: Scene) -> tuple[float, float, float]:
    """D_r of the axis of a rod [1/s], and its diffusion along and across it [µm²/s]."""
    rate = BOLTZMANN * what.medium.temperature / what.medium.viscosity
    m = rate * mobilities(what)[0].mobility
    return float(m[3, 3]), float(m[2, 2]), float(m[0, 0])


def rotor(effort: Effort, *, length: int, factor: float, integrator: str = "heun", along: bool = False) -> Deviation:
    """Free rod of spheres of 0.1 µm: ⟨n(0)·n(t)⟩ against e^(−2 D_r t), or ⟨(n(0)·Δx)²⟩ `along` its axis.

    At about t = 1/2D_r; of displacements over one step, where they err most. `factor` is the time step over the chosen
    one, up to `LONGEST`.
    """
    what = scene(rod(length, 0.1))
    turning, fast, slow = _diffusion(what)
    chosen = simulate(what, effort, integrator=integrator).model.time_step
    step = min(factor * chosen, LONGEST / turning)
    sim = simulate(what, effort, integrator=integrator, time_step=step, worlds=8 * effort.worlds)
    start = sim.state.position.numpy()[:, 0, 2].astype(float)
    advance(sim, 1 if along else max(1, round(0.5 / (turning * step))))
    errors = sim.model.scales.errors
    if along:
        mean = (fast + 2.0 * slow) / 3.0
        exact = 2.0 * mean * sim.time + (fast - slow) * 2.0 / 9.0 * -math.expm1(-6.0 * turning * sim.time) / turning
        moved = sim.state.position.numpy()[:, 0, 2].astype(float) - start
        return against(moved**2, exact, predicted=errors["axis"])
    x, y = sim.state.orientation.numpy()[:, 0, :2].astype(float).T
    lag = 2.0 * turning * sim.time
    return against(1.0 - 2.0 * (x * x + y * y), math.exp(-lag), predicted=-lag * errors["orientation"])


def circling(effort: Effort, *, turns: float, product: float, integrator: str = "heun") -> Deviation:
    """Bead at 0 K in a spring whose focus circles: its largest distance from its way, over the radius of the circle.

    Args:
        turns: Of the focus in one step of 1 ms.
        product: k·dt/γ.
    """
    step, radius = 1e-3, 0.5
    drag = closed_forms.drag(1.0, scene(bead()).medium.viscosity)
    times = np.arange(0.0, 80 * step, step / turns / SAMPLES)
    angle = 2.0 * np.pi * turns / step * times
    ways = np.array(PLACE) + radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    trap = spring(Track(times=times, values=ways), power=POWER * product * drag / step / STIFFNESS)
    sim = simulate(scene(bead(), traps=(trap,), temperature=0.0), effort, integrator=integrator, time_step=step)
    fine = np.arange(0.0, 64 * step, step / 2000)
    focus = np.stack([np.interp(fine + step / 4000, times, c) for c in ways.T], axis=1) - PLACE
    kept, here, worst = math.exp(-product / 2000), np.zeros(3), 0.0
    for n in range(64):
        for c in focus[2000 * n : 2000 * (n + 1)]:
            here = c + (here - c) * kept
        advance(sim, 1)
        found = sim.state.position.numpy()[0, 0].astype(float) - PLACE
        worst = max(worst, float(np.linalg.norm(found - here)))
    return Deviation(error=worst / radius)


def blinking(effort: Effort, *, share: float, product: float, integrator: str = "heun") -> Deviation:
    """Bead at 0 K in a trap that is on for a `share` of each step: what is left of its distance, against e^(−∫k/γ).

    `product` is k·dt/γ while it is on. Over as many steps as bring it to a third, relative to the start.
    """
    step, dark = 1e-3, 1e-4
    drag = closed_forms.drag(1.0, scene(bead()).medium.viscosity)
    steps = max(1, round(1.0 / (share * product)))
    phases = np.array([0.0, share, share + dark, 1.0 - dark])
    times = (np.arange(steps + 1)[:, None] + phases).ravel() * step
    levels = np.tile([1.0, 1.0, 0.0, 0.0], steps + 1) * POWER * product * drag / step / STIFFNESS
    trap = spring((PLACE[0] + 0.5, *PLACE[1:]))
    trap = type(trap)(**{**vars(trap), "power": Track(times=times, values=levels[:, None])})
    sim = simulate(scene(bead(), traps=(trap,), temperature=0.0), effort, integrator=integrator, time_step=step)
    advance(sim, steps)
    left = 1.0 - (sim.state.position.numpy()[0, 0, 0].astype(float) - PLACE[0]) / 0.5
    return Deviation(error=left - math.exp(-steps * product * (share + dark)))
