"""Simulation: the only object that steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError, SimulationError
from otwarp.kernels.faults import FAULT_TEXT, Fault
from otwarp.kernels.step import make_step
from otwarp.scene.description import Scene
from otwarp.simulation.info import device_bytes
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, Readout, State
from otwarp.simulation.stepping import FusedStepper, GridStepper


class Simulation:
    """A scene in motion, in `worlds` independent copies.

    Args:
        scene: What to simulate.
        worlds: Independent copies; they differ in their noise and in the parameters given per world.
        seed: Key of the random streams, 0 … 2³² − 1.
        device: `"cpu"`, `"cuda:0"`, … or None for the best available.
        time_step: Explicit step [s]; None lets the scene and its accuracy decide.
        parameters: Values that replace the scene's, for all worlds or per world; see
            `otwarp.simulation.parameters.PARAMETERS`. A sweep costs the memory of what is swept.
        threads: Worker threads on the CPU; None uses all cores. Results do not depend on it.

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
        parameters: Mapping[str, ArrayLike] | None = None,
        threads: int | None = None,
    ):
        self.model = Model.build(
            scene, worlds=worlds, seed=seed, device=device, time_step=time_step, parameters=parameters
        )
        if threads is not None and threads < 1:
            raise InputError(f"threads is {threads}; allowed: 1 or more")
        self.state = State.start(self.model)
        self.control = Control.start(self.model)
        self._readout = Readout.empty(self.model)
        self._measured_at: int | None = None
        self._step = make_step(self.model.features)
        parts = (self._step, self.model, self.state, self.control, self._readout)
        self._stepper = GridStepper(*parts) if self.model.features.driver == "grid" else FusedStepper(*parts, threads)

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

    def step(self, steps: int = 1) -> None:
        """Take `steps` time steps.

        Raises:
            InputError: `steps` is negative.
            SimulationError: The state is no longer physical; bodies with a fault keep their last good pose.
        """
        if steps < 0:
            raise InputError(f"steps is {steps}; allowed: 0 or more")
        if steps == 0:
            return
        self._stepper.advance(self.state.step, steps)
        self.state.step += steps
        self.state.time = self.state.step * self.time_step
        self._measured_at = None
        self._check()

    def run(self, duration: float, *, progress: Callable[[float], None] | None = None) -> None:
        """Simulate `duration` seconds, to the nearest whole step.

        Args:
            duration: Simulated time [s], 0 or more.
            progress: Called with the simulated time every few thousand steps.
        """
        if not (np.isfinite(duration) and duration >= 0.0):
            raise InputError(f"duration is {duration:g} s; allowed: a finite time, 0 or more")
        last = round((self.time + duration) / self.time_step)
        while self.state.step < last:
            self.step(min(5000, last - self.state.step))
            if progress is not None:
                progress(self.time)

    @property
    def readout(self) -> Readout:
        """What was measured at the present state (evaluated when asked for)."""
        if self._measured_at != self.state.step or self._measured_at is None:
            self.measure()
        return self._readout

    def measure(self) -> Readout:
        """Evaluate trap forces and distances anew, for instance after writing `control`."""
        if self._step.readout:
            model = self.model
            per_trap, per_sphere, per_hand = self._step.readout
            out, time = self._readout.trap_data(), wp.float64(self.time)
            views = [model.data, self.control.data(), self.state.data(), out, time]
            worlds, f = model.worlds, model.features
            wp.launch(per_trap, dim=(worlds, f.traps), inputs=views, device=model.device)
            wp.launch(per_sphere, dim=(worlds, f.bodies), inputs=views, device=model.device)
            wp.launch(per_hand, dim=(worlds, 2), inputs=[model.data, out], device=model.device)
        self._measured_at = self.state.step
        return self._readout

    def prim_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins (W, B, 3) [µm] and orientations (W, B, 4) of the bodies' prims, on the host in float64."""
        position = self.state.position.numpy().astype(float)
        if self.model.features.rigid:
            orientation = self.state.orientation.numpy().astype(float)
        else:
            orientation = np.broadcast_to(self.model.start_orientation(), (*position.shape[:2], 4))
        return self.model.prim_position(position, orientation), orientation

    def memory(self) -> int:
        """Bytes of device memory held by the model's tables, State, Control and Readout."""
        return device_bytes(self.model, self.state, self.control, self._readout)

    def save(self, path: str | Path) -> Path:
        """Write a checkpoint from which `Simulation.restore` continues bit for bit; see `checkpoint.save`."""
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
    ) -> Simulation:
        """Continue from a checkpoint; see `checkpoint.restore`."""
        from otwarp.simulation.checkpoint import restore

        return restore(Path(path), scene, device=device, threads=threads)

    def _check(self) -> None:
        """Raise for the earliest fault on the device."""
        if self._readout.fault_count.numpy()[0] == 0:
            return
        code, when = self._readout.fault.numpy(), self._readout.fault_step.numpy()
        world, body = min(np.argwhere(code), key=lambda wb: (when[tuple(wb)], tuple(wb)))
        step = int(when[world, body])
        raise SimulationError(
            FAULT_TEXT[Fault(int(code[world, body]))],
            world=int(world),
            body=self.scene.bodies[body].name,
            step=step,
            time=step * self.time_step,
        )
