"""Simulation: the only object that steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.kernels.core.precision import kernel_module
from otwarp.scene import Scene
from otwarp.simulation.capture import CapturedLoop, steps_of_turn
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.compilation import load_kernels
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.drivers.stepping import FusedStepper, PhasedStepper, StepperParts
from otwarp.simulation.ends import End, check_ends
from otwarp.simulation.episodes import Episodes
from otwarp.simulation.info import device_bytes
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.arguments import seconds, whole
from otwarp.simulation.packing.arrays import host_type
from otwarp.simulation.packing.parameters import SharedRows
from otwarp.simulation.starts import pose_rows, starts_of
from otwarp.simulation.state import Control, Readout, State
from otwarp.simulation.user_forces import Force, check_forces


class Simulation:
    """A scene in motion, in `worlds` independent copies.

    Args:
        scene: What to simulate.
        worlds: Independent copies; they differ in their noise and in the parameters given per world.
        seed: Key of the random streams, 0 … 2³² − 1.
        device: `"cpu"`, `"cuda:0"`, … or None for the best available.
        time_step: Explicit step [s]; None lets the scene and its accuracy decide.
        parameters: Values that replace the scene's, for all worlds or per world; see
            `PARAMETERS` in `otwarp.simulation.packing.parameters`; `SharedRows` there where many worlds have the same.
        threads: Worker threads on the CPU; None uses all cores. Results do not depend on it.
        fast_math: On CUDA, use approximate instructions for functions and divisions: up to twice as fast for a lone
            bead. Deviates of the noise change by about 1e-6, far below the error of any time step; on a CPU only the
            noise's functions change, to the library's, and only where bodies touch.
        integrator: `eulerMaruyama`, `leimkuhlerMatthews`, `heun`, `exponential`, or None for the scene's.
        noise: `gaussian`, `threePoint`, `uniform`, or None for the scene's.
        crossings: Whether escapes between the ends of two steps count; off only to measure what that is worth.
        precision: `float32`, or `float64` for all real numbers but the deviates of the noise, which are the same: for
            scenes far from the origin, and to see rounding. Not for many-body scenes and meshes, nor with `fast_math`.
        forces: Forces beside those of the scene, made by `otwarp.force`; summed in every stage of the step, and counted
            for its length. Their parameters are parameters, too: `<force>_<parameter>`.
        allow_large_step: Whether an explicit `time_step` that is stable may make any errors; else it draws a warning
            above the wanted accuracy, and is refused above 10 %.
        ends: What ends the task of a world, looked at when a call of `step` is over; such worlds stand still at no cost
            until `reset`; see `episodes`. An empty list leaves that to the user; None: all worlds go on for good.
        glides: Foci can be commanded velocities, at which they go on between commands: `control.trap_velocity`.
        part: First of the worlds that this object steps, and the one after its last, of `worlds`: the same bits as in
            the whole, for several devices or processes.
        readout: Compile the kernels of the readout beside those of the step, and not when it is first asked for.

    Attributes:
        model: The scene on the device.
        options: What was chosen about the step, with the time step, integrator and noise that follow from the scene.
        state, control: What moves, and what is commanded.
        last_readout: `readout` as it is, nothing evaluated: forces and distances are those that were last measured.

    Raises:
        InputError: An argument out of range.

    Example:
        >>> import otwarp as ot
        >>> scene = ot.Scene.load("scenes/single_bead.usda")
        >>> sim = ot.Simulation(scene, worlds=4, seed=7, device="cpu")
        >>> sim.run(0.01)
        >>> sim.state.position.numpy().shape
        (4, 1, 3)
    """

    def __init__(
        self,
        scene: Scene,
        *,
        worlds: int = 1,
        seed: int = 0,
        device: str | wp.Device | None = None,
        time_step: float | None = None,
        parameters: Mapping[str, ArrayLike] | SharedRows | None = None,
        threads: int | None = None,
        fast_math: bool = False,
        integrator: str | None = None,
        noise: str | None = None,
        crossings: bool = True,
        precision: str = "float32",
        forces: Sequence[Force] = (),
        allow_large_step: bool = False,
        ends: Sequence[End] | None = None,
        glides: bool = False,
        part: tuple[int, int] | None = None,
        readout: bool = False,
    ):
        options = StepOptions(
            time_step=time_step,
            integrator=integrator,
            noise=noise,
            fast_math=fast_math,
            crossings=crossings,
            precision=precision,
            forces=check_forces(forces),
            allow_large_step=allow_large_step,
            ends=None if ends is None else check_ends(ends),
            glides=glides,
        )
        how: dict[str, Any] = {"options": options, "part": part, "parameters": parameters}
        self.model = Model.build(scene, worlds=worlds, seed=seed, device=device, **how)
        threads = None if threads is None else whole("threads", threads, 1)
        self.state = State.start(self.model)
        self.control = Control.start(self.model)
        self.last_readout = Readout.empty(self.model)
        self._episodes: Episodes | None = None
        if self.model.features.episodes:
            self._episodes = Episodes.start(self.model, options.ends or (), self.state, self.last_readout)
        settings = self.model.scene.settings
        in_force = {"time_step": self.time_step, "integrator": settings.integrator, "noise": settings.noise}
        self.options = dataclasses.replace(options, **in_force)
        self._measured_at: tuple[int, int] | None = None
        self._measures = readout  # whether the kernels that measure are loaded: many simulations never need them
        self._step = kernel_module("step", precision).make_step(self.model.features)
        beside = (*(self._step.measuring if readout else ()), *(self._episodes.kernels if self._episodes else ()))
        parts = StepperParts(self._step, self.model, self.state, self.control, self.last_readout, threads, beside)
        f = self.model.features
        if f.driver == "grid":
            stepper = GridPhasesStepper if f.phased else BlockStepper if f.by_world else GridStepper
        else:
            stepper = PhasedStepper if f.phased else FusedStepper
        self._stepper = stepper(parts)

    @property
    def scene(self) -> Scene:
        """The scene being simulated."""
        return self.model.scene

    @property
    def time_step(self) -> float:
        """Time step [s]."""
        return self.model.time_step

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.state.time

    def step(self, steps: int = 1, *, look: bool = True) -> None:
        """Take `steps` time steps.

        Args:
            steps: How many, 0 or more.
            look: Where worlds have ends, whether to learn how many are still in motion; a GPU is waited for then.
                Without, it launches the next steps for as many as there were at the last look, to the same results.

        Raises:
            InputError: `steps` is negative, or no whole number.
            SimulationError: The state is no longer physical; bodies with a fault keep their last good pose.
        """
        steps = whole("steps", steps, 0)
        if steps == 0:
            return
        if self._episodes is None:
            self._stepper.advance(self.state.step, steps, self.model.worlds)
        else:
            self._segment(self._episodes, steps)
            if look:
                self._episodes.look()
        self._count(steps)
        if self.options.ends is None:
            self.last_readout.check_faults(self.model)

    def _segment(self, episodes: Episodes, steps: int, *, every_world: bool = False, settle: bool = True) -> None:
        """Launch `steps` steps of the worlds in motion, and what tells which of them have ended; see `capture`."""
        places = self.model.worlds if every_world else episodes.list()
        if places:
            self._stepper.advance(0, steps, places)
            if settle:
                episodes.settle(steps, places)

    def _count(self, steps: int, *, measured: bool = False) -> None:
        """Turn the clock by which the host counts; `measured`: the readout is that of its new time."""
        self.state.step += steps
        self.state.time = self.state.step * self.time_step
        self._measured_at = (self.state.step, self.control.writes) if measured else None

    @property
    def episodes(self) -> Episodes:
        """Which worlds are in motion, since when, and with which noise.

        Raises:
            InputError: The simulation was made without `ends`.
        """
        if self._episodes is None or self.options.ends is None:
            raise InputError("this simulation has no episodes; allowed: Simulation(..., ends=[…]), or ends=() for none")
        return self._episodes

    def capture(
        self, steps: int, *, before: Callable[[], Any] | None = None, after: Callable[[], Any] | None = None,
        readout: bool = False, every_world: bool = False, settle: bool = True,
    ) -> CapturedLoop:  # fmt: skip
        """Record `before`, `steps` steps, the readout if it is wanted, and `after` as one graph: nothing moves yet.

        Args:
            steps: Time steps of one turn, 1 to 100,000, or more where one launch takes many: turns are for repeating.
            before: Launches what writes the commands, in place: `control.trap_position`, `control.trap_power`; arrays
                that are to differ from world to world are `control.widen`ed first. Or tensors of torch, `wp.to_torch`
                of these arrays, are written between the turns.
            after: Launches what reads `state`, `readout` and `episodes`, or resets worlds by flags on the device.
            readout: Whether trap forces and distances are measured before `after`.
            every_world: All worlds are stepped, and no list is made: where `before` or `after` starts anew what has
                ended. One that `done` is written of between the turns moves, too; its clock stands, its code stays.
            settle: Turn clocks and look for ends; else `after` does, by `turn_clock` and `end_code` of
                `otwarp.kernels.drivers.episodes` in a kernel of its own, of the worlds whose `done` is 0.

        Raises:
            InputError: Too many steps; the simulation was made without `ends`, so that its clock is the host's; or with
                some, for which `settle` would have to look.

        Example:
            >>> sim = ot.Simulation(scene, worlds=4096, ends=[ot.timed_out(after=0.5)])
            >>> turn = sim.capture(20, after=lambda: sim.reset(sim.episodes.done))
            >>> turn(1000)
        """
        episodes, steps = self.episodes, steps_of_turn(steps, self._stepper.captured_steps)
        if episodes.ends and not settle:
            raise InputError("settle is False; allowed: with ends=(), else True")
        load_kernels((*episodes.kernels, *self._step.kernels), self.model.device)

        def turn() -> None:
            """What is captured: one call of the loop."""
            if before is not None:
                before()
            self._segment(episodes, steps, every_world=every_world, settle=settle)
            if readout:
                self.measure()
            if after is not None:
                after()

        loop = CapturedLoop(self.control, episodes, steps, turn, self._count, every_world=every_world)
        loop.measured, self._measured_at = readout and self._measured_at is not None, None
        return loop

    def reset(
        self,
        worlds: Any = None,
        *,
        position: Any = None,
        orientation: Any = None,
        number: Any = None,
    ) -> None:
        """Start worlds anew, each in its next trial and with its clock at 0; what is on the device stays there.

        Args:
            worlds: Which: flags (W), bool or int32, such as `episodes.done`, as a Warp array or a tensor of torch, read
                on the device, or on the host; or indices on the host, each once. None: all of them.
            position: Reference points where they start, (B, 3) or (W, B, 3) [µm], of which the rows of the chosen
                worlds count; on the host, a Warp array (1|W, B) of vec3, or a tensor. None: the scene's.
            orientation: Quaternions, likewise.
            number: Trials that they run, (W) uint32. None: the next of each, the last one + all worlds, so that no
                trial comes twice.

        Raises:
            InputError: The simulation has no episodes; a wrong shape, type or device, or a value out of range.
        """
        episodes = self.episodes
        poses = {"position": position, "orientation": orientation}
        start = starts_of(self.model, episodes.origin, worlds, poses, number)
        episodes.restart(start)
        self.note_starts()

    def note_starts(self) -> None:
        """Take note that worlds have been started anew on the device, as by `restart_world` in a kernel of the user."""
        self.episodes.at_most = self.model.worlds
        self._stepper.place()
        self._measured_at = None

    def run(self, duration: float, *, progress: Callable[[float], None] | None = None) -> None:
        """Simulate `duration` seconds, to the nearest whole step.

        Args:
            duration: Simulated time [s], 0 or more.
            progress: Called with the simulated time every few thousand steps.
        """
        last = round((self.time + seconds("duration", duration)) / self.time_step)
        while self.state.step < last:
            self.step(min(5000, last - self.state.step))
            if progress is not None:
                progress(self.time)

    def set_state(self, *, position: ArrayLike | None = None, orientation: ArrayLike | None = None) -> None:
        """Put the bodies elsewhere; what is not given stays. A fault that a body has stays, too.

        Args:
            position: Reference points (centres of diffusion), (B, 3) for all worlds or (W, B, 3) [µm].
            orientation: Quaternions (x, y, z, w), (B, 4) or (W, B, 4); their lengths do not matter.

        Raises:
            InputError: A wrong shape, a number that is not finite, a quaternion of length 0, or an orientation where no
                body rotates.
        """
        rows = {}
        for name, values in (("position", position), ("orientation", orientation)):
            if values is not None:
                rows[name] = pose_rows(self.model, name, values)
        if "position" in rows and self.model.features.periodic:
            rows["position"], rows["image"] = self.model.in_cell(rows["position"])
        for name, values in rows.items():
            array = getattr(self.state, name)
            array.assign(values.astype(host_type(array.dtype)))
        self._stepper.place()
        self._measured_at = None

    @property
    def readout(self) -> Readout:
        """What was measured at the present state (evaluated when asked for)."""
        if self._measured_at != (self.state.step, self.control.writes):
            self.measure()
        return self.last_readout

    def measure(self) -> Readout:
        """Evaluate trap forces and distances anew, for instance after assigning to an array of `state` or `control`."""
        if not self._measures:
            load_kernels(self._step.measuring, self.model.device)
            self._measures = True
        if self._step.readout:
            model = self.model
            per_trap_and_body, per_hand = self._step.readout
            worlds, f, out = model.worlds, model.features, self.last_readout.trap_data()
            views = [model.data, self.control.data(), self.state.data(), out, wp.float64(self.time)]
            wp.launch(per_trap_and_body, dim=(worlds, f.traps + f.bodies), inputs=views, device=model.device)
            wp.launch(per_hand, dim=(worlds, 2), inputs=[model.data, out], device=model.device)
        if self._step.forces is not None:
            out = [self.last_readout.body_force, self.last_readout.body_torque]
            views = [self.model.data, self.state.data(), wp.float64(self.time)]
            dim = (self.model.worlds, self.model.features.bodies)
            wp.launch(self._step.forces, dim=dim, inputs=views, outputs=out, device=self.model.device)
        self._measured_at = (self.state.step, self.control.writes)
        return self.last_readout

    def unwrapped_position(self) -> np.ndarray:
        """(W, B, 3) reference points where they would be if space did not repeat [µm], on the host in float64."""
        position = self.state.position.numpy().astype(float)
        if not self.model.features.periodic:
            return position
        # the length as the kernels have it, so that a body that crosses does not leap
        return position + self.state.image.numpy() * np.array(self.model.data.period.length, dtype=float)

    def prim_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins (W, B, 3) [µm] and orientations (W, B, 4) of the bodies' prims, on the host in float64."""
        position = self.state.position.numpy().astype(float)
        if self.model.features.rigid:
            orientation = self.state.orientation.numpy().astype(float)
        else:
            orientation = np.broadcast_to(self.model.start_orientation(), (*position.shape[:2], 4))
        return self.model.prim_position(position, orientation), orientation

    def arrays(self) -> dict[str, wp.array]:
        """All arrays that a run changes, by the names that they have in a checkpoint."""
        groups: dict[str, Any] = {"state": self.state, "control": self.control, "readout": self.last_readout}
        out = {f"{g}.{k}": v for g, item in groups.items() for k, v in vars(item).items() if isinstance(v, wp.array)}
        if self._episodes is not None:
            out |= {f"episodes.{k}": getattr(self._episodes, k) for k in ("done", "step", "number")}
        return out

    def memory(self) -> int:
        """Bytes of device memory held by the model's tables, State, Control and Readout."""
        return device_bytes(self.model, self.state, self.control, self.last_readout)

    def save(self, path: str | Path) -> Path:
        """Write a checkpoint (`.npz`) from which `restore` continues bit for bit; errors as `checkpoint.save`."""
        from otwarp.simulation.checkpoint import save

        return save(self, Path(path))

    @classmethod
    def restore(
        cls,
        path: str | Path,
        scene: Scene | None = None,
        *,
        device: str | None = None,
        threads: int | None = None,
        forces: Sequence[Force] = (),
        ends: Sequence[End] | None = None,
    ) -> Simulation:
        """Continue from a checkpoint, in another process if need be; arguments and errors as `checkpoint.restore`."""
        from otwarp.simulation.checkpoint import restore

        return restore(cls, Path(path), scene, device=device, threads=threads, forces=forces, ends=ends)
