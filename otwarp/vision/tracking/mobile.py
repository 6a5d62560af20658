"""A body as the simulation moves it: velocity anywhere in its traps, and the expansion of its motion about a pose."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene, Track
from otwarp.scene.transforms import rotation_matrix
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN
from otwarp.vision.tracking.motion import Expansion
from otwarp.vision.tracking.rotations import cross_matrix, differences, exponential, product

PROBE_STEP = 1e-6
"""Length of the step by which velocities are measured [s]; shorter where something relaxes faster."""

SHIFT = 1e-3
"""Displacement [µm], turn [rad] and relative power of the difference quotients: curvature of a trap's force over it is
1e-6 of its slope, rounding of a step less."""


class MobileBody:
    """One body of a scene in the scene's traps, without noise, other bodies and obstacles.

    The velocity is what one short step of `Simulation` in float64 does: all forces of the scene count, those of models
    and flows too.

    Args:
        scene: With the body.
        body: Its name.
        device: Of the simulation.

    Attributes:
        scene: The body alone, its traps still.
        reference: (3) centre of diffusion in the frame of the body's prim [µm].
        rigid: Whether it turns; a lone sphere has no orientation.

    Raises:
        InputError: No body of that name.
    """

    def __init__(self, scene: Scene, body: str, *, device: str | None = "cpu"):
        names = [b.name for b in scene.bodies]
        if body not in names:
            raise InputError(f"body is {body}; allowed: {', '.join(names[:8]) or 'nothing, there is no body'}")
        self.scene = _alone(scene, names.index(body))
        self.traps = len(self.scene.traps)
        rows = 1 + 12 + 8 * self.traps
        options = {"precision": "float64", "integrator": "eulerMaruyama", "allow_large_step": True}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the scene itself has been judged
            self._sim = Simulation(self.scene, worlds=rows, device=device, threads=1, time_step=PROBE_STEP, **options)
        model = self._sim.model
        self.rigid = bool(model.features.rigid)
        self.reference = np.asarray(model.reference[0], dtype=float)
        medium, whole = self.scene.medium, np.array(mobilities(self.scene)[0].mobility)
        thermal = BOLTZMANN * medium.temperature if scene.settings.brownian else 0.0
        if not self.rigid:
            whole[3:] = whole[:, 3:] = 0.0
        self._mobility, self._thermal = whole / medium.viscosity, thermal

    @property
    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre of diffusion [µm] and orientation at the start of the scene."""
        model = self._sim.model
        return model.start_position()[0], model.start_orientation()[0]

    def velocities(self, position: np.ndarray, orientation: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(n, 6) velocities and angular velocities [µm/s, rad/s] for n poses and commands.

        Args:
            position: (n, 3) centres of diffusion [µm]; n is the number of worlds, 13 + 8 T.
            orientation: (n, 4).
            command: (n, 4 T) positions and powers of the traps.
        """
        sim, t = self._sim, self.traps
        count = len(position)
        if self.rigid:
            sim.set_state(position=position[:, None], orientation=orientation[:, None])
        else:
            sim.set_state(position=position[:, None])
        if t:
            # as `control.set`, but for its judgement of powers, which the short step carries
            places = {"trap_position": command[:, : 3 * t].reshape(count, t, 3), "trap_power": command[:, 3 * t :]}
            sim.control.write(places, np.zeros(0, dtype=np.int32))
        sim.step(1)
        dt = sim.time_step
        out = np.zeros((count, 6))
        out[:, :3] = (sim.state.position.numpy()[:, 0] - position) / dt
        if self.rigid:
            after = sim.state.orientation.numpy()[:, 0]
            out[:, 3:] = differences(after, orientation) / dt
        return out

    def expansion(self, position: np.ndarray, orientation: np.ndarray, command: np.ndarray) -> Expansion:
        """Motion near a pose, by central differences.

        Args:
            position: (3) centre of diffusion [µm].
            orientation: (4).
            command: (4 T) positions [µm] and powers [mW] of the traps.
        """
        u = len(command)
        places, turns = np.tile(position, (13 + 2 * u, 1)), np.tile(orientation, (13 + 2 * u, 1))
        commands = np.tile(command, (13 + 2 * u, 1))
        for k in range(3):
            for sign in (1, -1):
                row = 1 + 2 * k + (sign < 0)
                places[row, k] += sign * SHIFT
                turns[row + 6] = product(exponential(sign * SHIFT * np.eye(3)[k]), orientation)
        steps = np.full(u, SHIFT)
        steps[3 * u // 4 :] = SHIFT * np.maximum(command[3 * u // 4 :], 1e-3)
        rows = 13 + 2 * np.arange(u)
        commands[rows, np.arange(u)] += steps
        commands[rows + 1, np.arange(u)] -= steps
        found = self.velocities(places, turns, commands)
        rate = (found[1:13:2] - found[2:13:2]).T / (2.0 * SHIFT)
        # a rotation vector does not grow as the body turns: θ̇ = ω + ½ ω × θ to first order
        rate[3:, 3:] += 0.5 * cross_matrix(found[0, 3:])
        response = (found[13::2] - found[14::2]).T / (2.0 * steps)
        mobility = self.mobility(orientation)
        return Expansion(
            position, orientation, command, found[0], rate, response, self._thermal * mobility, mobility
        )  # fmt: skip

    def mobility(self, orientation: np.ndarray) -> np.ndarray:
        """(6, 6) velocity over force about the centre of diffusion, in the axes of the world [µm/(s pN)], …"""
        frame = np.zeros((6, 6))
        frame[:3, :3] = frame[3:, 3:] = rotation_matrix(np.asarray(orientation, dtype=float))
        return frame @ self._mobility @ frame.T


def _alone(scene: Scene, body: int) -> Scene:
    """The scene with one body, without obstacles, noise, task and time samples."""
    traps = tuple(
        dataclasses.replace(
            t,
            position=Track.constant(t.position.at(0.0)),
            power=Track.constant(t.power.at(0.0)),
            speed_limit=float("inf"),
            holds=None,
        )
        for t in scene.traps
    )
    settings = dataclasses.replace(
        scene.settings, brownian=False, coupling=False, time_step=None, period=(0.0, 0.0, 0.0),
        domain_low=(0.0, 0.0, 0.0), domain_high=(0.0, 0.0, 0.0), inlet_low=(0.0, 0.0, 0.0), inlet_high=(0.0, 0.0, 0.0),
    )  # fmt: skip
    bodies = (scene.bodies[body],)
    alone = {"bodies": bodies, "obstacles": (), "traps": traps, "settings": settings, "goal": None}
    return dataclasses.replace(scene, **alone, judged=True)
