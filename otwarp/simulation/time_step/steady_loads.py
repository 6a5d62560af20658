"""How strong the forces of `FORCES` are whatever the traps do: what time steps, walls and the teleop budget count on.

A built-in force says it itself, or states bounds; of a user's force without them it is measured, in float64, where
bodies start and traps go.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import warp as wp

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.body_forces.body_force import Bound
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.forces.force import BodyFacts, Load
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.bodies import is_rigid, union_volume, weight
from otwarp.simulation.packing.forces import ActiveForces, pack_forces
from otwarp.simulation.packing.traps import pack_medium, rotate

MOMENTS = 9
"""Times at which a force is looked at, spread over the scene's duration."""

MOST_PLACES = 32
"""Places of traps at which a force is looked at, besides where a body starts."""

MOST_WORLDS = 16
"""Worlds whose parameters are looked at: those with the extremes of each, and others between."""

STEP = 1e-4
"""Displacement [body radii] and rotation [rad] of a difference quotient."""


def weights(scene: Scene, moves: list[BodyMobility] | None = None) -> list[Load]:
    """Loads of all bodies by the rows of `FORCES` that follow from the bodies alone.

    Args:
        moves: Mobilities of the bodies; without them torques are left out.
    """
    features = Features(gravity=scene.settings.gravity)
    rows = [row.load for row in FORCES.values() if row.load is not None and row.active(features)]
    if not rows:
        return [Load()] * len(scene.bodies)
    loads = []
    for b, body in enumerate(scene.bodies):
        arm = 0.0
        if moves is not None and is_rigid(body):
            arm = float(np.linalg.norm(union_volume(body)[1] - moves[b].reference))
        facts = BodyFacts(weight(scene, body), arm)
        first, *rest = (load(facts) for load in rows)
        loads.append(sum(rest, start=first))
    return loads


def resting_loads(scene: Scene) -> list[Load]:
    """Forces [pN] on all bodies by all that a scene authors but its traps; without torques and rates."""
    loads, active = weights(scene), ActiveForces.of(scene, (), {}, 1)
    for index, law in enumerate(active.laws):
        force = _bound(law.load, active.of_law(index), len(loads)) * active.acts[index]
        loads = [load + Load(force=f) for load, f in zip(loads, force, strict=True)]
    return loads


def steady_loads(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    active: ActiveForces,
    device: wp.Device,
) -> list[Load]:
    """Loads of all bodies by all forces but traps.

    Args:
        moves: Mobilities of the bodies.
        values: The `(1|W, …)` parameters of the scene.
        active: The forces with parameters.
        device: Where forces are measured that state no bounds.

    Returns:
        Bounds per body; of measured forces the largest values that were seen.
    """
    loads = weights(scene, moves)
    for index, law in enumerate(active.laws):
        more = _stated(active, index, moves, scene)
        if law.slope is None or law.load is None:
            seen = _measured(scene, moves, values, active, index, device)
            more = [
                Load(
                    torque=s.torque if law.load is None else m.torque,
                    force=s.force if law.load is None else m.force,
                    rate=s.rate if law.slope is None else m.rate,
                )
                for m, s in zip(more, seen, strict=True)
            ]
        loads = [a + b if acts else a for a, b, acts in zip(loads, more, active.acts[index], strict=True)]
    return loads


def _stated(active: ActiveForces, index: int, moves: list[BodyMobility], scene: Scene) -> list[Load]:
    """Loads by what a force states about itself, 0 where it states nothing."""
    law, bodies = active.laws[index], len(moves)
    force = _bound(law.load, active.of_law(index), bodies)
    slope = _bound(law.slope, active.of_law(index), bodies)
    loads = []
    for b, (body, move) in enumerate(zip(scene.bodies, moves, strict=True)):
        if law.acts_on == "spheres":
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


def _bound(bound: Bound | None, values: Mapping[str, np.ndarray], bodies: int) -> np.ndarray:
    """(B,) the largest value of a bound in any world, 0 for None."""
    if bound is None:
        return np.zeros(bodies)
    found = np.asarray(bound(**values) if callable(bound) else bound, dtype=float)
    rows = np.broadcast_to(np.abs(found), (found.shape[0] if found.ndim == 2 else 1, bodies))
    return rows.max(axis=0)


def _measured(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    active: ActiveForces,
    index: int,
    device: wp.Device,
) -> list[Load]:
    """Loads by the largest force, torque and rate that are seen of one force."""
    worlds = _probed_worlds(active, index)
    traps = np.concatenate([np.zeros((0, 3)), *[t.position.values for t in scene.traps]])
    chosen = traps[np.unique(np.linspace(0, len(traps) - 1, MOST_PLACES).astype(int))] if len(traps) else traps
    probe = _Probe(scene, moves, values, active, index, Place(device, "float64"))
    loads = []
    for b, (body, move) in enumerate(zip(scene.bodies, moves, strict=True)):
        if not active.acts[index, b]:
            loads.append(Load())
            continue
        turn = np.array(body.orientation)
        start = np.array(body.position) + rotate(turn, np.array(move.reference))
        # where no trap comes there is nothing to be seen but the start
        places = np.concatenate([start[None], chosen]) if len(scene.bodies) * len(chosen) <= 4096 else start[None]
        force, torque, jacobian = probe.at(b, places, turn, worlds)
        loads.append(Load(force=force, torque=torque, rate=_fastest(jacobian, move, turn)))
    return loads


def _fastest(jacobian: np.ndarray, move: BodyMobility, turn: np.ndarray) -> float:
    """Largest of ‖Lᵀ J L‖ [Pa] over (n, 6, 6) gradients of force and torque in world axes, with M = L Lᵀ."""
    frame = rotate(turn, np.eye(3)).T
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = frame
    root = both @ move.cholesky
    return float(np.linalg.norm(root.T @ jacobian @ root, 2, axis=(1, 2)).max(initial=0.0))


def _probed_worlds(active: ActiveForces, index: int) -> np.ndarray:
    """Worlds whose parameters a measurement looks at."""
    rows = [array.reshape(len(array), -1) for array in active.of_law(index).values()]
    count = max((len(r) for r in rows), default=1)
    extremes = [k for r in rows if len(r) > 1 for k in (*r.argmin(axis=0)[:4], *r.argmax(axis=0)[:4])]
    spread = np.linspace(0, count - 1, MOST_WORLDS).astype(int)
    return np.unique(np.array([*extremes, *spread], dtype=int))[: 4 * MOST_WORLDS]


class _Probe:
    """One force, evaluated in float64 wherever it is asked."""

    def __init__(
        self,
        scene: Scene,
        moves: list[BodyMobility],
        values: Mapping[str, np.ndarray],
        active: ActiveForces,
        index: int,
        place: Place,
    ):
        self.scene, self.place = scene, place
        self.index = index
        data = place.typed(ModelData)()
        data.bodies = len(scene.bodies)
        data.medium = pack_medium(values["medium_temperature"], values["medium_viscosity"], place)
        data.forces, self.kept = pack_forces(scene, moves, active, place)
        reach = [
            max(float(np.linalg.norm(np.array(s.offset) - m.reference)) + s.radius for s in body.spheres)
            for body, m in zip(scene.bodies, moves, strict=True)
        ]
        data.body.bound = device_array(reach, wp.float32, place)
        self.data, self.radius = data, reach
        rigid = any(is_rigid(body) for body in scene.bodies)
        features = Features(forces=active.laws, bodies=len(scene.bodies), rigid=rigid, precision="float64")
        self.kernel = kernel_module("forces.probe", "float64").make_force_probe(features, index)

    def at(self, b: int, places: np.ndarray, turn: np.ndarray, worlds: np.ndarray) -> tuple[float, float, np.ndarray]:
        """Largest force [pN] and torque [pN·µm], and gradients (n, 6, 6) of both, of body b.

        Args:
            places: (p, 3) of its centre of diffusion [µm].
            turn: Its orientation.
            worlds: Whose parameters to take.
        """
        times = np.linspace(0.0, self.scene.settings.duration, MOMENTS)
        h = STEP * np.array([self.radius[b]] * 3 + [1.0] * 3)
        moves = np.concatenate([np.zeros((1, 6)), np.diag(h), -np.diag(h)])
        shape = (len(worlds), len(places), len(times), len(moves))
        world, place, time, move = (i.ravel() for i in np.indices(shape))
        position = places[place] + moves[move, :3]
        rotation = np.array([_turned(turn, m[3:]) for m in moves])[move]
        out = self._evaluate(b, worlds[world], position, rotation, times[time]).reshape(*shape, 6)
        still = out[:, :, :, 0].reshape(-1, 6)
        gradient = (out[:, :, :, 1:7] - out[:, :, :, 7:]) / (2.0 * h[:, None])
        jacobian = np.swapaxes(gradient.reshape(-1, 6, 6), 1, 2)
        finite = np.all(np.isfinite(jacobian), axis=(1, 2))
        force, torque = (np.linalg.norm(still[:, k : k + 3], axis=1) for k in (0, 3))
        return float(np.nanmax(force, initial=0.0)), float(np.nanmax(torque, initial=0.0)), jacobian[finite]

    def _evaluate(
        self, b: int, world: np.ndarray, position: np.ndarray, rotation: np.ndarray, time: np.ndarray
    ) -> np.ndarray:
        """(n, 6) force and torque of body b in n situations."""
        place = self.place
        inputs = [
            device_array(world, wp.int32, place),
            device_array(position, wp.vec3, place),
            device_array(rotation, wp.quat, place),
            device_array(time, wp.float64, place),
        ]
        force, torque = (wp.zeros(len(world), dtype=wp.vec3d, device=place.device) for _ in range(2))
        wp.launch(
            self.kernel, dim=len(world), inputs=[self.data, b, *inputs], outputs=[force, torque], device=place.device
        )  # fmt: skip
        return np.hstack([force.numpy(), torque.numpy()])


def _turned(q: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """The orientation q turned by a small rotation vector [rad]."""
    x, y, z, w = q
    a, b, c = 0.5 * angle
    turned = np.array([x + w * a + b * z - c * y, y + w * b + c * x - a * z, z + w * c + a * y - b * x, w])
    turned[3] -= a * x + b * y + c * z
    return turned / np.linalg.norm(turned)
