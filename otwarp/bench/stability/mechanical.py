"""Cells of the stress tests without noise: contact under a known load, trap jumps, drag, overlap at the start."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from otwarp.bench import closed_forms
from otwarp.bench.scenes import PLACE, POWER, STIFFNESS, bead, obstacle, pair, resting, scene, spring
from otwarp.bench.stability.thermal import Effort, advance, chosen_step, simulate, steps_for
from otwarp.bench.stability.verdict import Defect, Deviation
from otwarp.laws import TrapLaw
from otwarp.scene import Scene, Track, Trap
from otwarp.units import FORCE_PER_POWER

if TYPE_CHECKING:
    from otwarp.simulation.simulation import Simulation

PRESS = 5.0
"""Load of the pressed pair [pN]."""

REST = 12.0
"""Relaxation times after which a body is at rest: e⁻¹² of what it had to go."""

THIRD_LAW = 1e-4
"""Sum of the contact forces of a pair over the load above which action is not reaction; float32 leaves 1e-6."""


def pressed_pair(effort: Effort, *, modulus: float, ratio: float) -> Deviation:
    """Contact force of two spheres that one spring presses together with `PRESS`, by Hertz's law; and the third law."""
    sim = simulate(pair(modulus, ratio, press=PRESS), effort)
    reach = 1.0 + ratio
    k = 2.0 * PRESS / reach
    hard = closed_forms.hardness(modulus, ratio / reach, bodies=2)
    overlap = closed_forms.pressed_overlap(hard, lambda d: 0.5 * k * (reach - d), reach)
    drag = closed_forms.drag(ratio, sim.scene.medium.viscosity)
    advance(sim, math.ceil(REST * drag / k / sim.time_step))
    force = sim.readout.contact_force.numpy()[0].astype(float)
    load = hard * overlap**1.5
    if np.linalg.norm(force.sum(axis=0)) > THIRD_LAW * load:
        raise Defect(f"contact forces of the two bodies add up to {force.sum(axis=0)} pN under a load of {load:.3g} pN")
    place = sim.state.position.numpy()[0].astype(float)
    gap_error = (reach - float(np.linalg.norm(place[1] - place[0])) - overlap) / min(1.0, ratio)
    force_error = float(np.linalg.norm(force[0])) / load - 1.0
    return Deviation(error=max(force_error, gap_error, key=abs))


def first_overlap(effort: Effort, *, modulus: float, overlap: float) -> Deviation:
    """What is left after half a second of the overlap with which two equal spheres start; and the third law.

    The exact overlap falls as t⁻². Spheres that fly apart have a negative one.
    """
    sim = simulate(pair(modulus, 1.0, overlap=overlap), effort)
    start = sim.state.position.numpy()[0].astype(float)
    advance(sim, max(1, round(0.5 / sim.time_step)))
    place = sim.state.position.numpy()[0].astype(float)
    mobility = 2.0 / closed_forms.drag(1.0, sim.scene.medium.viscosity)
    hard = closed_forms.hardness(modulus, 0.5, bodies=2)
    exact = closed_forms.relaxed_overlap(overlap, hard, mobility, sim.time) if overlap > 0.0 else 0.0
    drift = float(np.linalg.norm((place - start).sum(axis=0)))
    if drift > THIRD_LAW:
        raise Defect(f"two equal spheres that push each other apart drift by {drift:.3g} µm")
    left = 2.0 - float(np.linalg.norm(place[1] - place[0]))
    # without an overlap at the start nothing may move
    return Deviation(error=(left - exact) / max(overlap, 0.01))


def trap_jump(effort: Effort, *, law: str, jump: float, factor: float = 1.0) -> Deviation:
    """Way of a bead whose trap jumps aside, over the jump, at ½, 1 and 3 relaxation times.

    `law` is `harmonic`, `piecewise` (lets go at 1.5 µm) or `table`; `factor` the time step over the chosen one.
    """
    what = scene(bead(), traps=(_trap(law),), temperature=0.0)
    chosen, _ = chosen_step(what, effort)
    sim = simulate(what, effort, time_step=factor * chosen)
    relaxation = sim.model.scales.trap_relaxation
    assert relaxation is not None
    # at rest where the trap holds it, before the trap jumps
    hold = np.array(PLACE) - [0.0, 0.0, sim.model.scene.traps[0].equilibrium]
    sim.control.set(trap_position=hold + np.array([jump, 0.0, 0.0]))
    steps = np.maximum(1, np.round(np.array([0.5, 1.0, 3.0]) * relaxation / sim.time_step)).astype(int)
    found = []
    for count in np.diff(steps, prepend=0):
        advance(sim, int(count))
        found.append(sim.state.position.numpy()[0, 0].astype(float))
    mobility = 1.0 / closed_forms.drag(1.0, what.medium.viscosity)
    times = steps * sim.time_step
    away = np.array([jump, 0.0, 0.0])
    exact = away + closed_forms.followed(_force(law, sim), -away, mobility, times)
    error = np.linalg.norm(np.array(found) - np.array(PLACE) - exact, axis=1)
    return Deviation(error=float(error.max()) / max(jump, 0.01))


CURVE = TrapLaw(stiffness=STIFFNESS, threshold=0.5, inverse_square=0.125 * STIFFNESS, cutoff=1.5, power=POWER)
"""A continuous piecewise law that lets go at 1.5 µm."""


def _trap(law: str) -> Trap:
    place, power = Track.constant(PLACE), Track.constant(POWER)
    if law == "harmonic":
        return spring()
    if law == "piecewise":
        return Trap(prim="/World/trap", position=place, power=power, model="piecewise", radial=CURVE)
    return Trap(prim="/World/trap", position=place, power=power, model="table", numerical_aperture=1.2)


def _force(law: str, sim: Simulation) -> Callable[[np.ndarray], np.ndarray]:
    """Force at a place (3,) given from where the bead is held, in float64."""
    if law == "table":
        table, rest = sim.model.optics.tables[0], np.array([0.0, 0.0, sim.model.scene.traps[0].equilibrium])
        scale = FORCE_PER_POWER * sim.scene.medium.refractive_index * POWER
        return lambda x: scale * table.force((x + rest)[None])[0]
    if law == "harmonic":
        return lambda x: -STIFFNESS * x

    def piecewise(x: np.ndarray) -> np.ndarray:
        """Force of `CURVE` at x (3,) from the focus [pN]."""
        d = float(np.linalg.norm(x))
        if d >= CURVE.cutoff or d == 0.0:
            return np.zeros(3)
        size = CURVE.stiffness * d if d < CURVE.threshold else CURVE.inverse_square / d**2 + CURVE.offset
        return -size * x / d

    return piecewise


def pulled_onto(effort: Effort, *, shape: str, modulus: float, jump: float) -> Deviation:
    """Contact force of a bead whose trap jumps below the top of an obstacle, by Hertz's law; it must not pass."""
    sim = simulate(resting(shape, modulus=modulus), effort)
    x, y, z = PLACE
    sim.control.set(trap_position=(x, y, z - jump))
    rate = STIFFNESS / closed_forms.drag(1.0, sim.scene.medium.viscosity)
    advance(sim, math.ceil(REST / rate / sim.time_step))
    curved = {"sphere": 5.0, "capsule": 2.0}.get(shape)
    radius = 1.0 if curved is None else curved / (1.0 + curved)
    hard = closed_forms.hardness(modulus, radius, bodies=1)
    overlap = closed_forms.pressed_overlap(hard, lambda d: STIFFNESS * (jump - d), max(jump, 1e-12))
    sunk = z - float(sim.state.position.numpy()[0, 0, 2])
    error = sunk - overlap
    if jump > 0.0:
        force = float(sim.readout.contact_force.numpy()[0, 0, 2])
        error = max(error, force / (STIFFNESS * (jump - overlap)) - 1.0, key=abs)
    return Deviation(error=error)


def dragged_bead(effort: Effort, *, speed: float, factor: float = 1.0, stable: bool = False) -> Deviation:
    """Lag γv/k of a bead behind a spring that moves at `speed` [µm/s].

    `factor` is the time step over the chosen one, or over the largest stable one.
    """
    last = 1.0
    ends = np.array([PLACE, (PLACE[0] + speed * last, PLACE[1], PLACE[2])])
    path = Track(times=np.array([0.0, last]), values=ends)
    what = scene(bead(), traps=(spring(path),), temperature=0.0)
    step = factor * chosen_step(what, effort)[int(stable)]
    sim = simulate(what, effort, time_step=step)
    drag = closed_forms.drag(1.0, what.medium.viscosity)
    advance(sim, steps_for(REST, STIFFNESS / drag, sim))
    if sim.time > last:
        raise Defect(f"the trap stopped at {last} s, before the end of the measurement at {sim.time:.3g} s")
    lag = PLACE[0] + speed * sim.time - float(sim.state.position.numpy()[0, 0, 0])
    return Deviation(error=lag * STIFFNESS / (drag * speed) - 1.0)


def crowded_floor(modulus: float, count: int) -> Scene:
    """`count` beads side by side on a plane, each in its own spring: the grid driver where there are many."""
    x, y, z = PLACE
    bodies = tuple(
        bead(1.0, (x + 2.5 * i, y, z), name=f"bead{i}", modulus=modulus, collides=True) for i in range(count)
    )
    traps = tuple(
        spring((x + 2.5 * i, y, z - 0.2), name=f"trap{i}", cutoff=1.2, holds=f"/World/bead{i}/sphere")
        for i in range(count)
    )
    return scene(*bodies, traps=traps, temperature=0.0, obstacles=(obstacle("plane", place=(x, y, z - 1.0)),))


def many_spheres(effort: Effort, *, modulus: float, count: int) -> Deviation:
    """Contact force of `count` beads on a floor, 0.2 µm above the centres of their springs."""
    sim = simulate(crowded_floor(modulus, count), effort)
    rate = STIFFNESS / closed_forms.drag(1.0, sim.scene.medium.viscosity)
    advance(sim, math.ceil(REST / rate / sim.time_step))
    hard = closed_forms.hardness(modulus, 1.0, bodies=1)
    overlap = closed_forms.pressed_overlap(hard, lambda d: STIFFNESS * (0.2 - d), 0.2)
    force = sim.readout.contact_force.numpy()[0, :, 2].astype(float) / (STIFFNESS * (0.2 - overlap)) - 1.0
    return Deviation(error=float(force[np.argmax(np.abs(force))]))
