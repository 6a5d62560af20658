"""What setting up a million trials of the capture map takes the host, by phase: a table of `benchmarks.study`."""

from __future__ import annotations

import contextlib
import functools
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.report import Table
from otwarp.simulation.simulation import Simulation
from otwarp.studies import Study, runner
from otwarp.studies.engines.local import keep, tasks
from otwarp.studies.engines.run import prepare

ROUNDS = 5
"""Repeats of this table for one of other figures: neighbours on the machine make a call longer, never shorter."""

WARP = sys.modules[wp.copy.__module__]
PHASES: dict[str, list[tuple[Any, str]]] = {
    "a model that says what does not vary": [(runner, "origin_of")],
    "parameters and starts as arrays": [(runner, "parameter_rows"), (runner, "start_rows")],
    "the simulation": [(Simulation, "__init__")],
    "its worlds started": [(Simulation, "reset")],
    "what became of each, read": [(runner.Runner, "_outcomes")],
    "one step of all, not counted": [(Simulation, "step")],
    "Warp's launches, copies, fills, and memory given back": [
        *((WARP, name) for name in ("invoke", "copy")),
        *((wp.array, name) for name in ("zero_", "fill_", "__del__")),
    ],
}
"""By phase the functions, and whose they are, whose time is counted for it, without what they call of other phases."""

REST = "trials numbered, results put in place"
HOST = "**the host's part**"
ALL = "**both**"
STEP, LAST = tuple(PHASES)[-2:]
"""What is not counted; what a GPU does by itself: on a CPU it takes the host's time, and more than there."""
WRITTEN = "chunks written, beside GPUs by a second thread"


class Clock:
    """Processor time of a thread by phase [s]: a function's own is that without those that it calls of `PHASES`, but
    for those of a step.
    """

    def __init__(self) -> None:
        self.found: dict[str, float] = defaultdict(float)
        self.inner = [0.0]
        self.stepping = False

    def counted(self, phase: str, function: Any) -> Any:
        """The function, counted."""

        @functools.wraps(function)
        def call(*given: Any, **named: Any) -> Any:
            """The same, timed."""
            if self.stepping:
                return function(*given, **named)
            self.stepping = phase == STEP
            self.inner.append(0.0)
            begun = time.thread_time()
            try:
                return function(*given, **named)
            finally:
                self.stepping = False
                taken = time.thread_time() - begun
                self.found[phase] += taken - self.inner.pop()
                self.inner[-1] += taken

        return call

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """All functions of `PHASES` counted, and what else there is as `REST`."""
        with contextlib.ExitStack() as back:
            for phase, functions in PHASES.items():
                for owner, name in functions:
                    function = getattr(owner, name)
                    back.callback(setattr, owner, name, function)
                    setattr(owner, name, self.counted(phase, function))
                    if getattr(wp, name, None) is function:  # offered under two names
                        back.callback(setattr, wp, name, function)
                        setattr(wp, name, getattr(owner, name))
            begun = time.thread_time()
            yield
            self.found[REST] += time.thread_time() - begun - self.inner[0]


def setup_table(study: Study, device: wp.Device, rounds: int) -> Table:
    """Phases of a task such as a GPU gets, of a study whose horizon is one step; and its store, written.

    Args:
        study: The capture map over one step.
        device: Where; the time is the host's.
        rounds: A fifth of the repeats.
    """
    if study.runner.steps != 1:
        raise ValueError(f"the study has {study.runner.steps} steps, not one")
    numbers = tasks(study, range(len(study.blocks())), gpu=True)[0]
    compute = partial(study.compute, numbers, device=str(device), threads=1)
    blocks = compute()  # compiles
    samples: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        store = prepare(study, Path(folder) / "out")
        for _ in range(ROUNDS * rounds):
            clock = Clock()
            with clock.running():
                compute()
            begun = time.process_time()
            keep(study, store, numbers, blocks)
            clock.found[WRITTEN] = time.process_time() - begun
            clock.found[HOST] = sum(clock.found[p] for p in (*PHASES, REST) if p not in (STEP, LAST))
            clock.found[ALL] = clock.found[HOST] + clock.found[LAST]
            for phase, seconds in clock.found.items():
                samples.setdefault(phase, []).append(1e3 * seconds)
    trials = sum(int(np.sum(block["trials"])) for block in blocks)
    order = [*(p for p in PHASES if p not in (STEP, LAST)), REST, HOST, LAST, ALL, STEP, WRITTEN]
    return Table(
        title=f"Set-up of {trials:,} trials of the capture map",
        head=("phase", "processor time, least [ms]"),
        rows=[(phase, f"{min(samples[phase]):.3g}") for phase in order],
        note=f"By one thread, {ROUNDS * rounds} times; trials of one step. {len(numbers)} chunks.",
    )
