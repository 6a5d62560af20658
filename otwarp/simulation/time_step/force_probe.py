"""Forces that state no bounds, measured: how strong they are and how fast they change, in float64 on any device."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.hydrodynamics import BodyMobility
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.forces.force import Load
from otwarp.scene import Scene
from otwarp.scene.transforms import rotate
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.bodies import is_rigid
from otwarp.simulation.packing.forces import ActiveForces, pack_forces
from otwarp.simulation.packing.traps import pack_medium

MOMENTS = 24
"""Times at which a force is looked at, spread over the scene's duration."""

GOLDEN = 0.5 * (5.0**0.5 - 1.0)
"""Of all numbers the worst to approximate by fractions."""

MOST_PLACES = 32
"""Places of traps at which a force is looked at, besides where a body starts."""

MOST_WORLDS = 16
"""Worlds whose parameters are looked at: those with the extremes of each, and others between."""

MOST_LOOKS = 4_000_000
"""Evaluations of a force in all; where bodies are many, places are fewer."""

AT_ONCE = 500_000
"""Evaluations in one launch."""

STEP = 1e-4
"""Displacement [body radii] and rotation [rad] of a difference quotient."""


def measured_loads(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    active: ActiveForces,
    index: int,
    device: wp.Device,
) -> list[Load]:
    """Loads of all bodies by the largest force, torque and rate that are seen of one force.

    It is looked at where each body starts, and where traps go as far as `MOST_LOOKS` allows.

    Raises:
        InputError: The force is no number where a body starts.
    """
    worlds = _probed_worlds(values, active, index)
    acting = np.flatnonzero(active.acts[index])
    each = len(worlds) * MOMENTS * 13
    traps = np.concatenate([np.zeros((0, 3)), *[t.position.values for t in scene.traps]])
    room = min(MOST_PLACES, max(0, MOST_LOOKS // (each * max(1, len(acting))) - 1))
    chosen = traps[np.unique(np.linspace(0, len(traps) - 1, room).astype(int))] if len(traps) and room else traps[:0]
    probe = ForceProbe(scene, moves, values, active, index, Place(device, "float64"))
    loads = [Load()] * len(scene.bodies)
    for bodies in np.array_split(acting, max(1, -(-len(acting) * each * (1 + len(chosen)) // AT_ONCE))):
        if not len(bodies):
            continue
        starts = np.array([_centre(scene, moves, b) for b in bodies])
        places = np.concatenate([starts[:, None], np.broadcast_to(chosen, (len(bodies), *chosen.shape))], axis=1)
        for b, force, torque, jacobian in zip(bodies, *probe.at(bodies, places, worlds), strict=True):
            rate = _fastest(jacobian, moves[b], np.array(scene.bodies[b].orientation))
            loads[b] = Load(force=float(force), torque=float(torque), rate=rate)
    return loads


def _centre(scene: Scene, moves: list[BodyMobility], b: int) -> np.ndarray:
    """Centre of diffusion of a body at the start [µm]."""
    body = scene.bodies[b]
    return np.array(body.position) + rotate(np.array(body.orientation), np.array(moves[b].reference))


def _fastest(jacobian: np.ndarray, move: BodyMobility, turn: np.ndarray) -> float:
    """Largest of ‖Lᵀ J L‖ [Pa] over (n, 6, 6) gradients of force and torque in world axes, with M = L Lᵀ."""
    frame = rotate(turn, np.eye(3)).T
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = frame
    root = both @ move.cholesky
    return float(np.linalg.norm(root.T @ jacobian @ root, 2, axis=(1, 2)).max(initial=0.0))


def _probed_worlds(values: Mapping[str, np.ndarray], active: ActiveForces, index: int) -> np.ndarray:
    """Worlds whose parameters a measurement looks at."""
    medium = [values["medium_viscosity"], values["medium_temperature"]]
    rows = [array.reshape(len(array), -1) for array in (*active.parameters_of(index).values(), *medium)]
    count = max((len(r) for r in rows), default=1)
    extremes = [k for r in rows if len(r) > 1 for k in (*r.argmin(axis=0)[:4], *r.argmax(axis=0)[:4])]
    spread = np.linspace(0, count - 1, MOST_WORLDS).astype(int)
    return np.unique(np.array([*extremes, *spread], dtype=int))[: 4 * MOST_WORLDS]


class ForceProbe:
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
        self.name = active.body_forces[index].name
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
        features = Features(forces=active.body_forces, rigid=rigid, precision="float64")
        self.kernel = kernel_module("forces.probe", "float64").make_force_probe(features, index)

    def at(
        self, bodies: np.ndarray, places: np.ndarray, worlds: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Largest force (n,) [pN] and torque (n,) [pN·µm], and gradients (n, m, 6, 6) of both, of n bodies.

        Args:
            bodies: (n,) which.
            places: (n, p, 3) of their centres of diffusion [µm], where each starts first.
            worlds: (w,) whose parameters to take.

        Raises:
            InputError: The force is no number where a body starts.
        """
        duration = self.scene.settings.duration
        # no two moments differ by a multiple of a third one, so that no oscillation hides
        times = duration * np.modf(np.arange(MOMENTS) * GOLDEN)[0]
        h = np.array([[STEP * self.radius[b]] * 3 + [STEP] * 3 for b in bodies])
        steps = np.concatenate([np.zeros((1, 6)), np.eye(6), -np.eye(6)])
        shape = (len(bodies), len(worlds), places.shape[1], len(times), len(steps))
        n, w, p, t, m = (i.ravel() for i in np.indices(shape))
        turns = np.array([[_turned(np.array(self.scene.bodies[b].orientation), x[3:]) for x in steps * d]
                          for b, d in zip(bodies, h, strict=True)])  # fmt: skip
        position = places[n, p] + (steps[m] * h[n])[:, :3]
        out = self._evaluate(bodies[n], worlds[w], position, turns[n, m], times[t]).reshape(*shape, 6)
        self._check_starts(bodies, worlds, out[:, :, 0, 0, 0])
        still = out[..., 0, :].reshape(len(bodies), -1, 6)
        gradient = (out[..., 1:7, :] - out[..., 7:, :]) / (2.0 * h[:, None, None, None, :, None])
        jacobian = np.swapaxes(gradient.reshape(len(bodies), -1, 6, 6), 2, 3)
        force, torque = (np.linalg.norm(still[..., k : k + 3], axis=2) for k in (0, 3))
        return np.nanmax(force, axis=1), np.nanmax(torque, axis=1), np.nan_to_num(jacobian)

    def _check_starts(self, bodies: np.ndarray, worlds: np.ndarray, start: np.ndarray) -> None:
        """Refuse a force that has no value where a simulation begins: (n, w, 6) in a body's first place, at time 0."""
        wrong = np.argwhere(~np.isfinite(start).all(axis=2))
        if len(wrong):
            n, w = wrong[0]
            force, torque = ([float(x) for x in start[n, w, k : k + 3]] for k in (0, 3))
            where = "" if len(worlds) == 1 else f" in world {worlds[w]}"
            raise InputError(
                f"force {self.name} on {self.scene.bodies[bodies[n]].name}{where} is {force} pN with a torque of "
                f"{torque} pN·µm where the body starts, at time 0; allowed: finite numbers"
            )

    def _evaluate(
        self, body: np.ndarray, world: np.ndarray, position: np.ndarray, rotation: np.ndarray, time: np.ndarray
    ) -> np.ndarray:
        """(n, 6) force and torque of a body in each of n situations."""
        place = self.place
        inputs = [
            device_array(body, wp.int32, place),
            device_array(world, wp.int32, place),
            device_array(position, wp.vec3, place),
            device_array(rotation, wp.quat, place),
            device_array(time, wp.float64, place),
        ]
        force, torque = (wp.zeros(len(world), dtype=wp.vec3d, device=place.device) for _ in range(2))
        wp.launch(
            self.kernel, dim=len(world), inputs=[self.data, *inputs], outputs=[force, torque], device=place.device
        )  # fmt: skip
        return np.hstack([force.numpy(), torque.numpy()])


def _turned(q: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """The orientation q turned by a small rotation vector [rad]."""
    x, y, z, w = q
    a, b, c = 0.5 * angle
    turned = np.array([x + w * a + b * z - c * y, y + w * b + c * x - a * z, z + w * c + a * y - b * x, w])
    turned[3] -= a * x + b * y + c * z
    return turned / np.linalg.norm(turned)
