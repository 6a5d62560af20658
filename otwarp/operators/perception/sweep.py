"""A sweep of SIMULATED operators over delays and errors of perception: which trials there are, what is kept of each."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.operators.kernels.types import NOTHING, RESPONDS
from otwarp.operators.people import persons
from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.loop import PerceivedLoop
from otwarp.operators.perception.probe import Probing, run_probes
from otwarp.operators.study import LOOK, OperatorStudy, kept

AXES = {
    "delay": ("delay from a picture to the chain", "s"),
    "depth_error": ("standard deviation of the depth", "µm"),
    "tilt_error": ("standard deviation of the tilt", "°"),
    "frame_rate": ("frame rate", "Hz"),
    "lateral_error": ("standard deviation along x and along y", "µm"),
}
"""What a sweep goes over, with meaning and unit: fields of `Perception`."""
CHUNK_CPU, CHUNK_GPU = 256, 16_384
"""Trials that run at once where nothing else is asked for."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One of the conditions under which every operator does the task.

    Attributes:
        cell: Of the grid, −1 beside it.
        felt: Whether the force is felt.
        perception: What stands between the scene and chain and eyes.
    """

    cell: int
    felt: bool
    perception: Perception


@dataclass(frozen=True, eq=False, kw_only=True)
class Sweep:
    """Simulated operators at a scene's task, each under all perceptions of a grid with the same random numbers.

    Attributes:
        study: Scene, operators, seed, gains, and the rest of who does what.
        axes: Values of `AXES` by name, each ascending and once; those not named have the value of `base`.
        base: Perception of all cells in what no axis says.
        chunk: Trials that run at once; results do not depend on it.
        repeats: Worlds of a probe; 0 for no probes.
        depth_range: Of which depth errors were said to be parts [µm]; None where they were said in µm. Told, not used.

    Raises:
        InputError: Anything out of range, values twice or out of order.
    """

    study: OperatorStudy
    axes: Mapping[str, tuple[float, ...]]
    base: Perception = field(default_factory=Perception)
    chunk: int = CHUNK_CPU
    repeats: int = 2
    depth_range: float | None = None

    def __post_init__(self) -> None:
        for name, values in self.axes.items():
            if name not in AXES:
                raise InputError(f"axis is {name!r}; allowed: {', '.join(AXES)}")
            if not values or any(b <= a for a, b in itertools.pairwise(values)):
                raise InputError(f"{name} is {values}; allowed: one value or more, each above the one before")
        if int(self.chunk) != self.chunk or self.chunk < 1:
            raise InputError(f"chunk is {self.chunk!r}; allowed: a whole number, 1 or more")
        if self.study.sobol:
            raise InputError("a sweep has no Sobol indices; allowed: --operators")
        assert self.cells  # whose perceptions are in range

    @property
    def population(self) -> Any:
        """Who the operators are."""
        return self.study.population

    @cached_property
    def grid(self) -> dict[str, tuple[float, ...]]:
        """Values of all axes by name."""
        return {name: tuple(self.axes.get(name, (getattr(self.base, name),))) for name in AXES}

    @cached_property
    def cells(self) -> tuple[Perception, ...]:
        """Perceptions of the grid, the last axis fastest."""
        points = itertools.product(*self.grid.values())
        return tuple(replace(self.base, **dict(zip(self.grid, point, strict=True))) for point in points)

    @property
    def perfect(self) -> Perception:
        """Perception that the cells are set against: no delay, no errors, every picture of the microscope."""
        return Perception(frame_rate=self.study.frame_rate)

    @cached_property
    def arms(self) -> tuple[Arm, ...]:
        """Conditions: beside the grid the perfect perception, with haptics and without; then the cells with haptics,
        and without where the eyes depend on the cell."""
        beside = tuple(Arm(cell=-1, felt=felt, perception=self.perfect) for felt in (False, True))
        felt = tuple(Arm(cell=n, felt=True, perception=p) for n, p in enumerate(self.cells))
        blind = tuple(replace(arm, felt=False) for arm in felt if arm.perception.eyes == "twin")
        return beside + felt + blind

    @property
    def count(self) -> int:
        """Trials in all."""
        return self.study.operators * len(self.arms)

    @property
    def chunks(self) -> int:
        """Parts that are computed at once."""
        return -(-self.count // self.chunk)

    def members(self, chunk: int) -> np.ndarray:
        """(n) operators of the trials of a chunk."""
        return self.trials(chunk) // len(self.arms)

    def trials(self, chunk: int) -> np.ndarray:
        """Numbers of the trials of a chunk: operator·arms + arm, so that operators are whole one after the other."""
        return np.arange(chunk * self.chunk, min((chunk + 1) * self.chunk, self.count))

    def loop(self, trials: np.ndarray, device: str | None) -> PerceivedLoop:
        """The worlds of trials at their start."""
        study, arms = self.study, [self.arms[n] for n in trials % len(self.arms)]
        operators = trials // len(self.arms)
        values = study.values(operators)
        seen = study.population.names.index("visual_delay")
        values[:, seen] += [arm.perception.display_delay for arm in arms]
        rows = persons(
            study.population, values, study.task, 1.0 / study.task.plans[0].config.chain.rate,
            number=study.numbers(operators), feels=np.array([RESPONDS if arm.felt else NOTHING for arm in arms]),
        )  # fmt: skip
        return PerceivedLoop(
            study.task, rows, [arm.perception for arm in arms], seed=study.seed, device=device,
            time_step=study.time_step, frame_rate=study.frame_rate,
        )  # fmt: skip

    def run_chunk(self, chunk: int, *, device: str | None = None) -> dict[str, np.ndarray]:
        """Trials of a chunk: arrays (n) by name, see `study.kept` and `PerceivedLoop.fidelity`."""
        trials = self.trials(chunk)
        loop = self.loop(trials, device)
        while loop.running:
            loop.run(LOOK)
        return {**kept(loop), **loop.fidelity(), "arm": (trials % len(self.arms)).astype(np.int32)}

    def probe(self, *, device: str | None = None) -> dict[str, np.ndarray]:
        """What delay and errors do to a force without a person: `probe.run_probes` of the perfect one and all cells."""
        study = replace(self.study, duration=None)  # nobody is asked to be in time
        ask = Probing(repeats=self.repeats, seed=study.seed, frame_rate=study.frame_rate, time_step=study.time_step)
        perceptions = [self.perfect, *self.cells]
        return dict(run_probes(study.task, study.population, perceptions, ask, device=device))

    def asked(self) -> dict[str, Any]:
        """All that the results follow from, as JSON."""
        said = {**self.study.asked(), "chunk": self.chunk, "probes": self.repeats}
        del said["conditions"], said["sobol"]
        return {
            **said,
            "perception": {
                "axes": {k: list(v) for k, v in self.grid.items()},
                "base": asdict(self.base),
                "depth range": self.depth_range,
            },
        }
