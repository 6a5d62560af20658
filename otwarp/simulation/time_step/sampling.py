"""Samples of traps and obstacles against the step: how far a step sees them go astray, and the step that prevents it.

A spring feels the whole course of a focus within a step (`packing.commands`). What bends a force does not: a focus that
is spread by σ within a step changes the mean force of a law that bends over a length ℓ by about 3 σ²/ℓ². Obstacles, and
foci with a speed limit, are only where they are at the ends of steps: between, their way is taken to be straight.
Both count as means over a second, so that one leap among many steps asks for nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from otwarp.kernels.integrate.integrators import PROMISED
from otwarp.scene import Obstacle, Scene
from otwarp.simulation.packing.bodies import obstacle_bound
from otwarp.simulation.packing.commands import Course, Samples, interpolated, sampled_commands
from otwarp.simulation.packing.traps import law
from otwarp.simulation.time_step.observables import ErrorSource
from otwarp.simulation.time_step.speeds import places

ASTRAY = 0.01
"""Largest distance between the way of an obstacle and its chord in a step, over the smallest radius that collides; of a
focus with a speed limit, over the smallest trapped radius."""

SHORTEST = 1e-3
"""No step is asked to be shorter than this part of the median interval of the samples."""


def second_means(course: Course, values: np.ndarray, step: float) -> float:
    """Largest mean over a second of `values` (m,), one for each step of a course; 0 in all others."""
    if not len(values):
        return 0.0
    second = np.floor(course.step * step).astype(np.int64)
    second -= second.min()
    length = min(1.0, (course.step[-1] - course.step[0] + 1) * step)
    return float(np.bincount(second, values).max()) * step / length


def spread2(samples: Samples, step: float) -> float:
    """Mean square of the spread of a focus within steps [µm²], over the second in which it is largest."""
    course = Course.of(*samples, step)
    return second_means(course, np.maximum(course.square - course.mean**2, 0.0)[:, :3].sum(axis=1), step)


def astray2(samples: Samples, step: float) -> float:
    """Mean square of the distance from the chord within steps [µm²], over the second in which it is largest."""
    times, values = samples
    course = Course.of(times, values, step)
    number = np.floor(times / step).astype(np.int64)
    row = np.searchsorted(course.step, number)
    known = (row < len(course.step)) & (number >= 0)
    row, part = row[known], (times / step - number)[known, None]
    chord = course.first[row] + part * (course.last[row] - course.first[row])
    worst = np.zeros(len(course.step))
    np.maximum.at(worst, row, ((values[known] - chord) ** 2).sum(axis=1))
    return second_means(course, worst, step)


def bend(scene: Scene, t: int) -> float:
    """Length over which the force of a trap bends [µm]: to threshold or end, for the smallest trapped sphere."""
    curves = [law(scene.traps[t])] + ([axial] if (axial := scene.traps[t].axial) else [])
    radius = min((s.radius for b in scene.bodies for s in b.spheres if s.trapped), default=0.0)
    return min(min(c.threshold, c.cutoff) * (radius / c.radius if c.radius > 0.0 else 1.0) for c in curves)


def way_of(obstacle: Obstacle, reached: np.ndarray) -> Samples:
    """Times, and (k, 7) place [µm] and orientation as what its farthest point moves by it."""
    times = np.union1d(obstacle.position.times, obstacle.orientation.times)
    arm = obstacle_bound(obstacle.shape, obstacle.size, obstacle.vertices)
    if obstacle.shape == "plane":
        arm = max(float(np.linalg.norm(reached - p, axis=1).max()) for p in obstacle.position.values)
    turns = np.array(obstacle.orientation.values, dtype=float)
    flips = np.cumprod(np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    turns[1:] *= flips[:, None]
    place = interpolated(obstacle.position.times, obstacle.position.values, times)
    return times, np.concatenate([place, 2.0 * arm * interpolated(obstacle.orientation.times, turns, times)], axis=1)


def in_samples(scene: Scene, values: Mapping[str, np.ndarray], *, contacts: bool, longest: float) -> list[ErrorSource]:
    """What sampled commands and obstacles are falsified by a step, up to the step `longest` [s] that matters."""
    accuracy, watched = scene.settings.accuracy, []
    limits = values["trap_speed_limit"].min(axis=0)
    trapped = [s.radius for b in scene.bodies for s in b.spheres if s.trapped]
    for t, samples in enumerate(sampled_commands(scene)):
        if not scene.traps[t].position.animated or not trapped:
            continue
        size2 = bend(scene, t) ** 2
        error = partial(_relative, spread2, samples, size2 / 3.0)
        watched.append(
            _row("commands", "samples of traps and wanted accuracy", error, PROMISED * accuracy, samples, longest)
        )
        if math.isfinite(limits[t]):
            error = partial(_relative, astray2, samples, (ASTRAY * min(trapped)) ** 2 / accuracy)
            watched.append(_row("commands", "samples of traps with a speed limit", error, accuracy, samples, longest))
    moving = [o for o in scene.obstacles if contacts and (o.position.animated or o.orientation.animated)]
    if moving:
        small, reached = min(e.radius for b in scene.bodies for e in b.colliding), places(scene, values)
        for samples in (way_of(o, reached) for o in moving):
            error = partial(_relative, astray2, samples, (ASTRAY * small) ** 2 / accuracy)
            watched.append(_row("obstacles", "samples of obstacles", error, accuracy, samples, longest))
    return watched


def _relative(of: Callable[[Samples, float], float], samples: Samples, scale: float, step: float) -> float:
    return of(samples, step) / scale


def _row(
    name: str, limit: str, error: Callable[[float], float], allowed: float, samples: Samples, longest: float
) -> ErrorSource:
    """A row whose longest step is found from above, for errors grow with the step only on the whole."""
    least = SHORTEST * float(np.median(np.diff(samples[0])))
    step = longest
    while step > least and error(step) > allowed:
        step *= 0.8
    return ErrorSource(name=name, error=error, longest=math.inf if step == longest else max(step, least), limit=limit)
