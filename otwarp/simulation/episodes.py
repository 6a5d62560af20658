"""Episodes: worlds that end, stand still at no cost, and start anew, each with a clock and a trial of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.drivers import predicates
from otwarp.simulation.drivers.launches import RecordedLaunch
from otwarp.simulation.ends import End
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.starts import Starts
from otwarp.simulation.state import Bound, Readout, State


@dataclass(eq=False, kw_only=True)
class Episodes(Bound):
    """Which worlds are in motion, since when, and with which noise. Every world runs one trial after the other.

    Trial n is a function of the seed, n and where it starts: the same in whatever world it runs, beside whatever else,
    and the same as world n of a simulation without episodes. A world that has ended keeps its state and readout until
    it is reset.

    Attributes:
        done: (W) int32, 0 in motion, else why it ended: n for the n-th of the `ends`, counted from 1, -1 for a fault
            (see `Readout.fault`). Any other number may be written to end a world; `Simulation.reset` starts it again.
        step: (W) int64 steps since the world was started or reset; `Readout.escape_step` and `fault_step` count so too.
        number: (W) uint32 of the trial that each world runs.
        living: (W) int32 worlds in motion as the last segment found them, in the first `count[0]` places; or all.
        count: (2) int32 how many these were, and how many of them `Simulation.step` has just left in motion.
        values: (1|W, P) parameters of the ends, one after the other; a vector takes three columns.
        model: What is simulated.
        ends: What ends a world.
        at_most: Bound of the worlds in motion, known to the host.
        complete: Whether the list was last made by `list_all`, as the host knows.
        origin: How a reset world starts where nothing else is said.
        views: What the kernels see: model, state and readout.
        launches: What a segment launches.
    """

    done: wp.array
    step: wp.array
    number: wp.array
    living: wp.array
    count: wp.array
    values: wp.array
    model: Model
    ends: tuple[End, ...]
    at_most: int
    origin: Starts
    views: tuple[Any, ...]
    launches: dict[str, RecordedLaunch]
    complete: bool = False

    @classmethod
    def start(cls, model: Model, ends: tuple[End, ...], state: State, readout: Readout) -> Episodes:
        """All worlds in motion, in their first trials.

        Raises:
            InputError: A parameter of an end is wrong, or nothing can escape.
        """
        if not model.features.escapes and any(end.predicate.function is predicates.escaped for end in ends):
            where = model.scene.file or model.scene.root
            raise InputError(f"{where}: end escaped: no trap with a finite reach holds a sphere; allowed: other ends")
        data = model.episode_data[0]
        w = model.all_worlds
        rows = [model.rows(end.rows(w, model.data.bodies)) for end in ends] or [np.zeros((1, 0))]
        most = max(len(r) for r in rows)
        values = np.hstack([np.broadcast_to(r, (most, r.shape[1])) for r in rows])
        values = device_array(values, wp.float32, model.place, ndim=2)
        views, device = (model.data, state.data(), readout.data()), model.device
        kernels = kernel_module("drivers.episodes", model.features.precision)
        settle = kernels.settle_kernel(tuple(end.predicate for end in ends))
        arrays = {name: getattr(data, name) for name in ("done", "step", "number", "living", "count")}
        return cls(
            **arrays,
            values=values,
            model=model,
            ends=ends,
            at_most=model.worlds,
            origin=Starts.of_scene(model),
            views=views,
            launches={
                "list": RecordedLaunch(kernels.list_living, device, [model.data]),
                "settle": RecordedLaunch(settle, device, [*views, values]),
                "restart": RecordedLaunch(kernels.restart, device, views),
            },
        )

    @property
    def running(self) -> int:
        """How many worlds are in motion."""
        return int(np.count_nonzero(self.done.numpy() == 0))

    @property
    def time(self) -> np.ndarray:
        """(W) seconds since each world was started or reset, on the host."""
        return self.step.numpy() * self.model.time_step

    @property
    def kernels(self) -> tuple[wp.Kernel, ...]:
        """What is launched of episodes."""
        flags = kernel_module("drivers.episodes", self.model.features.precision).flag_worlds
        return flags, *(launch.kernel for launch in self.launches.values())

    def list(self) -> int:
        """List the worlds in motion anew; no more than so many are.

        A CPU knows how many there are. A GPU is not waited for, and threads beyond the list return at once.
        """
        device = self.model.device
        self.complete = False
        self.count.zero_()
        self.launches["list"](self.model.worlds)
        if device.is_capturing:
            return self.model.worlds
        return int(self.count.numpy()[0]) if device.is_cpu else self.at_most

    def list_all(self) -> None:
        """List all worlds, in motion or not, unless they are listed already."""
        if not self.complete:
            worlds = self.model.worlds
            self.living.assign(np.arange(worlds, dtype=np.int32))
            self.count.assign(np.array([worlds, 0], dtype=np.int32))
            self.complete = True

    def settle(self, steps: int, places: int) -> None:
        """After `steps` steps: turn the clocks of the worlds in `places` of the list, and end what is over."""
        self.launches["settle"](places, steps)

    def look(self) -> None:
        """Learn how many worlds are still in motion: the one number that a segment brings to the host."""
        self.at_most = int(self.count.numpy()[1])

    def restart(self, start: Starts) -> None:
        """Start chosen worlds anew; see `Simulation.reset`."""
        model = self.model
        self.launches["restart"](model.worlds, start.chosen, start.state, start.number, wp.uint32(model.all_worlds))
