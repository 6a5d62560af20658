"""State, Control and Readout: what moves, what is commanded, what was measured.

All three are small dataclasses of device arrays that always exist (length 0 when unused); `.numpy()` copies to the
host, except on the CPU, where it is a view that the next step overwrites: `.numpy().copy()` keeps it. W worlds,
B bodies, T traps, S trapped spheres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError, SimulationError
from otwarp.kernels.core.faults import FAULT_TEXT, Fault
from otwarp.kernels.core.precision import precision_of, typed
from otwarp.kernels.core.types import ControlData, ReadoutData, StateData
from otwarp.kernels.optics.readout import TrapReadoutData
from otwarp.scene.keywords import known_keywords
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arrays import device_array, device_rows, filled, host_type, repeated
from otwarp.simulation.packing.parameters import expand
from otwarp.simulation.powers import check_powers


class Bound:
    """Arrays that a compiled or captured step has bound: written in place, never replaced."""

    def __setattr__(self, name: str, value: object) -> None:
        bound = vars(self).get(name)
        group, fields = type(self).__name__.lower(), type(self).__dataclass_fields__  # type: ignore[attr-defined]
        if isinstance(bound, wp.array) and value is not bound:
            how = {"control": f"control.set({name}=...)", "state": f"sim.set_state(...) or state.{name}.assign(...)"}
            allowed = how.get(group, "reading it")
            raise InputError(f"{group}.{name} cannot be replaced, the step is bound to its array; allowed: {allowed}")
        if name not in fields:
            raise InputError(f"{group}.{name} does not exist; allowed: {', '.join(fields)}")
        object.__setattr__(self, name, value)


@dataclass(eq=False, kw_only=True)
class State(Bound):
    """What moves. `Simulation.set_state` puts bodies elsewhere.

    Attributes:
        position: (W, B) vec3, reference point (centre of diffusion) of each body [µm].
        orientation: (W, B) quaternion (x, y, z, w); (W, 0) when no body rotates.
        trap_position: (W, T) vec3, actual foci; (W, 0) when no trap has a speed limit [µm].
        image: (W, B) vec3i, by how many periods each body has gone on along each axis; (W, 0) without periodic axes.
        step: Steps taken since the start.
        time: Simulated time [s].
    """

    position: wp.array
    orientation: wp.array
    trap_position: wp.array
    image: wp.array
    step: int = 0
    time: float = 0.0

    @classmethod
    def start(cls, model: Model) -> State:
        """The scene's initial state, equal in all worlds."""
        w, f, on = model.worlds, model.features, model.place
        place, image = model.start_position(), np.zeros((0, 3), dtype=np.int32)
        if f.periodic:
            place, image = model.in_cell(place)
        first = model.values["trap_position"] if f.speed_limits else np.zeros((1, 0, 3))
        limited = repeated(first[0], w, wp.vec3, on) if len(first) == 1 else device_rows(first, wp.vec3, on, ndim=2)
        return cls(
            position=repeated(place, w, wp.vec3, on),
            orientation=repeated(model.start_orientation() if f.rigid else np.zeros((0, 4)), w, wp.quat, on),
            trap_position=limited,
            image=repeated(image, w, wp.vec3i, on),
        )

    def data(self) -> Annotated[Any, StateData]:
        """The same arrays as the struct that kernels take, in the precision of the model."""
        data = typed(StateData, precision_of(self.position))()
        data.position, data.orientation, data.trap_position = self.position, self.orientation, self.trap_position
        data.image = self.image
        return data


@dataclass(eq=False, kw_only=True)
class Control(Bound):
    """What an operator or controller commands: read the arrays, write with `set`.

    `.assign(...)` on an array works too, but nothing then checks what is written, stops a trap from following its time
    samples, or refreshes the readout (see `Simulation.measure`).

    Attributes:
        trap_position: (1|W, T) vec3, commanded foci [µm].
        trap_power: (1|W, T) commanded powers [mW].
        follow: (T) int32: bit 0, the position follows the scene's time samples instead; bit 1, the power does.
        trap_velocity: (W, T) vec3 at which foci go on from their positions, 0 at first [µm/s]; (0, 0) unless the
            simulation was made with `glides`. Written in place, by `assign` or a kernel.
        trap_since: (W) float64 time of a world at which its foci were there [s]; (0) likewise.
        model: What it commands.
        writes: Calls of `set` so far.
        layout: Counts the times an array had to be replaced by a larger one.
    """

    trap_position: wp.array
    trap_power: wp.array
    follow: wp.array
    trap_velocity: wp.array
    trap_since: wp.array
    model: Model
    writes: int = 0
    layout: int = 0

    @classmethod
    def start(cls, model: Model) -> Control:
        """Commands as authored: animated traps follow their time samples.

        With `trap_position` (or `trap_power`) among the parameters the positions (powers) of all traps stand still at
        what was given; `set(follow=...)` lets chosen traps follow again.
        """
        follow = [
            (t.position.animated and "trap_position" not in model.overrides)
            | (2 * (t.power.animated and "trap_power" not in model.overrides))
            for t in model.scene.traps
        ]
        glides = (model.worlds, len(follow)) if model.features.gliding_traps else (0, 0)
        return cls(
            trap_position=device_rows(model.values["trap_position"], wp.vec3, model.place, ndim=2),
            trap_power=device_rows(model.values["trap_power"], wp.float32, model.place, ndim=2),
            follow=device_array(follow, wp.int32, model.device),
            trap_velocity=device_array(np.zeros((*glides, 3)), wp.vec3, model.place, ndim=2),
            trap_since=device_array(np.zeros(glides[0]), wp.float64, model.device),
            model=model,
        )

    @known_keywords
    def set(
        self,
        *,
        trap_position: ArrayLike | None = None,
        trap_power: ArrayLike | None = None,
        follow: ArrayLike | None = None,
    ) -> None:
        """Command traps from the next step on; nothing is written unless all of it is accepted.

        Args:
            trap_position: Foci [µm]: (3,), (T, 3), (W, 1, 3) or (W, T, 3).
            trap_power: Powers [mW]: scalar, (T,), (W, 1) or (W, T).
            follow: What follows the scene's time samples, for all traps or per trap (T): 0 or False nothing, 1 the
                position, 2 the power, 3 or True both. Commands then wait until they are no longer followed. None: what
                is commanded in this call stops following in all traps, the rest goes on. A trap without time samples
                has nothing to follow.

        Raises:
            InputError: A wrong shape or value, or a power that the time step cannot carry; the message names the
                largest stable one.

        Warns:
            UserWarning: A power with which stationary variances miss the wanted accuracy by prediction, or coupled
                bodies would be unstable where they meet.

        Example:
            >>> import otwarp as ot
            >>> sim = ot.Simulation(ot.Scene.load("scenes/single_bead.usda"), worlds=2, device="cpu")
            >>> sim.control.set(trap_position=(0.5, 0.0, 5.0), trap_power=[[1.0], [5.0]])
            >>> sim.control.trap_power.numpy().ravel().tolist()
            [1.0, 5.0]
        """
        self.write(*self.accept(trap_position=trap_position, trap_power=trap_power, follow=follow))

    def accept(
        self,
        *,
        trap_position: ArrayLike | None = None,
        trap_power: ArrayLike | None = None,
        follow: ArrayLike | None = None,
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """What `set` would write, if all of it can be: arrays by name, and (T,) bits of `follow`.

        Raises:
            InputError: As `set`.
        """
        asked = {"trap_position": trap_position, "trap_power": trap_power}
        worlds, traps = self.model.worlds, len(self.model.scene.traps)
        given = {n: expand(n, v, worlds=worlds, traps=traps) for n, v in asked.items() if v is not None}
        bits = self._bits(given, follow)
        # bit 1 says whose power counts: unless one of these changes, so does nothing that a step could not carry
        if trap_power is not None or (follow is not None and np.any((bits ^ self.follow.numpy()) & 2)):
            power = given["trap_power"] if trap_power is not None else self.trap_power.numpy()
            peaks = [
                t.power.values.max() if bit & 2 else p
                for t, bit, p in zip(self.model.scene.traps, bits, power.max(axis=0), strict=True)
            ]
            check_powers(self.model, np.array(peaks, dtype=float))
        return given, bits

    def write(self, given: Mapping[str, np.ndarray], bits: np.ndarray) -> None:
        """Write what `accept` has checked: a part of `set`, for whoever commands several simulations or none.

        Args:
            given: Arrays (1|W, T, …) by the names of the arrays here.
            bits: (T,) int32 for `follow`, of length 0 to leave it.
        """
        for name, values in given.items():
            if len(values) > getattr(self, name).shape[0]:
                self.widen(name)
            array = getattr(self, name)
            if array.device.is_cpu:
                array.numpy()[...] = values  # the same memory: a tenth of the time of `assign`
            else:
                array.assign(
                    np.broadcast_to(values, (array.shape[0], *values.shape[1:])).astype(host_type(array.dtype))
                )
        if len(bits):
            self.follow.assign(bits)
        self.writes += 1

    def widen(self, name: str) -> None:
        """Give `trap_position` or `trap_power` a row for every world, (1, T) → (W, T); `layout` counts that.

        The array is another one then: what had bound the old one, such as a captured graph, must be made anew.
        """
        old = getattr(self, name)
        rows = np.broadcast_to(old.numpy(), (self.model.worlds, *old.numpy().shape[1:]))
        vars(self)[name] = device_array(rows, old.dtype, self.model.device, ndim=2)
        self.layout += 1

    def _bits(self, given: Mapping[str, np.ndarray], follow: ArrayLike | None) -> np.ndarray:
        """(T,) int32 `follow` after a call of `set`."""
        traps = self.model.scene.traps
        if follow is None:
            keep = 3 - ("trap_position" in given) - 2 * ("trap_power" in given)
            return self.follow.numpy() & np.int32(keep) if len(traps) else np.zeros(0, dtype=np.int32)
        bits = np.asarray(follow)
        bits = 3 * bits.astype(int) if bits.dtype == bool else bits
        if bits.shape not in ((), (1,), (len(traps),)):
            raise InputError(
                f"control follow has shape {bits.shape}; allowed: scalar or (traps,), traps = {len(traps)}"
            )
        bad = ~np.isin(bits, (0, 1, 2, 3))
        if np.any(bad):
            raise InputError(f"control follow has the value {bits[bad].ravel()[0]}; allowed: 0, 1, 2 or 3")
        animated = np.array([t.position.animated or t.power.animated for t in traps], dtype=bool)
        return np.where(animated, bits, 0).astype(np.int32)

    def data(self) -> Annotated[Any, ControlData]:
        """The same arrays as the struct that kernels take; made anew after `widen`, which replaces one."""
        data = self.model.place.typed(ControlData)()
        for name in ("trap_position", "trap_power", "follow", "trap_velocity", "trap_since"):
            setattr(data, name, getattr(self, name))
        return data


@dataclass(eq=False, kw_only=True)
class Readout(Bound):
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
        body_force: (W, F, B) vec3, of each force with parameters on each body, as in `model.forces.body_forces` [pN].
        body_torque: (W, F, B) vec3, the torques of these forces about the centres of diffusion [pN·µm].
        entries: (W, B) int32, how often each cell has come in again at the inlet; (W, 0) without one.
        escape_step: (W, T) arrival of the first step in which the held sphere was out of the trap's reach, -1 if never;
            it was lost half a step earlier on average.
        fault: (W, B) code of `otwarp.kernels.core.faults.Fault`.
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
    body_force: wp.array
    body_torque: wp.array
    entries: wp.array
    escape_step: wp.array
    fault: wp.array
    fault_step: wp.array
    fault_count: wp.array

    @classmethod
    def empty(cls, model: Model) -> Readout:
        """Arrays of the shapes above, with nothing measured yet: zeros, and −1 for escapes."""
        w, f, d = model.worlds, model.features, model.device
        real, vec3 = model.place.typed(wp.float32), model.place.typed(wp.vec3)
        bodies = len(model.scene.bodies)
        touching = bodies if f.contacts else 0
        spheres = model.data.body.trapped.shape[0] if f.traps else 0
        return cls(
            trap_position=wp.zeros((w, f.traps), dtype=vec3, device=d),
            trap_power=wp.zeros((w, f.traps), dtype=real, device=d),
            trap_force=wp.zeros((w, f.traps), dtype=vec3, device=d),
            trap_distance=wp.zeros((w, f.traps), dtype=real, device=d),
            sphere_force=wp.zeros((w, spheres), dtype=vec3, device=d),
            hand_force=wp.zeros((w, 2 if f.traps else 0), dtype=vec3, device=d),
            contact_force=wp.zeros((w, touching), dtype=vec3, device=d),
            body_force=wp.zeros((w, len(f.forces), bodies if f.forces else 0), dtype=vec3, device=d),
            body_torque=wp.zeros((w, len(f.forces), bodies if f.forces else 0), dtype=vec3, device=d),
            contact_load=wp.zeros((w, touching), dtype=real, device=d),
            entries=wp.zeros((w, bodies if f.inlet else 0), dtype=wp.int32, device=d),
            escape_step=filled((w, f.traps if f.escapes else 0), -1, wp.int64, d),
            fault=wp.zeros((w, bodies), dtype=wp.int32, device=d),
            fault_step=wp.zeros((w, bodies), dtype=wp.int64, device=d),
            fault_count=wp.zeros(1, dtype=wp.int32, device=d),
        )

    def data(self) -> Annotated[Any, ReadoutData]:
        """Those of the arrays that the step writes, as the struct that kernels take."""
        data = typed(ReadoutData, precision_of(self.trap_force))()
        for name in ("contact_force", "contact_load", "entries", "escape_step", "fault", "fault_step", "fault_count"):
            setattr(data, name, getattr(self, name))
        return data

    def trap_data(self) -> Annotated[Any, TrapReadoutData]:
        """Those of the arrays that a measurement writes, as the struct that kernels take."""
        data = typed(TrapReadoutData, precision_of(self.trap_force))()
        data.position, data.power, data.force = self.trap_position, self.trap_power, self.trap_force
        data.distance, data.sphere_force, data.hand_force = self.trap_distance, self.sphere_force, self.hand_force
        return data

    def check_faults(self, model: Model) -> None:
        """Raise for the earliest fault on the device.

        Raises:
            SimulationError: There is one; the message names world, body, step and time.
        """
        if self.fault_count.numpy()[0] == 0:
            return
        code, when = self.fault.numpy(), self.fault_step.numpy()
        world, body = min(np.argwhere(code), key=lambda wb: (when[tuple(wb)], tuple(wb)))
        step = int(when[world, body])
        raise SimulationError(
            FAULT_TEXT[Fault(int(code[world, body]))],
            world=model.first_world + int(world),
            body=model.scene.bodies[body].name,
            step=step,
            time=step * model.time_step,
        )
