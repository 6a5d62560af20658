"""Scenes drawn at random, and what must hold in any of them: finite numbers, rotations that are rotations, no passing.

A draw has two beads and a rigid robot of two to five spheres between a floor and a box, two traps that jump half way,
and everything else anywhere in the range that a user may ask for: radii, stiffness, adhesion, powers, temperature,
overlaps and time steps. All draws share two compiled steps, with noise and without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from otwarp.bench.scenes import bead, obstacle, scene, spring
from otwarp.bench.stability.thermal import Effort, advance, simulate
from otwarp.bench.stability.verdict import COARSE, Defect, Deviation
from otwarp.scene import Body, Material, Scene, Sphere, Vec3
from otwarp.simulation.simulation import Simulation

MODULUS = (1e2, 3e9)
RADIUS = (0.3, 10.0)
POWER = (0.1, 300.0)
STEP = (0.25, 4.0)
"""Ranges of the draws: Pa, µm, mW, and time step over the chosen one; spread evenly over their logarithms."""

FLOOR = 0.0
BOX = (4.0, 4.0, 1.0)

DEEPEST = 0.5
"""Overlap over the smaller radius from which on a run must have stopped."""

SLACK = 1e-3
"""By which it may be exceeded in float32 coordinates, relative to the smaller radius."""

STEPS = 250
"""Before the traps jump, and after."""

HALVINGS = 6
"""Of the time step at most, until a large error has faded."""


@dataclass(frozen=True, eq=False)
class Draw:
    """A random scene and what happens in it.

    Attributes:
        what: The scene.
        factor: Time step over the chosen one.
        jumps: (2, 3) how far the traps jump half way [µm].
    """

    what: Scene
    factor: float
    jumps: np.ndarray


def logarithmic(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    """A number between two bounds, its logarithm spread evenly."""
    return float(np.exp(rng.uniform(*np.log(bounds))))


def draw(seed: int, *, cold: bool) -> Draw:
    """Scene number `seed`; the same on every machine."""
    rng = np.random.default_rng([20240801, seed, int(cold)])
    bodies = (_bead(rng, "one"), _bead(rng, "two"), _robot(rng))
    traps = tuple(
        spring(_point(np.array(b.position) + rng.normal(0.0, 0.3, 3)), power=logarithmic(rng, POWER), name=f"trap{i}",
               cutoff=logarithmic(rng, (0.5, 30.0)))
        for i, b in enumerate((bodies[0], bodies[2]))
    )  # fmt: skip
    around = (obstacle("plane", place=(0.0, 0.0, FLOOR)), obstacle("box", size=BOX, place=(0.0, 0.0, 12.0)))
    temperature = 0.0 if cold else float(rng.uniform(1.0, 400.0))
    what = scene(*bodies, traps=traps, temperature=temperature, obstacles=around)
    jumps = rng.normal(size=(2, 3))
    jumps *= rng.uniform(0.0, 20.0, (2, 1)) / np.linalg.norm(jumps, axis=1, keepdims=True)
    return Draw(what, logarithmic(rng, STEP), jumps)


def _point(x: np.ndarray) -> Vec3:
    a, b, c = (float(v) for v in x)
    return a, b, c


def _place(rng: np.random.Generator, radius: float) -> Vec3:
    """Somewhere above the floor, in reach of the others; now and then inside them or the box."""
    return _point(np.array([*rng.uniform(-12.0, 12.0, 2), FLOOR + radius + rng.uniform(-0.05 * radius, 6.0)]))


def _material(rng: np.random.Generator) -> Material:
    sticky = rng.random() < 0.5
    return Material(
        youngs_modulus=logarithmic(rng, MODULUS),
        poisson_ratio=float(rng.uniform(0.0, 0.49)),
        adhesion=logarithmic(rng, (1e-2, 10.0)) if sticky else 0.0,
    )


def _bead(rng: np.random.Generator, name: str) -> Body:
    radius = logarithmic(rng, RADIUS)
    return replace(bead(radius, _place(rng, radius), name=name, collides=True), material=_material(rng))


def _robot(rng: np.random.Generator) -> Body:
    """Spheres on a crooked line, each touching the one before."""
    radii = [logarithmic(rng, (0.3, 2.0)) for _ in range(rng.integers(2, 6))]
    offset, spheres = np.zeros(3), []
    for i, radius in enumerate(radii):
        if i:
            way = rng.normal(size=3) + np.array([3.0, 0.0, 0.0])
            offset = offset + way / np.linalg.norm(way) * (radii[i - 1] + radius)
        spheres.append(Sphere(prim=f"/World/robot/sphere{i}", offset=_point(offset), radius=radius))
    turn = rng.normal(size=4)
    x, y, z, w = (float(v) for v in turn / np.linalg.norm(turn))
    body = Body(prim="/World/robot", spheres=tuple(spheres), material=_material(rng), mobility_accuracy=0.0)
    return replace(body, position=_place(rng, 3.0), orientation=(x, y, z, w))


def run_draw(effort: Effort, seed: int, *, cold: bool) -> Deviation | None:
    """Run a draw. Without noise the error is what halving the time step changes, over the smallest radius.

    With noise there is nothing to compare with: None.

    A bead that balances on an edge may go the other way at another step, and then ends elsewhere: an error of any size
    is a stated one if it fades as the step is halved further.
    """
    drawn = draw(seed, cold=cold)
    before = _run(effort, drawn, 1)
    if not cold:
        return None
    smallest = min(s.radius for b in drawn.what.bodies for s in b.spheres)
    changes: list[float] = []
    for halving in range(1, HALVINGS + 1):
        after = _run(effort, drawn, 2**halving)
        changes.append(float(np.linalg.norm(after - before, axis=-1).max()) / smallest)
        before = after
        if changes[-1] <= max(0.25 * changes[0], COARSE):
            return Deviation(error=changes[0], predicted=changes[0])
    raise Defect(f"halving the time step again and again moves the end by {changes} of the smallest radius")


def _run(effort: Effort, drawn: Draw, finer: int) -> np.ndarray:
    """(B, 3) places at the end."""
    chosen = simulate(drawn.what, effort).time_step
    sim = simulate(drawn.what, effort, time_step=drawn.factor * chosen / finer)
    focus = sim.control.trap_position.numpy()[0].astype(float)
    advance(sim, STEPS * finer)
    check_overlaps(sim)
    sim.control.set(trap_position=focus + drawn.jumps)
    advance(sim, STEPS * finer)
    check_overlaps(sim)
    if not np.all(np.isfinite(sim.readout.contact_force.numpy())):
        raise Defect("a contact force is not finite")
    return sim.state.position.numpy()[0].astype(float)


def check_overlaps(sim: Simulation) -> None:
    """Raise `Defect` for spheres that are deeper in each other, the floor or the box than a run may go on with."""
    place, turn = sim.prim_poses()
    spheres = [
        (b, s.radius, place[0, b] + _turned(turn[0, b], np.array(s.offset)))
        for b, body in enumerate(sim.scene.bodies)
        for s in body.spheres
    ]
    for n, (a, radius, centre) in enumerate(spheres):
        box = np.array([0.0, 0.0, 12.0])
        outside = np.linalg.norm(np.maximum(np.abs(centre - box) - BOX, 0.0))
        inside = np.min(np.array(BOX) - np.abs(centre - box))
        gaps = {"floor": (centre[2] - FLOOR - radius, radius), "box": (outside - max(inside, 0.0) - radius, radius)}
        for b, other, there in spheres[:n]:
            if a != b:
                gaps[sim.scene.bodies[b].prim] = (np.linalg.norm(centre - there) - radius - other, min(radius, other))
        for name, (gap, small) in gaps.items():
            if gap < -(DEEPEST + SLACK) * small:
                raise Defect(
                    f"a sphere of {sim.scene.bodies[a].prim} of radius {radius:.3g} µm is {-gap:.3g} µm deep in {name}"
                )


def _turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A vector (3,) turned by a quaternion (x, y, z, w)."""
    t = 2.0 * np.cross(q[:3], v)
    return v + q[3] * t + np.cross(q[:3], t)
