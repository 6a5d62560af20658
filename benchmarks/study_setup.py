"""What setting up a million trials of the capture map takes the host, by phase: a table of `benchmarks.study`."""

from __future__ import annotations

import cProfile
import pstats
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import warp as wp

from otwarp.bench.report import Table
from otwarp.studies import Study
from otwarp.studies.engines.local import keep, tasks
from otwarp.studies.engines.run import prepare

FILES = {"Simulation": "simulation/simulation.py", "Runner": "studies/runner.py", "": "studies/runner.py"}
"""By class where it stands, as a profile knows functions by file and name."""

PHASES = {
    "a model that says what does not vary": ("origin_of",),
    "parameters and starts as arrays": ("parameter_rows", "start_rows"),
    "the simulation": ("Simulation.__init__",),
    "its worlds started": ("Simulation.reset",),
    "what became of each, read": ("Runner._outcomes",),
}
"""By phase the functions that are timed for it; none of them calls another."""

STEP = "Simulation.step"
NUMBERED = "trials numbered, results put in place"
TOGETHER = "**all of these**"
DEVICE = ("invoke", "copy", "zero_", "fill_")
"""Functions of Warp that do nothing but launch, copy and fill: what a GPU does by itself, or the bus."""
HOST = "**without Warp's launches, copies and fills**"
ROUNDS = 5
"""Repeats of a table for one of other figures: neighbours on the machine make a call longer, never shorter."""
WRITTEN = "chunks written, beside GPUs by a second thread"


def profiled(work: Callable[[], object]) -> dict[str, float]:
    """By phase what a call takes by the wall [s], one step of all trials left out."""
    profile = cProfile.Profile()
    begun = time.perf_counter()
    profile.runcall(work)
    taken = time.perf_counter() - begun
    rows = pstats.Stats(profile).stats  # type: ignore[attr-defined]

    def cumulative(file: str, name: str) -> float:
        """Time in functions of a file and all that they call [s]."""
        return sum(row[3] for (where, _, called), row in rows.items() if called == name and file in where)

    def of_package(function: str) -> float:
        """The same of `Class.function` or `function`."""
        of, _, name = function.rpartition(".")
        return cumulative(FILES[of], name)

    found = {phase: sum(map(of_package, names)) for phase, names in PHASES.items()}
    together = taken - of_package(STEP)
    device = sum(cumulative("warp/_src", name) for name in DEVICE)
    return {**found, NUMBERED: together - sum(found.values()), TOGETHER: together, HOST: taken - device}


def setup_table(study: Study, device: wp.Device, rounds: int) -> Table:
    """Phases of a task such as a GPU gets, of a study whose horizon is one step; and its store, written.

    Args:
        study: The capture map over one step.
        device: Where; the time is the host's, which waits for it at a few places.
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
            found = profiled(compute)
            begun = time.perf_counter()
            keep(study, store, numbers, blocks)
            for phase, seconds in {**found, WRITTEN: time.perf_counter() - begun}.items():
                samples.setdefault(phase, []).append(1e3 * seconds)
    trials = sum(int(np.sum(block["trials"])) for block in blocks)
    return Table(
        title=f"Set-up of {trials:,} trials of the capture map",
        head=("phase", "least wall time [ms]"),
        rows=[(phase, f"{min(seconds):.3g}") for phase, seconds in samples.items()],
        note=f"By one thread under a profiler, {ROUNDS * rounds} times; steps are left out. {len(numbers)} chunks.",
    )
