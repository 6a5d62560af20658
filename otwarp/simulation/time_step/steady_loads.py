"""How strong the forces of `FORCES` are whatever the traps do: what time steps, walls and the teleop budget count on.

A built-in force says it itself, or states bounds; of a user's force without them it is measured, in float64, where
bodies start and traps go.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.body_forces.body_force import BodyForce, Bound
from otwarp.kernels.core.features import Features
from otwarp.kernels.forces.force import BodyFacts, Load
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Scene
from otwarp.simulation.packing.bodies import is_rigid, union_volume, weight
from otwarp.simulation.packing.forces import ActiveForces
from otwarp.simulation.packing.parameters import values_of
from otwarp.simulation.time_step.force_probe import measured_loads


def stated_loads(
    scene: Scene, values: Mapping[str, np.ndarray], features: Features, moves: list[BodyMobility] | None = None
) -> list[Load]:
    """Loads of all bodies by the rows of `FORCES` that say it themselves.

    Args:
        values: The `(1|W, …)` parameters of the scene.
        features: Of the model, by which rows are active.
        moves: Mobilities of the bodies; without them torques are left out.
    """
    rows = [row.load for row in FORCES.values() if row.load is not None and row.active(features)]
    if not rows:
        return [Load()] * len(scene.bodies)
    loads = []
    for b, body in enumerate(scene.bodies):
        arm = 0.0
        if moves is not None and is_rigid(body):
            arm = float(np.linalg.norm(union_volume(body)[1] - moves[b].reference))
        facts = BodyFacts(weight(scene, body), arm, body, values_of(values, b))
        first, *rest = (load(facts) for load in rows)
        loads.append(sum(rest, start=first))
    return loads


def steady_loads(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    features: Features,
    active: ActiveForces,
    device: wp.Device,
) -> list[Load]:
    """Loads of all bodies by all forces but traps.

    Args:
        moves: Mobilities of the bodies.
        values: The `(1|W, …)` parameters of the scene.
        features: Of the model, by which built-in forces are active.
        active: The forces with parameters.
        device: Where forces are measured that state no bounds.

    Returns:
        Bounds per body; of measured forces the largest values that were seen.
    """
    loads = stated_loads(scene, values, features, moves)
    for index, body_force in enumerate(active.body_forces):
        more = _stated(active, index, moves, scene)
        if body_force.slope is None or body_force.load is None or body_force.turns:
            seen = measured_loads(scene, moves, values, active, index, device)
            more = [_completed(m, s, body_force) for m, s in zip(more, seen, strict=True)]
        loads = [a + b if acts else a for a, b, acts in zip(loads, more, active.acts[index], strict=True)]
    return loads


def _completed(stated: Load, seen: Load, body_force: BodyForce) -> Load:
    """What a force states, and what was measured where it states nothing; nobody states torques of its own."""
    return Load(
        force=seen.force if body_force.load is None else stated.force,
        torque=max(stated.torque, seen.torque) if body_force.load is None or body_force.turns else stated.torque,
        rate=seen.rate if body_force.slope is None else max(stated.rate, seen.rate * body_force.turns),
    )


def _stated(active: ActiveForces, index: int, moves: list[BodyMobility], scene: Scene) -> list[Load]:
    """Loads by what a force states about itself, 0 where it states nothing."""
    body_force, bodies = active.body_forces[index], len(moves)
    values = active.parameters_of(index)
    force = _bound(f"load of force {body_force.name}", body_force.load, values, bodies)
    slope = _bound(f"slope of force {body_force.name}", body_force.slope, values, bodies)
    loads = []
    for b, (body, move) in enumerate(zip(scene.bodies, moves, strict=True)):
        if body_force.acts_on == "spheres":
            arms = [float(np.linalg.norm(np.array(s.offset) - move.reference)) for s in body.spheres]
            levers = [_lever(np.array(s.offset) - move.reference) for s in body.spheres]
            give = float(np.linalg.norm(sum(j.T @ j for j in levers) @ move.mobility, 2))
            loads.append(Load(force=len(arms) * force[b], torque=sum(arms) * force[b], rate=slope[b] * give))
        else:
            loads.append(Load(force=force[b], rate=slope[b] * float(np.linalg.norm(move.mobility[:3, :3], 2))))
    return loads


def _lever(arm: np.ndarray) -> np.ndarray:
    """(3, 6) velocity of a point at `arm` from the reference by velocity and angular velocity."""
    x, y, z = arm
    return np.hstack([np.eye(3), -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])])


def _bound(what: str, bound: Bound | None, values: Mapping[str, np.ndarray], bodies: int) -> np.ndarray:
    """(B,) the largest value of a bound in any world, 0 for None.

    Raises:
        InputError: A user's function that fails, or that gives something else than a number for each body.
    """
    if bound is None:
        return np.zeros(bodies)
    try:
        found = np.asarray(bound(**values) if callable(bound) else bound, dtype=float)
        rows = np.broadcast_to(np.abs(found), (found.shape[0] if found.ndim == 2 else 1, bodies))
    except Exception as error:
        raise InputError(f"{what} cannot be had ({type(error).__name__}: {error}); allowed: a number, or a function of "
                         f"{', '.join(values) or 'nothing'} with one for each body") from error  # fmt: skip
    if not np.isfinite(rows).all():
        raise InputError(f"{what} is {rows[~np.isfinite(rows)][0]}; allowed: finite numbers")
    return rows.max(axis=0)
