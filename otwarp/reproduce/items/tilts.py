"""How a robot lies between two traps: runs of a scene of the motion studies, and the balance of its optical forces."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.haptics.force.law import SplitLaw
from otwarp.laws import TrapLaw
from otwarp.reproduce.item import Request
from otwarp.scene import Body, Scene, Trap
from otwarp.scene.transforms import rotate

SAMPLES = 40
"""Moments over which a run at rest is averaged."""

SETTLE, APART = 0.6, 0.02
"""Simulated time before the first of them, and from one to the next [s]: many relaxation times of the scenes, which are
some milliseconds away from the fork."""

RELAX = 30.0
"""How long a balance is approached, at 1 µm/s per pN [s]: stiffnesses are some pN/µm."""

NEAR = 1e-2
"""How far the search for roots may move from where that ends [µm, rad]."""


@dataclass(frozen=True, eq=False)
class Tilts:
    """Tilts in runs.

    Attributes:
        spacing: (n) between the traps [µm].
        angle: (n, W) of the line between the held spheres out of the focal plane [°], signed.
        size: (n, W) its magnitude; of runs at rest the mean over moments, as `angle` is.
    """

    spacing: np.ndarray
    angle: np.ndarray
    size: np.ndarray


def held(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(3,) offsets in the robot's frame of the spheres that the two traps are meant to hold [µm]."""
    offsets = {s.prim: np.array(s.offset) for s in scene.bodies[0].spheres}
    first, second = (offsets[str(trap.holds)] for trap in scene.traps)
    return first, second


def length(scene: Scene) -> float:
    """L, between the held spheres [µm]."""
    first, second = held(scene)
    return float(np.linalg.norm(second - first))


def moving(request: Request, scene: Scene, worlds: int, *, power: np.ndarray | None = None) -> Tilts:
    """The scene as it is authored, traps moving.

    Args:
        request: What is asked for.
        scene: Of two traps and a robot.
        worlds: Independent runs.
        power: (2) of the traps [mW]; None for the authored ones.
    """
    from otwarp.simulation.simulation import Simulation

    parameters = None if power is None else {"trap_power": power[None, :]}
    sim = Simulation(scene, worlds=worlds, seed=request.seed, device=request.device, parameters=parameters,
                     readout=True)  # fmt: skip
    line = np.subtract(*reversed(held(scene)))
    spacing, angle = [], []
    frames = round(scene.settings.duration * scene.settings.frames_per_second)
    for frame in range(frames + 1):
        sim.run(frame / scene.settings.frames_per_second - sim.time)
        if frame % 60 == 0:
            request.say(f"moving traps, {sim.time:.1f} s")
        angle.append(_angles(sim, line))
        spacing.append(float(np.linalg.norm(np.subtract(*sim.readout.trap_position.numpy()[0]))))
    return Tilts(np.array(spacing), np.array(angle), np.abs(angle))


def resting(
    request: Request,
    scene: Scene,
    spacing: np.ndarray,
    angle: np.ndarray,
    worlds: int,
    *,
    power: np.ndarray,
    both: bool,
) -> Tilts:
    """Traps at rest: the tilt of every run, averaged over `SAMPLES` moments.

    Args:
        request: What is asked for.
        scene: Of two traps and a robot.
        spacing: (n) between the traps [µm].
        angle: (n) at which the runs start [°].
        worlds: Runs for each spacing.
        power: (2) of the traps [mW].
        both: Whether every other run starts turned the other way.
    """
    from otwarp.simulation.simulation import Simulation

    many = len(spacing) * worlds
    foci, middle = _foci(scene, np.repeat(spacing, worlds))
    sim = Simulation(scene, worlds=many, seed=request.seed, device=request.device,
                     parameters={"trap_position": foci, "trap_power": power[None, :]})  # fmt: skip
    line = np.subtract(*reversed(held(scene)))
    signs = np.tile(np.resize([1.0, -1.0 if both else 1.0], worlds), len(spacing))
    turns = np.stack([_turned(line, float(a)) for a in signs * np.repeat(angle, worlds)])
    # the reference point of a symmetric robot is the middle of the held spheres up to what the run forgets
    sim.set_state(position=np.repeat(middle[None, None], many, 0), orientation=turns[:, None])
    sim.run(SETTLE)
    seen = np.empty((SAMPLES, many))
    for sample in range(SAMPLES):
        sim.run(APART)
        seen[sample] = _angles(sim, line)
    angle, size = (values.mean(0).reshape(len(spacing), worlds) for values in (seen, np.abs(seen)))
    return Tilts(np.asarray(spacing), angle, size)


def _angles(sim: object, line: np.ndarray) -> np.ndarray:
    """(W) tilts [°] of a line that is fixed to the robot."""
    turned = rotate(sim.prim_poses()[1][:, 0], line)  # type: ignore[attr-defined]
    return np.degrees(np.arcsin(np.clip(turned[:, 2] / np.linalg.norm(line), -1.0, 1.0)))


def _foci(scene: Scene, spacing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2, 3) foci so far apart on the authored line [µm], and (3,) where their middle is."""
    first, second = (trap.position.values[0] for trap in scene.traps)
    middle, way = 0.5 * (first + second), (second - first) / np.linalg.norm(second - first)
    half = 0.5 * spacing[:, None, None] * np.array([[-1.0], [1.0]]) * way
    return middle + half, middle


def _turned(line: np.ndarray, degrees: float) -> np.ndarray:
    """(4,) quaternion that lifts the end of a line in the plane by so much."""
    level = np.array([line[0], line[1], 0.0]) / np.hypot(line[0], line[1])
    axis, half = np.cross(level, [0.0, 0.0, 1.0]), 0.5 * math.radians(degrees)
    return np.append(math.sin(half) * axis, math.cos(half))


def per_sphere(trap: Trap, radius: float) -> SplitLaw:
    """Eq. 1 of a trap with two curves, per mW, for a sphere of a radius [µm]."""
    curves: Sequence[TrapLaw] = [curve.for_radius(radius).per_mw() for curve in (trap.radial, trap.axial) if curve]
    if trap.model == "harmonic":
        curves = [dataclasses.replace(curve, threshold=curve.cutoff) for curve in curves]
    return SplitLaw(curves[0], curves[1], equilibrium=trap.equilibrium)


def balance(scene: Scene, spacing: float, power: np.ndarray, guess: float) -> float:
    """Tilt [°] at which the forces of eq. 1, summed by eq. 2, and their torque vanish, in float64 and without noise.

    The robot may shift along the line of the traps and along the beam, and turn in the plane of both.

    Args:
        scene: Of two traps and a robot that is symmetric about that plane.
        spacing: Between the traps [µm].
        power: (2) [mW].
        guess: Tilt near which the balance is looked for [°].
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import root

    body: Body = scene.bodies[0]
    (foci,), middle = _foci(scene, np.array([spacing]))
    first, second = held(scene)
    line, centre = second - first, 0.5 * (first + second)
    along = np.append(line[:2] / np.hypot(*line[:2]), 0.0)
    up, axis = np.array([0.0, 0.0, 1.0]), np.cross(along, [0.0, 0.0, 1.0])
    spheres = [(np.array(s.offset) - centre, s.radius) for s in body.spheres if s.trapped]
    laws = [[per_sphere(trap, radius) for _, radius in spheres] for trap in scene.traps]

    def left(unknown: np.ndarray) -> np.ndarray:
        """Forces along the two directions and the torque over half the length, at shifts [µm] and a tilt [rad]."""
        place = middle + unknown[0] * along + unknown[1] * up
        arms = rotate(_turned(line, math.degrees(unknown[2])), np.array([arm for arm, _ in spheres]))
        force, torque = np.zeros(3), np.zeros(3)
        for focus, watts, own in zip(foci, power, laws, strict=True):
            for arm, law in zip(arms, own, strict=True):
                pull = watts * np.array(law.pull(*focus, [tuple(place + arm)]))  # type: ignore[arg-type]
                force, torque = force + pull, torque + np.cross(arm, pull)
        return np.array([force @ along, force @ up, torque @ axis / (0.5 * np.linalg.norm(line))])

    # overdamped motion leads to a stable balance and over no barrier, which a search for roots alone may miss; at the
    # guessed tilt first, so that the robot is where it would be with it
    free = np.array([1.0, 1.0, 2.0 / np.linalg.norm(line)])
    place = np.array([0.0, 0.0, math.radians(guess)])
    for way in (free * [1.0, 1.0, 0.0], free):
        motion = solve_ivp(
            lambda _, x, way=way: way * left(x), (0.0, RELAX), place, method="LSODA", rtol=1e-5, atol=1e-6
        )
        place = motion.y[:, -1]
    found = root(left, place, tol=1e-10)
    near = bool(np.all(np.abs(found.x - place) < NEAR))
    return math.degrees(found.x[2] if found.success and near else place[2])
