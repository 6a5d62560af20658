"""Blocks of a study computed side by side: trials in rounds, until every point has what the rule gives it."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.scene import Scene
from otwarp.simulation.ends import End
from otwarp.studies.any_study import AnyStudy, Read
from otwarp.studies.engines.memory import LARGEST, worlds_at_once
from otwarp.studies.observables import Observable, same_end
from otwarp.studies.runner import Outcomes

BESIDE = 4_096
"""Points that say what is chosen for all worlds of a group alike, at most; beyond, some of them and the extremes."""


def start_blocks(
    study: AnyStudy,
    numbers: Sequence[int],
    *,
    device: str,
    threads: int | None,
    worlds: int | None,
    unwanted: threading.Event | None,
) -> Read:
    """Give a device the trials of blocks; see `Study.start`."""
    all_points = np.arange(study.design.points).reshape(study.design.shape)
    where = study.blocks()
    own = [all_points[where[n]] for n in numbers]
    points = np.concatenate([p.ravel() for p in own])
    at_once = worlds or worlds_at_once(study, device)
    trials = _Trials(study, points, _Place(device, threads, at_once, at_once >= LARGEST, unwanted))
    if study.round is not None:
        before, after = (part[points] for part in study.round)
        trials.take(before, after)
    else:
        row = study.design.shape[-1] if study.design.shape else 1
        while np.any(trials.done < study.stop.at_most):
            trials.settle()
            wanted = study.stop.wanted(successes(study, trials.code, trials.time, trials.done), trials.done, row)
            if np.all(wanted <= trials.done):
                break
            trials.take(trials.done, wanted)

    def read() -> list[dict[str, np.ndarray]]:
        """Wait for the last of them."""
        cuts = np.cumsum([p.size for p in own])[:-1]
        parts = {name: np.split(values, cuts) for name, values in trials.arrays().items()}
        return [
            {name: part[n].reshape((*p.shape, *part[n].shape[1:])) for name, part in parts.items()}
            for n, p in enumerate(own)
        ]

    return read


@dataclass(frozen=True)
class _Place:
    """Where trials run: a device, its threads on a CPU, how many at once, whether others may start beside them, and
    what is set when they are not wanted any more."""

    device: str
    threads: int | None
    worlds: int
    ahead: bool
    unwanted: threading.Event | None


class _Trials:
    """Trials of some points, as far as they were taken."""

    def __init__(self, study: AnyStudy, points: np.ndarray, place: _Place):
        most = study.stop.at_most if study.round is None else int(study.round[1][points].max(initial=1))
        self.study, self.points, self.place = study, points, place
        self._awaited: Callable[[], None] | None = None
        self.done = np.zeros(len(points), dtype=np.int64)
        self.code = np.full((len(points), most), -128, dtype=np.int8)
        self.time = np.full((len(points), most), np.nan, dtype=np.float32)
        self.kept = np.full((len(points), most, len(study.runner.numbers)), np.nan, dtype=np.float32)

    def take(self, before: np.ndarray, after: np.ndarray) -> None:
        """Run the trials of each point from `before` up to but not including `after`."""
        more = np.maximum(after - before, 0)
        ends, most = np.cumsum(more), self.code.shape[1]
        columns = (
            self.code.reshape(-1),
            self.time.reshape(-1),
            self.kept.reshape(self.code.size, -1 if self.kept.size else 0),
        )
        for start in range(0, int(more.sum()), self.place.worlds):
            stop = start + self.place.worlds
            counts = np.clip(ends, start, stop) - np.clip(ends - more, start, stop)
            (own,) = np.nonzero(counts)
            first = (before + np.clip(start - (ends - more), 0, None))[own]
            runs = _Runs(self.points[own], first, counts[own])
            at = _numbered(own * most + first, runs.counts)
            read = _start(self.study, runs, self.place)
            self.settle()
            self._awaited = functools.partial(_put, columns, at, read)
            if not self.place.ahead:
                self.settle()
        self.done = np.maximum(before, after)

    def settle(self) -> None:
        """Wait for the trials that a device was given last."""
        if self._awaited is not None:
            self._awaited()
        self._awaited = None

    def arrays(self) -> dict[str, np.ndarray]:
        """By the names of the store."""
        self.settle()
        found = {"trials": self.done.astype(np.int32), "end": self.code, "end_time": self.time}
        return found | {f"{o.name}_of_trial": self.kept[..., n] for n, o in enumerate(self.study.runner.numbers)}


@dataclass(frozen=True, eq=False)
class _Runs:
    """Trials of points: of each so many, one after the other.

    Attributes:
        points: (k) numbers.
        first: (k) number of the first trial of each, counted in its point.
        counts: (k) how many.
    """

    points: np.ndarray
    first: np.ndarray
    counts: np.ndarray

    def __getitem__(self, which: np.ndarray) -> _Runs:
        return _Runs(self.points[which], self.first[which], self.counts[which])


def _numbered(first: np.ndarray, counts: np.ndarray) -> np.ndarray | slice:
    """(n) numbers of runs that each go on from their `first`; a slice where they are one run."""
    n = int(counts.sum())
    if np.array_equal(first[1:], first[:-1] + counts[:-1]):
        return slice(int(first[0]), int(first[0]) + n)
    return np.repeat(first - (np.cumsum(counts) - counts), counts) + np.arange(n)


def _put(columns: Sequence[np.ndarray], at: Any, read: Callable[[], Outcomes]) -> None:
    """Wait for outcomes, and put them in their places."""
    out = read()
    for column, found in zip(columns, (out.code, out.time, out.numbers), strict=True):
        column[at] = found


def _start(study: AnyStudy, runs: _Runs, place: _Place) -> Callable[[], Outcomes]:
    """Give a device trials of points, group by group, and in a group step by step; what waits for the last of them."""
    n = int(runs.counts.sum())
    found = Outcomes(
        code=np.empty(n, np.int8), time=np.empty(n), numbers=np.empty((n, len(study.runner.numbers)), np.float32)
    )
    columns = found.code, found.time, found.numbers
    awaited: list[Callable[[], None]] = []
    for group, values in study.design.groups(runs.points):
        scene = study.design.scene_of(values)
        for steps in np.unique(study.step_counts[group]):
            chosen = np.isin(runs.points, group[study.step_counts[group] == steps])
            read = _start_alike(study, scene, runs[chosen], int(steps), place)
            if np.all(chosen):
                return read
            awaited.append(functools.partial(_put, columns, np.repeat(chosen, runs.counts), read))
            while len(awaited) > int(place.ahead):
                awaited.pop(0)()

    def last() -> Outcomes:
        """Wait for it."""
        for wait in awaited:
            wait()
        return found

    return last


def _start_alike(study: AnyStudy, scene: Scene, runs: _Runs, steps: int, place: _Place) -> Callable[[], Outcomes]:
    """Give a device trials of points that share a model and a step."""
    design, points = study.design, runs.points
    which = np.repeat(np.arange(len(points), dtype=np.int32), runs.counts)
    # modulo 2³², which no number of a trial reaches
    first = study.stop.streams(points, design.shape) * study.stop.at_most + runs.first
    trials = np.repeat((first - (np.cumsum(runs.counts) - runs.counts)).astype(np.uint32), runs.counts)
    trials += np.arange(len(trials), dtype=np.uint32)
    at, beside = (
        {t: v for t, v in design.at(some).items() if not t.grouped} for some in (points, spread(study, int(points[0])))
    )
    how = {"which": which, "beside": beside, "device": place.device, "threads": place.threads}
    return study.runner.in_steps(steps).start(scene, at, trials, unwanted=place.unwanted, **how)


def spread(study: AnyStudy, point: int) -> np.ndarray:
    """Points that stand for all that share a model and a step with one: all, or the extremes and some between them."""
    whole = study.design.group_of(point)
    whole = whole[study.step_counts[whole] == study.step_counts[point]]
    return study.design.some(whole, BESIDE)


def successes(study: AnyStudy, code: np.ndarray, time: np.ndarray, done: np.ndarray) -> np.ndarray:
    """(k, n) how often the event of each probability was seen that the rule looks at."""
    looked = [o for o in study.observables if o.kind == "probability" and study.stop.looks_at(o.name)]
    if not done.any():
        return np.zeros((len(looked), len(done)), dtype=np.int64)
    ran = np.arange(code.shape[-1]) < done[..., None]
    rows = [np.sum(happened(o, code, time, study.ends) & ran, axis=-1) for o in looked]
    return np.array(rows).reshape(len(rows), len(done))


def happened(o: Observable, code: np.ndarray, time: np.ndarray, ends: Sequence[End]) -> np.ndarray:
    """Whether trials count for a probability; a trial with a fault counts for none."""
    assert o.end is not None
    number = 1 + next(n for n, end in enumerate(ends) if same_end(o.end, end))
    came = (code == number) & (time <= (np.inf if o.until is None else o.until))
    return came if o.happens else ~came & (code >= 0)
