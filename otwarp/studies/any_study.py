"""What those who plan, compute and keep a study need of it, whichever kind it is."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from otwarp.simulation.ends import End
from otwarp.simulation.options import StepOptions
from otwarp.studies.axes import Scatter
from otwarp.studies.design import Design
from otwarp.studies.observables import Observable
from otwarp.studies.runner import Runner
from otwarp.studies.stopping.rules import Stop
from otwarp.studies.store import Variable
from otwarp.studies.targets import Target

Read = Callable[[], list[dict[str, np.ndarray]]]
"""What waits for blocks that a device was given, and reads of each its arrays by the names of the store."""


class AnyStudy(Protocol):
    """A study: `Study`, or `EscapeStudy`.

    Attributes:
        design: Its points.
        observables: What is asked of a trial.
        stop: How many trials a point gets.
        seed: Key of all trials.
        options: What is chosen about the step.
        scatter: What varies from trial to trial.
        horizon: How long a trial goes on at most [s].
        round: (points) trials before and after what is to be computed, in a round of spending a budget, or None.
        text: Of the file that described it, or None.
        side_by_side: Whether a device computes several blocks in the time of one.
    """

    design: Design
    observables: tuple[Observable, ...]
    stop: Stop
    seed: int
    options: StepOptions
    scatter: tuple[tuple[Target, Scatter], ...]
    horizon: float
    round: tuple[np.ndarray, np.ndarray] | None
    text: str | None
    side_by_side: bool

    @property
    def ends(self) -> tuple[End, ...]:
        """What may end a trial, each once."""
        ...

    @property
    def runner(self) -> Runner:
        """How trials run; its time step is that of the point that needs the smallest."""
        ...

    @property
    def step_counts(self) -> np.ndarray:
        """(points) steps of each point over the horizon."""
        ...

    @property
    def points_of_a_block(self) -> int:
        """Points of the first block, which has as many as any."""
        ...

    def plan(self) -> Any:
        """What running it means; nothing is simulated."""
        ...

    def blocks(self) -> list[tuple[slice, ...]]:
        """Blocks of points, each kept as a whole."""
        ...

    def in_blocks(self, cut: tuple[int, ...]) -> AnyStudy:
        """This study in blocks of so many points along each dimension; results do not depend on it."""
        ...

    def between(self, before: np.ndarray, after: np.ndarray) -> AnyStudy:
        """This study, of which the trials of one round are to be computed: (points) before it, and after."""
        ...

    def asked(self) -> Mapping[str, Any]:
        """What the store says of the study: equal for equal studies, and only for them."""
        ...

    def variables(self, dims: tuple[str, ...]) -> tuple[dict[str, Variable], dict[str, int]]:
        """Arrays of results, and the lengths of their dimensions beside those of the axes, `dims`."""
        ...

    def compute(
        self, numbers: Sequence[int], *, device: str, threads: int | None = None, worlds: int | None = None
    ) -> list[dict[str, np.ndarray]]:
        """Compute the blocks of these numbers: of each its arrays by the names of the store."""
        ...

    def start(
        self,
        numbers: Sequence[int],
        *,
        device: str,
        threads: int | None = None,
        worlds: int | None = None,
        unwanted: threading.Event | None = None,
    ) -> Read:
        """Give a device these blocks; what waits for them, and reads them as `compute` does.

        Raises:
            CancelledError: `unwanted` was set meanwhile.
        """
        ...
