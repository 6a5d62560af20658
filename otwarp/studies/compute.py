"""Blocks of a study computed side by side: trials in rounds, until every point has what the rule gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.simulation.ends import End
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.engines.memory import worlds_at_once
from otwarp.studies.observables import Observable, same_end
from otwarp.studies.runner import Outcomes

BESIDE = 4_096
"""Points that say what is chosen for all worlds of a group alike, at most; beyond, some of them and the extremes."""


def compute_blocks(
    study: AnyStudy, numbers: Sequence[int], *, device: str, threads: int | None, worlds: int | None
) -> list[dict[str, np.ndarray]]:
    """Of each block its arrays by the names of the store; see `Study.compute`."""
    all_points = np.arange(study.design.points).reshape(study.design.shape)
    own = [all_points[where] for where in (study.blocks()[n] for n in numbers)]
    points = np.concatenate([p.ravel() for p in own])
    trials = _Trials(study, points, _Place(device, threads, worlds or worlds_at_once(study, device)))
    if study.round is not None:
        before, after = (part[points] for part in study.round)
        trials.take(before, after)
    else:
        row = study.design.shape[-1] if study.design.shape else 1
        while True:
            wanted = study.stop.wanted(successes(study, trials.code, trials.time, trials.done), trials.done, row)
            if np.all(wanted <= trials.done):
                break
            trials.take(trials.done, wanted)
    cuts = np.cumsum([p.size for p in own])[:-1]
    parts = {name: np.split(values, cuts) for name, values in trials.arrays().items()}
    return [
        {name: part[n].reshape((*p.shape, *part[n].shape[1:])) for name, part in parts.items()}
        for n, p in enumerate(own)
    ]


@dataclass(frozen=True)
class _Place:
    """Where trials run: a device, its threads on a CPU, and how many at once."""

    device: str
    threads: int | None
    worlds: int


class _Trials:
    """Trials of some points, as far as they were taken."""

    def __init__(self, study: AnyStudy, points: np.ndarray, place: _Place):
        most = study.stop.at_most if study.round is None else int(study.round[1][points].max(initial=1))
        self.study, self.points, self.place = study, points, place
        self.done = np.zeros(len(points), dtype=np.int64)
        self.code = np.full((len(points), most), -128, dtype=np.int8)
        self.time = np.full((len(points), most), np.nan, dtype=np.float32)
        self.kept = np.full((len(points), most, len(study.runner.numbers)), np.nan, dtype=np.float32)

    def take(self, before: np.ndarray, after: np.ndarray) -> None:
        """Run the trials of each point from `before` up to but not including `after`."""
        more = np.maximum(after - before, 0)
        which = np.repeat(np.arange(len(self.points)), more)
        nth = np.arange(len(which)) - np.repeat(np.cumsum(more) - more, more) + before[which]
        for start in range(0, len(which), self.place.worlds):
            part = slice(start, start + self.place.worlds)
            out = _run(self.study, self.points[which[part]], nth[part], self.place)
            at = which[part], nth[part]
            self.code[at], self.time[at], self.kept[at] = out.code, out.time, out.numbers
        self.done = np.maximum(before, after)

    def arrays(self) -> dict[str, np.ndarray]:
        """By the names of the store."""
        found = {"trials": self.done.astype(np.int32), "end": self.code, "end_time": self.time}
        return found | {f"{o.name}_of_trial": self.kept[..., n] for n, o in enumerate(self.study.runner.numbers)}


def _run(study: AnyStudy, points: np.ndarray, nth: np.ndarray, place: _Place) -> Outcomes:
    """Trials of points, group by group, and in a group step by step."""
    code, time = np.empty(len(points), np.int8), np.empty(len(points))
    numbers = np.empty((len(points), len(study.runner.numbers)), np.float32)
    chosen = np.zeros(study.design.points, dtype=bool)  # a million trials of few points are not sorted
    chosen[points] = True
    present = np.flatnonzero(chosen)
    chosen[:] = False
    for group, values in study.design.groups(present):
        scene = study.design.scene_of(values)
        for steps in np.unique(study.step_counts[group]):
            own = group[study.step_counts[group] == steps]
            chosen[own] = True
            mine = np.flatnonzero(chosen[points])
            chosen[own] = False
            at = {t: v for t, v in study.design.at(points[mine]).items() if not t.grouped}
            trial = study.stop.streams(points[mine], study.design.shape) * study.stop.at_most + nth[mine]
            runner = study.runner.in_steps(int(steps))
            beside = {t: v for t, v in study.design.at(spread(study, int(own[0]))).items() if not t.grouped}
            out = runner.run(scene, at, trial, beside=beside, device=place.device, threads=place.threads)
            code[mine], time[mine], numbers[mine] = out.code, out.time, out.numbers
    return Outcomes(code=code, time=time, numbers=numbers)


def spread(study: AnyStudy, point: int) -> np.ndarray:
    """Points that stand for all that share a model and a step with one: all, or the extremes and some between them."""
    whole = study.design.group_of(point)
    whole = whole[study.step_counts[whole] == study.step_counts[point]]
    return study.design.some(whole, BESIDE)


def successes(study: AnyStudy, code: np.ndarray, time: np.ndarray, done: np.ndarray) -> np.ndarray:
    """(k, n) how often the event of each probability was seen that the rule looks at."""
    ran = np.arange(code.shape[-1]) < done[..., None]
    looked = [o for o in study.observables if o.kind == "probability" and study.stop.looks_at(o.name)]
    rows = [np.sum(happened(o, code, time, study.ends) & ran, axis=-1) for o in looked]
    return np.array(rows).reshape(len(rows), len(done))


def happened(o: Observable, code: np.ndarray, time: np.ndarray, ends: Sequence[End]) -> np.ndarray:
    """Whether trials count for a probability; a trial with a fault counts for none."""
    assert o.end is not None
    number = 1 + next(n for n, end in enumerate(ends) if same_end(o.end, end))
    came = (code == number) & (time <= (np.inf if o.until is None else o.until))
    return came if o.happens else ~came & (code >= 0)
