"""Trials of some points on a device: each world runs one, and stands still when it is over."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import beside_queued, empty, pick_device, reading
from otwarp.kernels.core.precision import kernel_module
from otwarp.scene import Scene
from otwarp.simulation.drivers.compilation import load_kernels
from otwarp.simulation.ends import End, escaped
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.arrays import device_array, gathered
from otwarp.simulation.packing.parameters import SharedRows
from otwarp.simulation.simulation import Simulation
from otwarp.studies.axes import Scatter
from otwarp.studies.observables import Observable
from otwarp.studies.rows import FARTHEST, base_of, normal_of, origin_of, parameter_rows, start_rows, width_of
from otwarp.studies.targets import Target

MANY = 2**15
"""Worlds from which on a GPU steps each in one thread."""

LOOKS = 50
"""Times that the worlds are looked at within the horizon where nothing else is said."""

SHORTEST, LONGEST, GROWTH = 0.01, 1 / 16, 0.25
"""Of the horizon, the time between looks that outcomes do not hang on, and of the time that has passed: many trials end
early or none; each look lists the worlds in motion, of which all wait until the next."""

UNSEEN = 4
"""Times that worlds are given steps before the host looks how many are left: a GPU idles from there to the next steps,
and threads without a world return at once."""

LAST = 1 / 8
"""Of the horizon, the end in which the host does not look: a GPU has work while it is given the next trials."""

GOING, FAULT = 0, -1
"""Codes of a trial that no end came to within its horizon, and of one whose state was no longer physical."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcomes:
    """What became of n trials.

    Attributes:
        code: (n) int8: the number of the end that came first, from 1; `GOING`; `FAULT`.
        time: (n) when it came, or how long the trial went on [s].
        numbers: (n, m) what observables of kind `number` kept.
    """

    code: np.ndarray
    time: np.ndarray
    numbers: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class Runner:
    """How trials of a study run, all alike.

    Attributes:
        seed: Key of the random numbers of all trials.
        horizon: How long a trial goes on at most [s].
        steps: Of the horizon.
        looks_every: Time between looks at the worlds, about [s]; None: `LOOKS` in all, or where trials end by escapes
            alone, which are known to the step, as often as it pays.
        ends: What may end a trial.
        numbers: Observables of kind `number`.
        scatter: What varies from trial to trial.
        options: What is chosen about the step.
    """

    seed: int
    horizon: float
    steps: int
    looks_every: float | None
    ends: tuple[End, ...]
    numbers: tuple[Observable, ...]
    scatter: tuple[tuple[Target, Scatter], ...]
    options: StepOptions

    @property
    def time_step(self) -> float:
        """Of all of them [s]."""
        return self.horizon / self.steps

    @property
    def every(self) -> int:
        """Steps between looks at the worlds that outcomes may hang on."""
        return max(1, round((self.looks_every or self.horizon / LOOKS) / self.time_step))

    def segments(self) -> Iterator[int]:
        """Steps from each look at the worlds to the next."""
        fixed = self.looks_every is not None or self.numbers or not all(_loses(end) for end in self.ends)
        done = 0
        while done < self.steps:
            share = min(max(SHORTEST * self.steps, GROWTH * done), LONGEST * self.steps)
            count = min(self.every if fixed else max(1, round(share)), self.steps - done)
            yield count
            done += count

    def in_steps(self, steps: int) -> Runner:
        """The same horizon in so many steps."""
        return self if steps == self.steps else dataclasses.replace(self, steps=steps)

    def shortened(self, steps: int) -> Runner:
        """So many of the same steps."""
        part = steps * self.time_step
        return dataclasses.replace(self, horizon=part, steps=steps, looks_every=part)

    def run(
        self,
        scene: Scene,
        values: dict[Target, np.ndarray],
        trials: np.ndarray,
        *,
        which: np.ndarray | None = None,
        beside: dict[Target, np.ndarray] | None = None,
        device: str,
        threads: int | None = None,
    ) -> Outcomes:
        """Run trials, each in a world of its own.

        Args:
            scene: The scene of their group.
            values: Per target that differs from world to world its (k) or (k, 3) values.
            trials: (n) numbers of the trials; one number has one outcome, whatever else runs beside it.
            which: (n) int32, which of the values each trial has; None: its own, k = n.
            beside: Values of all points that these are some of. What is chosen for all worlds alike, such as which
                sphere a trap holds and how contacts are solved, is chosen for all of them; None: for these alone.
            device: Where.
            threads: On a CPU; None for as many as there are cores.
        """
        return self.start(scene, values, trials, which=which, beside=beside, device=device, threads=threads)()

    def start(
        self,
        scene: Scene,
        values: dict[Target, np.ndarray],
        trials: np.ndarray,
        *,
        device: str,
        unwanted: threading.Event | None = None,
        **how: Any,
    ) -> Callable[[], Outcomes]:
        """Give a device all steps of trials; arguments as of `run`.

        Returns:
            What waits for the steps and reads what became of the trials. A GPU goes on meanwhile: it may be given the
            next ones before.

        Raises:
            CancelledError: `unwanted` was set meanwhile.
        """
        check_wanted(unwanted)
        with beside_queued(pick_device(device)):
            sim = self.simulation(scene, values, trials, device=device, **how)
            observer = _Observer(sim, self.numbers) if self.numbers else None
        taken = 0
        for n, count in enumerate(self.segments(), start=1):
            taken += count
            check_wanted(unwanted)
            sim.step(count, look=n % UNSEEN == 0 and taken < (1.0 - LAST) * self.steps)
            if observer is not None:
                observer.look(count)
            if not sim.episodes.at_most:  # as nothing but ends stops worlds here; `running` brings a number of each
                break
        return self._outcomes(sim, observer)

    def simulation(
        self,
        scene: Scene,
        values: dict[Target, np.ndarray],
        trials: np.ndarray,
        *,
        which: np.ndarray | None = None,
        beside: dict[Target, np.ndarray] | None = None,
        device: str,
        threads: int | None = None,
    ) -> Simulation:
        """The worlds of trials at their start; arguments as of `run`."""
        n = len(trials)
        origin = origin_of(scene, self.options)
        if which is None or self.scatter:
            values = values if which is None else {t: v[which] for t, v in values.items()}
            which = np.arange(n, dtype=np.int32)
        count = int(which.max()) + 1
        rows = parameter_rows(origin, values | self._scattered(origin, values, trials), count)
        total = count
        if beside is not None:
            more = self._extremes(origin, beside)
            others = max((len(v) for v in more.values()), default=1)
            below = parameter_rows(origin, more, others)
            rows = {name: np.concatenate([row, below[name]]) for name, row in rows.items()}
            total += others
            # a GPU shares few worlds out to several threads each, which round otherwise
            worlds = max(others, MANY - n if device.startswith("cuda") else 0)
            which = np.concatenate([which, np.resize(np.arange(count, total, dtype=np.int32), worlds)])
        sim = Simulation(
            scene,
            worlds=len(which),
            part=(0, n),
            seed=self.seed,
            device=device,
            threads=threads,
            parameters=SharedRows(rows, total, which),
            ends=self.ends,
            time_step=self.time_step,
            integrator=self.options.integrator,
            noise=self.options.noise,
            fast_math=self.options.fast_math,
            precision=self.options.precision,
            forces=self.options.forces,
            allow_large_step=True,  # judged when the study was planned
        )
        model, starts = sim.model, start_rows(origin, values, count)
        assert model.which is not None
        kinds = {"position": wp.vec3, "orientation": wp.quat}
        rows_of = {name: device_array(row, kinds[name], model.place, ndim=2) for name, row in starts.items()}
        poses = {name: gathered(row, model.which) for name, row in rows_of.items()}
        sim.reset(**poses, number=device_array(trials, wp.uint32, model.device))
        return sim

    def _outcomes(self, sim: Simulation, observer: _Observer | None) -> Callable[[], Outcomes]:
        """What reads the outcomes of worlds whose steps a device was given; the worlds last until then."""
        episodes, device = sim.episodes, sim.model.device
        n = sim.model.worlds
        code = empty(n, wp.int8, device)
        time = empty(n, wp.float64, device)
        number = next((k for k, end in enumerate(self.ends, start=1) if _loses(end)), 0)
        kernel = kernel_module("drivers.episodes", sim.model.features.precision).outcomes
        # forces and distances of the traps are not asked for
        readout = sim.last_readout
        inputs = [episodes.done, episodes.step, readout.fault, readout.fault_step, readout.escape_step, number]
        inputs.append(wp.float64(self.time_step))
        wp.launch(kernel, dim=n, inputs=inputs, outputs=[code, time], device=device)
        arrays = reading([code, time, *([] if observer is None else [observer.kept])], device)

        def read() -> Outcomes:
            """Wait for the steps; the worlds last until then, as this refers to them."""
            code, time, *kept = arrays()
            return Outcomes(
                code=code, time=time, numbers=kept[0] if kept else np.zeros((sim.model.worlds, 0), np.float32)
            )

        return read

    def _extremes(self, origin: Model, values: dict[Target, np.ndarray]) -> dict[Target, np.ndarray]:
        """Values of points, twice where some scatter: the farthest below and above, in the sign they have."""
        if not self.scatter:
            return values
        count = max((len(v) for v in values.values()), default=1)
        out = {t: np.concatenate([v, v]) for t, v in values.items()}
        for target, scatter in self.scatter:
            mean = np.broadcast_to(values.get(target, base_of(origin, target)), count)
            reach = FARTHEST * width_of(mean, target, scatter)
            low, high = np.where(mean > 0.0, np.maximum(mean - reach, 0.01 * mean), mean - reach), mean + reach
            out[target] = np.concatenate([low, high])
        return out

    def _scattered(
        self, origin: Model, values: dict[Target, np.ndarray], trials: np.ndarray
    ) -> dict[Target, np.ndarray]:
        """Scattered parameters: the same draw for a trial in whatever batch it runs."""
        out = {}
        for n, (target, scatter) in enumerate(self.scatter):
            mean = values.get(target)
            if mean is None:
                mean = base_of(origin, target)
            out[target] = mean + width_of(mean, target, scatter) * normal_of(self.seed, n, trials)
        return out


def check_wanted(unwanted: threading.Event | None) -> None:
    """Raise if what a thread computes is not wanted any more.

    Raises:
        CancelledError: It is not.
    """
    if unwanted is not None and unwanted.is_set():
        raise CancelledError


def _loses(end: End) -> bool:
    """Whether an end is that a trap has lost its sphere."""
    return end.predicate.function is escaped.predicate.function


class _Observer:
    """Reads numbers of the worlds in motion after every segment."""

    def __init__(self, sim: Simulation, observables: Sequence[Observable]):
        self.sim = sim
        self.measured = any(o.measured for o in observables)
        device, n = sim.model.device, sim.model.worlds
        row = np.array([[v for o in observables for v in o.values]], dtype=np.float32).reshape(1, -1)
        self.values = wp.array(row, dtype=wp.float32, device=device, ndim=2)
        self.kept = wp.zeros((n, len(observables)), dtype=wp.float32, device=device)
        self.counts = wp.zeros(n, dtype=int, device=device)
        module = kernel_module("drivers.observations", sim.model.features.precision)
        functions = tuple(o.function for o in observables if o.function is not None)
        self.kernel = module.observe_kernel(functions, tuple(o.keep for o in observables))
        load_kernels([self.kernel], device)

    def look(self, steps: int) -> None:
        """Read the worlds that have just taken `steps` steps."""
        sim = self.sim
        readout = sim.measure() if self.measured else sim.last_readout
        views = [sim.model.data, sim.state.data(), readout.data(), self.values, self.kept, self.counts, steps]
        wp.launch(self.kernel, dim=sim.model.worlds, inputs=views, device=sim.model.device)
