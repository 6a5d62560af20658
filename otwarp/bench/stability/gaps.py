"""Cells of the stress tests with hard spheres and noise: pairs in a trap, and several beads in a box."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from otwarp.bench.closed_forms import drag, hardness
from otwarp.bench.scenes import bead, obstacle, scene, spring
from otwarp.bench.stability.hard_spheres import metropolis, near_gaps, pair_gaps
from otwarp.bench.stability.thermal import Effort, advance, simulate, told_of
from otwarp.bench.stability.verdict import Deviation
from otwarp.scene import Medium, Scene, Vec3
from otwarp.units import BOLTZMANN

POLYMER = 3e9
"""Young's modulus of two-photon polymer [Pa]."""

ENERGY = BOLTZMANN * 298.15

PAIRS = {"world": 1, "coupled": 1, "body": 13}
"""Pairs in a scene by driver; more than 24 bodies are stepped by the grid driver."""

CORNERS = tuple((x, y, z) for x in (-1.05, 1.05) for y in (-1.05, 1.05) for z in (-1.05, 1.05))
"""Where the beads in a box start [µm]."""

HALF = 2.0
"""How far their centres come from the middle of the box along each axis [µm]."""

FREE = 0.02
"""Error that gaps may have between beads that nothing presses, see docs/dynamics.md."""

FAR_AWAY = 20
"""Bodies outside the box that make the grid driver step it."""


def pairs_in_traps(count: int, stiffness: float, *, time_step: float | None = None, coupling: bool = False) -> Scene:
    """`count` pairs of touching beads far apart, both beads of each in one spring [pN/µm] centred between them."""
    bodies, traps = [], []
    for i in range(count):
        y = 5.0 + 12.0 * i
        for name, x in (("a", 2.0), ("b", 4.0)):
            bodies.append(bead(place=(x, y, 7.0), name=f"{name}{i}", modulus=POLYMER, collides=True))
        traps.append(spring((3.0, y, 7.0), stiffness=stiffness, name=f"trap{i}", cutoff=3.0))
    what = scene(*bodies, traps=tuple(traps))
    return replace(what, settings=replace(what.settings, time_step=time_step, coupling=coupling))


def pair_in_trap(effort: Effort, *, driver: str, z: float, stiffness: float = 20.0) -> Deviation:
    """Mean gap of two hard beads in one spring, over its standard deviation by Boltzmann's law; z = k·dt/γ."""
    count = PAIRS[driver]
    step = z * drag(1.0, Medium().viscosity) / stiffness
    what = pairs_in_traps(count, stiffness, time_step=step, coupling=driver == "coupled")
    sim = simulate(what, effort, worlds=max(1, effort.worlds // count))
    exact = pair_gaps(stiffness, hardness(POLYMER, 0.5, bodies=2), ENERGY)
    advance(sim, 20 + math.ceil(2.0 / z))
    found = []
    for _ in range(12):
        advance(sim, 4)
        place = sim.state.position.numpy().astype(float)
        found.append(np.linalg.norm(place[:, 1::2] - place[:, ::2], axis=-1) - 2.0 - exact.mean)
    samples = np.mean(found, axis=0).ravel() / exact.spread
    chance = float(samples.std()) / math.sqrt(len(samples))
    return Deviation(error=float(samples.mean()), standard_error=chance, told=told_of(sim))


def beads_in_box(stiffness: float, *, driver: str = "world", time_step: float | None = None) -> Scene:
    """Eight hard beads in a box of six walls, with a spring [pN/µm] to its middle or none for 0."""
    trapped = stiffness > 0.0
    bodies = [
        bead(place=p, name=f"bead{i}", modulus=POLYMER, collides=True, trapped=trapped) for i, p in enumerate(CORNERS)
    ]
    if driver == "body":
        bodies += [
            bead(place=(100.0 + 10.0 * i, 0.0, 0.0), name=f"far{i}", modulus=POLYMER, collides=True, trapped=False)
            for i in range(FAR_AWAY)
        ]
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            place, size = np.zeros(3), np.full(3, 12.0)
            place[axis], size[axis] = side * (HALF + 3.0), 2.0
            prim = f"/World/wall{axis}{'ab'[int(side > 0.0)]}"
            walls.append(replace(obstacle("box", size=point(size), place=point(place)), prim=prim))
    traps = (spring((0.0, 0.0, 0.0), stiffness=stiffness, cutoff=30.0),) if trapped else ()
    what = scene(*bodies, traps=traps, obstacles=tuple(walls))
    return replace(what, settings=replace(what.settings, time_step=time_step))


def point(v: np.ndarray) -> Vec3:
    """A point as the three numbers that a scene holds."""
    x, y, z = v.tolist()
    return x, y, z


def box_contacts(
    effort: Effort, *, stiffness: float, driver: str, within: float | None = None, looks: int = 40
) -> tuple[Deviation, Deviation]:
    """How many gaps to walls, and between beads, are below `within` [µm], over Metropolis' number, at the chosen step.

    For None within the spread of a step, √(2 k_BT dt/γ).
    """
    worlds = max(8, effort.worlds // (4 if driver == "world" else 16))
    sim = simulate(beads_in_box(stiffness, driver=driver), effort, worlds=worlds)
    near = math.sqrt(2.0 * ENERGY * sim.time_step / drag(1.0, Medium().viscosity)) if within is None else within
    rng = np.random.default_rng(1)
    place = np.repeat(np.array(CORNERS)[None], max(worlds, 1000), axis=0)
    start = place = metropolis(place, HALF, stiffness, ENERGY, 600, rng)
    exact = []
    for _ in range(60):
        place = metropolis(place, HALF, stiffness, ENERGY, 10, rng)
        exact.append(near_gaps(place, HALF, near))
    where = sim.state.position.numpy()
    where[:, :8] = start[:worlds]
    sim.set_state(position=where)
    advance(sim, 30)
    found = []
    for _ in range(looks):
        advance(sim, 4)
        found.append(near_gaps(sim.state.position.numpy()[:, :8].astype(float), HALF, near))
    out = []
    for k in range(2):
        # (worlds,) time averages are independent
        law, seen = (np.mean([v[k] for v in rows], axis=0) for rows in (exact, found))
        chance = math.hypot(
            float(law.std()) / math.sqrt(len(law)), float(seen.std()) / math.sqrt(len(seen))
        ) / float(law.mean())  # fmt: skip
        # of beads that nothing presses nothing is told
        told = told_of(sim) if stiffness > 0.0 else FREE
        out.append(Deviation(error=float(seen.mean() / law.mean()) - 1.0, standard_error=chance, told=told))
    return out[0], out[1]


def contacts_in_box(effort: Effort, *, kind: str, driver: str) -> Deviation:
    """One of the two numbers of `box_contacts`; `kind` is one of `KINDS`."""
    stiffness, which = KINDS[kind]
    return box_contacts(effort, stiffness=stiffness, driver=driver)[which]


KINDS = {
    "walls": (0.0, 0),
    "pairs": (0.0, 1),
    "walls, in a spring": (0.02, 0),
    "pairs, in a spring": (0.02, 1),
}
"""Stiffness of the spring [pN/µm], and which contacts are counted."""
