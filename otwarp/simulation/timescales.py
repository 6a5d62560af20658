"""Relaxation rates of a scene and the time step that follows from them and the wanted accuracy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.scene.description import Body, Scene, Trap
from otwarp.simulation.pack_traps import beam_axis, equilibrium_point, law_reach, rotate
from otwarp.units import BOLTZMANN

STABLE_PRODUCT = 2.0
"""Largest rate × time step for which the explicit step of a linear spring is stable."""

TRAVEL_FRACTION = 0.1
"""Largest displacement per step of anything that collides, relative to the smallest colliding radius."""


@dataclass(frozen=True, kw_only=True)
class TimeScales:
    """What limits the time step; times in s, `None` where the scene has no such process.

    Attributes:
        trap_relaxation: Fastest relaxation in the traps, 1/rate.
        stiffest_body: Name of the body it belongs to.
        diffusion: Time to diffuse `TRAVEL_FRACTION` of the smallest colliding radius.
        travel: Time in which the fastest trap, obstacle or flow moves by that much.
        time_step: Step in use.
        largest_stable: Largest stable step, inf without traps.
        variance_error: Predicted relative error of stationary variances, rate·dt/2 to first order.
        chosen_by: What decided the step; never longer than a frame.
    """

    trap_relaxation: float | None
    stiffest_body: str | None
    diffusion: float | None
    travel: float | None
    time_step: float
    largest_stable: float
    variance_error: float
    chosen_by: str


def _stiffness(trap: Trap, power: float, radius: float, curves: tuple[float, float]) -> np.ndarray:
    """(3, 3) stiffness of a trap near its equilibrium [pN/µm]."""
    scale = trap.radial.radius / radius if trap.radial.radius > 0.0 else 1.0
    axis = beam_axis(trap)
    along = np.outer(axis, axis)
    return power * scale * (curves[0] * (np.eye(3) - along) + curves[1] * along)


def _body_rate(
    scene: Scene, body: Body, move: BodyMobility, powers: np.ndarray, curves: np.ndarray, viscosity: float
) -> float:
    """Fastest relaxation rate of a body held by the traps around it at the start [1/s].

    Each trap acts on the nearest sphere it can reach; a lone sphere in the strongest trap is the least that counts,
    because a sphere may enter a trap later.
    """
    spheres = [s for s in body.spheres if s.trapped]
    if not spheres:
        return 0.0
    total, worst = np.zeros((6, 6)), 0.0
    offsets = rotate(np.array(body.orientation), np.array([s.offset for s in spheres]))
    reference = rotate(np.array(body.orientation), move.reference)
    for i, trap in enumerate(scene.traps):
        gaps = np.linalg.norm(np.array(body.position) + offsets - equilibrium_point(trap), axis=1)
        nearest = int(np.argmin(gaps))
        radius = spheres[nearest].radius
        k = _stiffness(trap, powers[i], radius, (curves[0, i], curves[1, i]))
        worst = max(worst, float(np.linalg.eigvalsh(k).max()) * move.mobility[0, 0] / viscosity)
        if gaps[nearest] <= law_reach(trap, radius):
            arm = offsets[nearest] - reference
            cross = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
            lever = np.hstack([np.eye(3), -cross])
            total += lever.T @ k @ lever
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotate(np.array(body.orientation), np.eye(3)).T
    mobility = turn @ move.mobility @ turn.T / viscosity
    return max(worst, float(np.linalg.eigvals(mobility @ total).real.max()))


def _fastest_motion(scene: Scene, flow_speed: float) -> float:
    """Fastest prescribed motion in the scene [µm/s]."""
    speeds = [flow_speed]
    for item in (*scene.traps, *scene.obstacles):
        times, places = item.position.times, item.position.values
        if len(times) > 1:
            speed = float((np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)).max())
            speeds.append(min(speed, getattr(item, "speed_limit", math.inf)))
    return max(speeds)


def _stiffest(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], viscosity: float
) -> tuple[float, str | None]:
    """Fastest relaxation rate in the traps [1/s] over all bodies, worlds and times, and the body it belongs to."""
    if not scene.traps:
        return 0.0, None
    powers = np.maximum(values["trap_power"].max(axis=0), [t.power.values.max() for t in scene.traps])
    curves = np.array([values["trap_stiffness"].max(axis=0), values["trap_axial_stiffness"].max(axis=0)])
    rates = [
        _body_rate(scene, body, move, powers, curves, viscosity) for body, move in zip(scene.bodies, moves, strict=True)
    ]
    first = int(np.argmax(rates))
    return float(rates[first]), scene.bodies[first].name if rates[first] > 0.0 else None


def _travel_times(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], viscosity: float
) -> tuple[float | None, float | None]:
    """Times to diffuse and to be moved `TRAVEL_FRACTION` of the smallest colliding radius [s]."""
    small = TRAVEL_FRACTION * min(s.radius for b in scene.bodies for s in b.spheres if s.collides)
    hot = float(values["medium_temperature"].max()) if scene.settings.brownian else 0.0
    spread = max(BOLTZMANN * hot * m.mobility[0, 0] / viscosity for m in moves)
    fastest = _fastest_motion(scene, float(np.abs(values["flow_speed"]).max()) if scene.flow else 0.0)
    return (
        float(small**2 / (2.0 * spread)) if spread > 0.0 else None,
        float(small / fastest) if fastest > 0.0 else None,
    )


def time_scales(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], *, contacts: bool, wanted: float | None
) -> TimeScales:
    """Time scales of a scene and its step; `values` are the `(1|W, …)` parameters of `parameters.PARAMETERS`.

    The explicit step samples a spring of rate k with a variance too large by the factor 1/(1 − k·dt/2), so
    dt = 2·accuracy/k gives the wanted relative error in the stiffest mode and less in all others.

    Args:
        contacts: Whether anything can touch anything.
        wanted: Explicit time step [s], or None.

    Raises:
        InputError: An explicit step that is not positive, or unstable; the message names the largest stable one.
    """
    viscosity = float(values["medium_viscosity"].min())
    rate, stiffest = _stiffest(scene, moves, values, viscosity)
    diffusion, travel = _travel_times(scene, moves, values, viscosity) if contacts else (None, None)
    limits = {
        "trap relaxation and wanted accuracy": 2.0 * scene.settings.accuracy / rate if rate > 0.0 else math.inf,
        "diffusion of the smallest colliding sphere": diffusion or math.inf,
        "fastest prescribed motion": travel or math.inf,
        "frame interval": 1.0 / scene.settings.frames_per_second,
    }
    chosen_by = min(limits, key=lambda name: limits[name])
    step = limits[chosen_by]
    stable = STABLE_PRODUCT / rate if rate > 0.0 else math.inf
    if wanted is not None:
        if not 0.0 < wanted < math.inf:
            raise InputError(f"time step is {wanted:g} s; allowed: above 0 and below {stable:.4g} s")
        if wanted >= stable:
            raise InputError(
                f"time step {wanted:g} s is unstable: body {stiffest} relaxes at {rate:.4g} 1/s; "
                f"allowed: above 0 and below {stable:.4g} s"
            )
        step, chosen_by = wanted, "set by the user"
    return TimeScales(
        trap_relaxation=1.0 / rate if rate > 0.0 else None,
        stiffest_body=stiffest,
        diffusion=diffusion,
        travel=travel,
        time_step=step,
        largest_stable=stable,
        variance_error=0.5 * rate * step / (1.0 - 0.5 * rate * step),
        chosen_by=chosen_by,
    )
