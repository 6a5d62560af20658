"""State, Control and Readout: what moves, what is commanded, what was measured.

All three are small dataclasses of device arrays that always exist (length 0 when unused); `.numpy()` copies to the
host, except on the CPU, where it is a view that the next step overwrites: `.numpy().copy()` keeps it. W worlds,
B bodies, T traps, S trapped spheres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from otwarp.kernels.readout import TrapReadoutData
from otwarp.kernels.types import ControlData, ReadoutData, StateData
from otwarp.simulation.arrays import device_array, filled
from otwarp.simulation.model import Model


@dataclass(eq=False, kw_only=True)
class State:
    """What moves.

    Attributes:
        position: (W, B) vec3, reference point (centre of diffusion) of each body [µm].
        orientation: (W, B) quaternion (x, y, z, w); (W, 0) when no body rotates.
        trap_position: (W, T) vec3, actual foci; (W, 0) when no trap has a speed limit [µm].
        step: Steps taken since the start.
        time: Simulated time [s].
    """

    position: wp.array
    orientation: wp.array
    trap_position: wp.array
    step: int = 0
    time: float = 0.0

    @classmethod
    def start(cls, model: Model) -> State:
        """The scene's initial state, equal in all worlds."""
        w, f = model.worlds, model.features

        def repeat(rows: np.ndarray, dtype: type) -> wp.array:
            return device_array(np.broadcast_to(rows, (w, *rows.shape)), dtype, model.device, ndim=2)

        first = model.values["trap_position"]
        limited = np.broadcast_to(first, (w, *first.shape[1:])) if f.speed_limits else np.zeros((w, 0, 3))
        return cls(
            position=repeat(model.start_position(), wp.vec3),
            orientation=repeat(model.start_orientation() if f.rigid else np.zeros((0, 4)), wp.quat),
            trap_position=device_array(limited, wp.vec3, model.device, ndim=2),
        )

    def data(self) -> StateData:
        """The kernels' view."""
        data = StateData()
        data.position, data.orientation, data.trap_position = self.position, self.orientation, self.trap_position
        return data


@dataclass(eq=False, kw_only=True)
class Control:
    """What an operator or controller commands; write with `.assign(...)`.

    Attributes:
        trap_position: (1|W, T) vec3, commanded foci [µm].
        trap_power: (1|W, T) commanded powers [mW].
        follow: (T) int32: bit 0, the position follows the scene's time samples instead; bit 1, the power does.
    """

    trap_position: wp.array
    trap_power: wp.array
    follow: wp.array

    @classmethod
    def start(cls, model: Model) -> Control:
        """Commands as authored: animated traps follow their time samples, unless the user gave other values."""
        follow = [
            (t.position.animated and "trap_position" not in model.overrides)
            | (2 * (t.power.animated and "trap_power" not in model.overrides))
            for t in model.scene.traps
        ]
        return cls(
            trap_position=device_array(model.values["trap_position"], wp.vec3, model.device, ndim=2),
            trap_power=device_array(model.values["trap_power"], wp.float32, model.device, ndim=2),
            follow=device_array(follow, wp.int32, model.device),
        )

    def data(self) -> ControlData:
        """The kernels' view."""
        data = ControlData()
        data.trap_position, data.trap_power, data.follow = self.trap_position, self.trap_power, self.follow
        return data


@dataclass(eq=False, kw_only=True)
class Readout:
    """What was measured at the present state; contact is that of the last step.

    Attributes:
        trap_position: (W, T) vec3 actual foci [µm].
        trap_power: (W, T) [mW].
        trap_force: (W, T) vec3, force of each trap on all bodies [pN].
        trap_distance: (W, T) from the trap's equilibrium point to the sphere it holds, nan if it holds none [µm].
        sphere_force: (W, S) vec3, optical force on each trapped sphere [pN].
        hand_force: (W, 2) vec3, sum over the traps of the left and the right hand [pN].
        contact_force: (W, B) vec3, net contact force, mean over the last step [pN]; (W, 0) without contact.
        contact_load: (W, B) sum of the normal forces [pN].
        escape_step: (W, T) first step at which the held sphere was out of the trap's reach, -1 if never.
        fault: (W, B) code of `otwarp.kernels.faults.Fault`.
        fault_step: (W, B).
        fault_count: (1).
    """

    trap_position: wp.array
    trap_power: wp.array
    trap_force: wp.array
    trap_distance: wp.array
    sphere_force: wp.array
    hand_force: wp.array
    contact_force: wp.array
    contact_load: wp.array
    escape_step: wp.array
    fault: wp.array
    fault_step: wp.array
    fault_count: wp.array

    @classmethod
    def empty(cls, model: Model) -> Readout:
        """Nothing measured yet."""
        w, f, d = model.worlds, model.features, model.device
        bodies = len(model.scene.bodies)
        touching = bodies if f.contacts else 0
        spheres = model.data.body.trapped.shape[0] if f.traps else 0
        return cls(
            trap_position=wp.zeros((w, f.traps), dtype=wp.vec3, device=d),
            trap_power=wp.zeros((w, f.traps), dtype=wp.float32, device=d),
            trap_force=wp.zeros((w, f.traps), dtype=wp.vec3, device=d),
            trap_distance=wp.zeros((w, f.traps), dtype=wp.float32, device=d),
            sphere_force=wp.zeros((w, spheres), dtype=wp.vec3, device=d),
            hand_force=wp.zeros((w, 2 if f.traps else 0), dtype=wp.vec3, device=d),
            contact_force=wp.zeros((w, touching), dtype=wp.vec3, device=d),
            contact_load=wp.zeros((w, touching), dtype=wp.float32, device=d),
            escape_step=filled((w, f.traps if f.escapes else 0), -1, wp.int64, d),
            fault=wp.zeros((w, bodies), dtype=wp.int32, device=d),
            fault_step=wp.zeros((w, bodies), dtype=wp.int64, device=d),
            fault_count=wp.zeros(1, dtype=wp.int32, device=d),
        )

    def data(self) -> ReadoutData:
        """What the step writes."""
        data = ReadoutData()
        for name in ("contact_force", "contact_load", "escape_step", "fault", "fault_step", "fault_count"):
            setattr(data, name, getattr(self, name))
        return data

    def trap_data(self) -> TrapReadoutData:
        """What the trap readout writes."""
        data = TrapReadoutData()
        data.position, data.power, data.force = self.trap_position, self.trap_power, self.trap_force
        data.distance, data.sphere_force, data.hand_force = self.trap_distance, self.sphere_force, self.hand_force
        return data
