"""Cells of the stress tests with noise: a hard bead that a spring pulls onto what is curved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from otwarp.bench.closed_forms import POISSON_RATIO, drag, hardness
from otwarp.bench.scenes import PLACE, bead, obstacle, scene, spring
from otwarp.bench.stability.gaps import ENERGY, POLYMER
from otwarp.bench.stability.hard_spheres import GapDistribution, spring_gaps
from otwarp.bench.stability.thermal import Effort, advance, simulate, told_of
from otwarp.bench.stability.verdict import Deviation
from otwarp.scene import Body, Material, Medium, Obstacle, Rod, Scene, Sphere, Vec3

LONG = 20.0
"""Half of the length of cylinder, capsule and box, further than a bead comes [µm]."""

HELD = 5.0
"""Where traps hold the rod, from its middle [µm]."""

X, Y, Z = PLACE

OBSTACLES: dict[str, tuple[Obstacle, ...]] = {
    "sphere": (obstacle("sphere", size=(1.0, 0.0, 0.0), place=PLACE),),
    "cylinder": (obstacle("cylinder", size=(1.0, LONG, 0.0), place=PLACE),),
    "capsule": (obstacle("capsule", size=(1.0, LONG, 0.0), place=PLACE),),
    "edge of a box": (obstacle("box", size=(LONG, LONG, LONG), place=(X - LONG, Y - LONG, Z)),),
    "rod": (),
}
"""What the bead touches: of radius 1 µm about `PLACE` or along z through it, where the edge of the box runs, too."""


def curved_scene(shape: str, stiffness: float, time_step: float) -> Scene:
    """A hard bead that touches one of `OBSTACLES`, in a spring [pN/µm] to `PLACE`; the rod hangs in two of them."""
    reach = 1.0 if shape == "edge of a box" else 2.0
    bodies: tuple[Body, ...] = (bead(place=(X, Y + reach, Z), modulus=POLYMER, collides=True),)
    traps = (spring(stiffness=stiffness, cutoff=3.0, holds="/World/bead/sphere"),)
    if shape == "rod":
        bodies += (_rod(),)
        traps += tuple(
            spring((X, Y, Z + side * HELD), stiffness=stiffness, name=f"end{i}", cutoff=3.0, holds=f"/World/rod/s{i}")
            for i, side in enumerate((-1.0, 1.0))
        )
    what = scene(*bodies, traps=traps, obstacles=OBSTACLES[shape])
    return replace(what, settings=replace(what.settings, time_step=time_step))


def _rod() -> Body:
    """A rod of radius 1 µm along z, with a sphere that does not collide for each trap."""
    ends: tuple[Vec3, Vec3] = ((0.0, 0.0, -HELD), (0.0, 0.0, HELD))
    return Body(
        prim="/World/rod",
        position=PLACE,
        spheres=tuple(
            Sphere(prim=f"/World/rod/s{i}", offset=end, radius=1.0, collides=False) for i, end in enumerate(ends)
        ),
        rods=(Rod(prim="/World/rod/rod", start=ends[0], end=ends[1], radius=1.0),),
        material=Material(youngs_modulus=POLYMER, poisson_ratio=POISSON_RATIO),
        mobility_accuracy=0.0,
    )


def exact_gaps(shape: str, stiffness: float) -> GapDistribution:
    """Boltzmann's distribution of the gap.

    The rod yields in its two springs, each as stiff as the bead's: their distance has 2/3 of that stiffness. Its tilt
    changes the gap by 10⁻⁴ of its spread. Along an edge the bead is on the quarter circle about it or on a face: room
    is r·π/2 + 2·√(π k_BT/2k).
    """
    bodies = 2 if shape == "rod" else 1
    round_about: Callable[[np.ndarray], np.ndarray] = np.square if shape == "sphere" else np.copy
    if shape == "edge of a box":
        beside = math.sqrt(8.0 * ENERGY / (math.pi * stiffness))
        return spring_gaps(stiffness, hardness(POLYMER, 1.0, bodies=1), ENERGY, 1.0, lambda r: r + beside)
    k = stiffness * 2.0 / 3.0 if shape == "rod" else stiffness
    return spring_gaps(k, hardness(POLYMER, 0.5, bodies=bodies), ENERGY, 2.0, round_about)


def gap_of(shape: str, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(W,) gaps [µm] of poses (W, B, 3) and (W, B, 4)."""
    way = place[:, 0] - PLACE
    if shape == "sphere":
        return np.linalg.norm(way, axis=1) - 2.0
    if shape == "edge of a box":
        return np.linalg.norm(np.maximum(way[:, :2], 0.0), axis=1) - 1.0
    axis = np.array([[0.0, 0.0, 1.0]])
    if shape == "rod":
        x, y, z, w = turn[:, 1].T
        axis = np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
        way = place[:, 0] - place[:, 1]
    return np.linalg.norm(way - np.sum(way * axis, axis=1, keepdims=True) * axis, axis=1) - 2.0


def curved_gap(effort: Effort, *, shape: str, stiffness: float, z: float = 0.2) -> Deviation:
    """Mean gap of a hard bead in a spring onto one of `OBSTACLES`, over its standard deviation; z = k·dt/γ."""
    sim = simulate(
        curved_scene(shape, stiffness, z * drag(1.0, Medium().viscosity) / stiffness), effort, worlds=effort.worlds
    )
    exact, found = exact_gaps(shape, stiffness), []
    advance(sim, 20 + math.ceil(4.0 / z))
    for _ in range(12):
        advance(sim, 4)
        found.append(gap_of(shape, *(a.numpy().astype(float) for a in (sim.state.position, sim.state.orientation))))
    samples = (np.mean(found, axis=0) - exact.mean) / exact.spread
    chance = float(samples.std()) / math.sqrt(len(samples))
    return Deviation(error=float(samples.mean()), standard_error=chance, told=told_of(sim))
