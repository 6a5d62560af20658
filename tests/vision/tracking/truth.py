"""Bodies of simulated worlds, measured with known noise, and what trackers make of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.scene import Scene
from otwarp.scene.transforms import rotation_matrix
from otwarp.simulation import Simulation
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.consistency import Consistency, consistency, error_correlation, squared_error
from otwarp.vision.tracking.measurement import Measurement, tilt_and_azimuth
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.rotations import difference, exponential
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.tracker import Pose, Tracker

NOISE = np.array([0.03, 0.03, 0.06, 0.03, 0.03])
"""Standard deviations of x, y, z [µm], tilt and azimuth [rad]."""


@dataclass(frozen=True, eq=False)
class Looks:
    """Worlds followed by trackers.

    Attributes:
        nees, nis: Per degree of freedom.
        raw, filtered: (n, 3) errors of the centre [µm].
        trackers: One for each world.
    """

    nees: Consistency
    nis: Consistency
    raw: np.ndarray
    filtered: np.ndarray
    trackers: list[Tracker]


def measured(
    rng: np.random.Generator, time: float, shape: Shape, place: np.ndarray, turn: np.ndarray, noise: np.ndarray
) -> Measurement:
    """A pose of a prim with noise drawn for it; a ball has no axis."""
    covariance = np.diag(NOISE**2)
    off = noise * rng.standard_normal(5)
    if not np.any(shape.axis):
        return Measurement(time=time, position=place + off[:3], covariance=covariance[:3, :3])
    axis = rotation_matrix(turn) @ shape.axis
    leaning = exponential(tilt_and_azimuth(axis, np.array([0.0, 0.0, 1.0])).T @ off[3:])
    seen = rotation_matrix(leaning) @ axis
    return Measurement(time=time, position=place + off[:3], axis=seen, covariance=covariance)


def whitened_error(pose: Pose, shape: Shape, centre: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """What is seen of the difference of truth and estimate, in standard deviations that are independent of each other.

    Args:
        pose: Estimated.
        shape: Of the body.
        centre: (3) where it is [µm].
        turn: (4) quaternion of it.
    """
    nearest = shape.nearest(turn, pose.orientation)
    error = np.concatenate([centre - pose.belief.position, difference(nearest, pose.orientation)])
    seeable = shape.visible(pose.orientation)
    spread = np.linalg.cholesky(seeable @ pose.belief.covariance @ seeable.T)
    return np.linalg.solve(spread, seeable @ error)


def followed(
    scene: Scene,
    *,
    worlds: int,
    frames: int,
    interval: float,
    seed: int,
    noise: float = 1.0,
    drop: float = 0.0,
    settle: int = 10,
    commanded: Callable[[float], np.ndarray] | None = None,
) -> Looks:
    """Simulate a scene's first body, measure it and track it in every world.

    Args:
        scene: The scene.
        worlds: Independent copies.
        frames: Measurements of each.
        interval: Between them [s].
        seed: Of simulation and measurements.
        noise: Factor between the noise drawn and the noise stated.
        drop: Probability that a frame is lost.
        settle: First frames that do not count.
        commanded: Positions (T, 3) of the traps by time [µm], as of each frame; None: as the scene says.
    """
    name = scene.bodies[0].name
    body = MobileBody(scene, name)
    shape = Shape.of(scene, scene.bodies[0].name, body.reference)
    sim, rng = Simulation(scene, worlds=worlds, seed=seed, device="cpu"), np.random.default_rng(seed)
    trackers = [Tracker(body, shape, Commands.of_scene(scene)) for _ in range(worlds)]
    nees, nis, whitened, raw, filtered, degrees = [], [], [], [], [], 3
    for _ in range(frames):
        if commanded is not None:
            position = commanded(sim.time)
            sim.control.set(trap_position=position)
            for tracker in trackers:
                tracker.command(sim.time, position=position)
        sim.run(interval)
        places, turns = sim.prim_poses()
        centres = sim.state.position.numpy().astype(float)
        rows = []
        for w, tracker in enumerate(trackers):
            seen = measured(rng, sim.time, shape, places[w, 0], turns[w, 0], noise * NOISE)
            kept = rng.random() >= drop or tracker.time is None
            update = tracker.add(seen) if kept else None
            pose = tracker.predict(sim.time)
            value, degrees = squared_error(pose.belief, shape, centres[w, 0], turns[w, 0])
            whole = whitened_error(pose, shape, centres[w, 0], turns[w, 0])
            rows.append((value, np.nan if update is None else update.nis, whole))
            raw.append(seen.position - places[w, 0])
            filtered.append(pose.position - places[w, 0])
        for series, row in zip((nees, nis, whitened), zip(*rows, strict=True), strict=True):
            series.append(row)
    squares, innovations = np.array(nees)[settle:].T, np.array(nis)[settle:].T
    correlation = error_correlation(np.array(whitened)[settle:].swapaxes(0, 1))
    return Looks(
        consistency(squares, degrees, correlation=correlation),
        consistency(innovations[np.isfinite(innovations)], degrees),
        np.array(raw)[settle * worlds :], np.array(filtered)[settle * worlds :], trackers,
    )  # fmt: skip
