"""Smooth journeys: a curve through waypoints travelled at constant speed with soft start and stop."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Track

SAMPLES_PER_SECOND = 20.0
"""Time samples authored per second: a divisor of 60, so that they fall on whole frames."""


def curve_through(waypoints: np.ndarray, *, points_per_leg: int = 400) -> np.ndarray:
    """Points on a Catmull–Rom curve through waypoints.

    Args:
        waypoints: (n, 3) µm.
        points_per_leg: Points between two waypoints.

    Returns:
        ((n − 1)·points_per_leg + 1, 3) points [µm].
    """
    p = np.vstack([2 * waypoints[0] - waypoints[1], waypoints, 2 * waypoints[-1] - waypoints[-2]])
    u = (np.arange(points_per_leg) / points_per_leg)[:, None]
    legs = []
    for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True):
        legs.append(b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a))))
    return np.vstack([*legs, waypoints[-1:]])


def arc_length(curve: np.ndarray) -> np.ndarray:
    """(n,) length [µm] of a polyline (n, 3) from its first point."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])


def journey(curve: np.ndarray, *, rest: float, ramp: float, cruise: float, settle: float) -> Track:
    """Displacement along a curve: rest, gather speed, cruise, slow down, settle.

    The speed follows sin² over the ramps, so the acceleration is continuous.

    Args:
        curve: (n, 3) points [µm].
        rest, ramp, settle: Seconds at rest at the start, of each ramp, and at rest at the end.
        cruise: Speed between the ramps [µm/s].

    Returns:
        Samples (m, 3) of the displacement from the first point [µm], `SAMPLES_PER_SECOND` of them per second.
    """
    length = arc_length(curve)
    steady = length[-1] / cruise - ramp
    if steady < 0.0:
        raise ValueError(f"cruise = {cruise} µm/s: a ramp of {ramp} s needs a curve longer than {cruise * ramp} µm")
    duration = np.ceil((rest + 2 * ramp + steady + settle) * SAMPLES_PER_SECOND) / SAMPLES_PER_SECOND
    times = np.arange(round(duration * SAMPLES_PER_SECOND) + 1) / SAMPLES_PER_SECOND
    t = np.clip(times - rest, 0.0, 2 * ramp + steady)
    up, down = np.minimum(t, ramp), np.maximum(t - ramp - steady, 0.0)
    level = t - up - down
    wave = ramp / (2 * np.pi) * (np.sin(2 * np.pi * down / (2 * ramp)) - np.sin(2 * np.pi * up / (2 * ramp)))
    travelled = cruise * (up / 2 + level + down / 2 + wave)
    values = np.stack([np.interp(travelled, length, column) for column in curve.T], axis=1) - curve[0]
    return Track(times=np.round(times, 6), values=np.round(values, 6) + 0.0)


def swing(start: np.ndarray, sway: np.ndarray, *, period: float, phase: float, duration: float) -> Track:
    """A position that swings as a sine about `start` with amplitude `sway` (both (3,) µm).

    Args:
        start: Middle of the swing [µm].
        sway: Amplitude [µm].
        period: Seconds per swing.
        phase: Part of a period by which it is ahead at time 0 [1].
        duration: Length of the track [s].
    """
    times = np.arange(round(duration * SAMPLES_PER_SECOND) + 1) / SAMPLES_PER_SECOND
    wave = np.sin(2 * np.pi * (times / period + phase))
    values = np.asarray(start, dtype=float) + wave[:, None] * np.asarray(sway, dtype=float)
    return Track(times=np.round(times, 6), values=np.round(values, 6) + 0.0)
