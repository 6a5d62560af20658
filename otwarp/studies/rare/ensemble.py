"""Worlds that go on from states until their order parameter comes to an interface, all in one simulation."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.drivers.interfaces import ADVANCED, NO_NUMBER, RETURNED
from otwarp.scene import Scene
from otwarp.simulation.capture import CapturedLoop
from otwarp.simulation.drivers.compilation import load_kernels
from otwarp.simulation.ends import escaped
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.simulation import Simulation
from otwarp.studies.rare.orders import Order
from otwarp.studies.rare.states import States, read, write
from otwarp.studies.rows import origin_of, parameter_rows, start_rows
from otwarp.studies.runner import check_wanted
from otwarp.studies.targets import Target

FAULT, LOST, GONE_BACK, UP, IDLE = -1, 1, int(RETURNED), int(ADVANCED), 9
"""Codes of a world: its state is no longer physical, its trap has lost the sphere, it is below its lower interface, or
at its upper one; not in use."""

WATCHED = 8
"""Looks between two questions whether any world is still in motion."""

FEW = 512
"""Worlds in motion that go on in a smaller simulation, whose looks are one graph: the last ones take long."""

AT_ONCE = 32
"""Its looks between two such questions."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Paths:
    """What became of n paths.

    Attributes:
        code: (n) `LOST`, `UP`, `GONE_BACK`, or `FAULT`.
        states: Where they ended.
        peak: (n) largest order parameter on the way, infinity for the lost.
        looks: How often each was looked at.
    """

    code: np.ndarray
    states: States
    peak: np.ndarray
    looks: np.ndarray


class Ensemble:
    """A simulation whose worlds run paths between interfaces.

    Paths are a Markov chain in steps of `every` time steps: where their order parameter is counts at looks alone, so
    that every set of states between two interfaces is well defined. An escape is seen by the engine in any time step,
    crossings within one included; it ends a path at the next look.

    Args:
        scene: The scene of a point.
        values: Per target that is another one at this point its (1) or (1, 3) values.
        worlds: W.
        order: What interfaces are values of.
        seed: Key of the random numbers.
        time_step: [s].
        every: Time steps from look to look.
        options: What else is chosen about the step.
        device: Where.
        threads: On a CPU; None for as many as there are cores.
        unwanted: Set by another thread when nobody wants the paths any more: the next look raises `CancelledError`.
    """

    def __init__(
        self,
        scene: Scene,
        values: dict[Target, np.ndarray],
        worlds: int,
        *,
        order: Order,
        seed: int,
        time_step: float,
        every: int,
        options: StepOptions,
        device: str,
        threads: int | None = None,
        unwanted: threading.Event | None = None,
    ):
        origin = origin_of(scene, options)
        self.every, self.order, self._unwanted = every, order, unwanted
        named: dict[str, Any] = {"order": order, "seed": seed, "time_step": time_step, "every": every}
        named |= {"options": options, "device": device, "threads": 1, "unwanted": unwanted}
        self._smaller = lambda: Ensemble(scene, values, FEW, **named)
        self._few: Ensemble | None = None
        self._loop: CapturedLoop | None = None
        self.sim = Simulation(
            scene,
            worlds=worlds,
            seed=seed,
            device=device,
            threads=threads,
            parameters=parameter_rows(origin, values, 1),
            ends=[escaped],
            time_step=time_step,
            integrator=options.integrator,
            noise=options.noise,
            fast_math=options.fast_math,
            precision=options.precision,
            forces=options.forces,
            allow_large_step=True,  # judged when the study was planned
        )
        model = self.sim.model
        self._starts = {name: rows[0] for name, rows in start_rows(origin, values, 1).items()}
        f, place = model.features, model.place
        self._kernel = kernel_module("drivers.interfaces", f.precision).interface_kernel(
            f if order.function is None else None, order.function or order.name
        )
        row = np.array([order.values_in(model.scene)], dtype=np.float32).reshape(1, -1)
        self._values = device_array(row, wp.float32, place, ndim=2)
        self.low, self.high, self._order, self.peak = (
            device_array(np.full(worlds, value), wp.float32, place) for value in (-np.inf, np.inf, np.nan, -np.inf)
        )
        self.done = self.sim.episodes.done
        self.moving = f.moving_traps or f.moving_obstacles
        self.done.fill_(IDLE)

    @property
    def slowness(self) -> float:
        """Looks in the fastest relaxation time of the traps, 0 without traps."""
        model = self.sim.model
        rate = model.relaxation.fastest(model.values["trap_power"].max(axis=0))[0] if model.scene.traps else 0.0
        return 1.0 / (rate * self.every * self.sim.time_step) if rate > 0.0 else 0.0

    @property
    def worlds(self) -> int:
        """How many there are."""
        return self.sim.model.worlds

    def start(self, worlds: np.ndarray, numbers: np.ndarray, clock: np.ndarray | None = None) -> None:
        """Put worlds, by their indices, where the scene starts, with the noise of trials of these numbers.

        Args:
            clock: What their clocks say; None: 0.
        """
        chosen, trials = np.zeros(self.worlds, dtype=bool), np.zeros(self.worlds, dtype=np.uint32)
        chosen[worlds], trials[worlds] = True, numbers
        self.sim.reset(chosen, **self._starts, number=trials)
        if clock is not None:
            self._assign(self.sim.episodes.step, worlds, clock)
        self._assign(self.peak, worlds, -np.inf)

    def between(self, worlds: np.ndarray, low: np.ndarray | float, high: np.ndarray | float) -> None:
        """Give worlds, by their indices, a lower and an upper interface, and have them in motion."""
        self._assign(self.low, worlds, low)
        self._assign(self.high, worlds, high)
        self._assign(self.done, worlds, 0)
        self.sim.episodes.at_most = self.worlds

    def rest(self, worlds: np.ndarray) -> None:
        """Have worlds, by their indices, stand still."""
        self._assign(self.done, worlds, IDLE)

    def clock(self, worlds: np.ndarray) -> np.ndarray:
        """Steps on the clocks of some worlds."""
        return self.sim.episodes.step.numpy()[worlds].copy()

    def _assign(self, array: wp.array, worlds: np.ndarray, values: np.ndarray | float) -> None:
        rows = array.numpy().copy()
        rows[worlds] = values
        array.assign(rows)

    def look(self) -> np.ndarray:
        """Step the worlds in motion to their next look; (W) codes of all, 0 in motion, to be read before the next.

        Raises:
            InputError: The order parameter of a world is NaN.
            CancelledError: `unwanted` is set.
        """
        self.turn()
        done = self.done.numpy()
        self._check(done)
        return done

    def turn(self) -> None:
        """The same, and nothing is read."""
        check_wanted(self._unwanted)
        self.sim.step(self.every)
        if self.order.measured:
            self.sim.measure()
        self._watch()

    def _watch(self) -> None:
        """Read the order parameters of the worlds in motion."""
        sim = self.sim
        views = [sim.model.data, sim.control.data(), sim.state.data(), sim.last_readout.data(), self._values]
        out = [self.low, self.high, self._order, self.peak]
        wp.launch(self._kernel, dim=self.worlds, inputs=views + out, device=sim.model.device)

    def turns(self, count: int) -> None:
        """`count` looks as one graph, and nothing is read."""
        check_wanted(self._unwanted)
        if self._loop is None:
            load_kernels((self._kernel,), self.sim.model.device)
            self._loop = self.sim.capture(self.every, after=self._watch, readout=self.order.measured)
        self._loop(count)

    def _check(self, done: np.ndarray) -> None:
        if np.any(done == int(NO_NUMBER)):
            raise InputError(
                f"order {self.order.name} is NaN in {int(np.sum(done == int(NO_NUMBER)))} of {self.worlds} worlds "
                "on their way; allowed: a function that is a finite number wherever the bodies can be"
            )

    def orders(self, worlds: np.ndarray) -> np.ndarray:
        """Order parameters of some worlds at their last look, in float64."""
        return self._order.numpy()[worlds].astype(float)

    def states(self, worlds: np.ndarray) -> States:
        """States of some worlds, by their indices."""
        return read(self.sim, worlds, self.orders(worlds), self.done.numpy()[worlds] == LOST)

    def run(
        self,
        worlds: np.ndarray,
        states: States,
        numbers: np.ndarray,
        low: np.ndarray | float,
        high: np.ndarray | float,
    ) -> Paths:
        """Let paths go on from states until each is below `low`, at `high` or above, or lost.

        A state that is at `high` already, or was lost when it was kept, has arrived without a step: who crosses several
        interfaces between two looks has crossed each of them.

        Args:
            worlds: (n) indices of the worlds that run them, which have the parameters of their points.
            states: (n) where they begin.
            numbers: (n) trials whose noise they go on with.
            low, high: Interfaces, (n) or one.
        """
        n = len(states)
        low, high = (np.broadcast_to(np.asarray(v, dtype=float), n) for v in (low, high))
        goes = np.flatnonzero(~states.escaped & (states.order < high))
        code = np.where(states.escaped, LOST, UP).astype(np.int32)
        peak = np.where(states.escaped, np.inf, states.order)
        looks = np.zeros(n, dtype=np.int64)
        if len(goes):
            used, begun = worlds[goes], states.clock[goes]
            write(self.sim, used, states[goes], numbers[goes])
            self.done.fill_(IDLE)
            self._assign(self.peak, used, states.order[goes])
            self.between(used, low[goes], high[goes])
            self._until_few(used)
            self._last(used, numbers[goes], low[goes], high[goes])
            code[goes] = self.done.numpy()[used]
            ends = self.states(used)
            looks[goes] = (ends.clock - begun) // self.every
            peak[goes] = np.where(code[goes] == LOST, np.inf, self.peak.numpy()[used])
            states = states.put(goes, ends)
            self.done.fill_(IDLE)
        return Paths(code=code, states=states, peak=peak, looks=looks)

    def _until_few(self, used: np.ndarray) -> None:
        """Step until few worlds are in motion, or none."""
        small = self.worlds <= FEW
        while np.sum(self.done.numpy()[used] == 0) > (0 if small else FEW):
            if small:
                self.turns(AT_ONCE)
            else:
                for _ in range(WATCHED):
                    self.turn()
            self._check(self.done.numpy())

    def _last(self, used: np.ndarray, numbers: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
        """Step the few that are left, elsewhere, and bring them back: the same bits, in less time."""
        left = np.flatnonzero(self.done.numpy()[used] == 0)
        if not len(left):
            return
        if self._few is None:
            self._few = self._smaller()
        few, here, there = self._few, used[left], np.arange(len(left))
        few.done.fill_(IDLE)
        write(few.sim, there, self.states(here), numbers[left])
        few._assign(few.peak, there, self.peak.numpy()[here])
        few._assign(few._order, there, self._order.numpy()[here])
        few.between(there, low[left], high[left])
        while np.any(few.done.numpy() == 0):
            few.turns(AT_ONCE)
            few._check(few.done.numpy())
        code, peak, order = few.done.numpy()[there], few.peak.numpy()[there], few._order.numpy()[there]
        write(self.sim, here, few.states(there), numbers[left])
        for array, values in ((self.done, code), (self.peak, peak), (self._order, order)):
            self._assign(array, here, values)
        few.done.fill_(IDLE)
