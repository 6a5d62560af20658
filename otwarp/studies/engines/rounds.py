"""A budget of trials, spent in rounds: each on what the results of all points after the last one ask for.

What a round computes follows from the results before it alone, and stands nowhere else: a driver that goes on finds out
from the store how far its predecessor came. A block is written whole in each round, `trials` last: whoever finds these
finds what they count.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np

from otwarp.studies.any_study import AnyStudy
from otwarp.studies.compute import successes
from otwarp.studies.engines.local import Connecting, Engine, Progress
from otwarp.studies.store import Store


def spend(study: AnyStudy, store: Store, engine: Engine, progress: Progress) -> None:
    """Compute rounds until the budget is spent or no point wants more, and mark all blocks as done.

    Args:
        study: With a budget.
        store: Its own, whose results say how far it is.
        engine: Who computes a round.
        progress: Called with the trials taken and the budget.
    """
    with _reached(engine):
        spent = _rounds(study, store, engine, progress)
    for number in range(len(study.blocks())):
        store.mark(number)
    progress(spent, spent)  # all that there will be: what is left was wanted by nobody


def _reached(engine: Engine) -> contextlib.AbstractContextManager[Any]:
    """The engine, for all rounds."""
    return engine.connected() if isinstance(engine, Connecting) else contextlib.nullcontext()


def _rounds(study: AnyStudy, store: Store, engine: Engine, progress: Progress) -> int:
    """All rounds; trials that they took together."""
    shape, blocks = study.design.shape, study.blocks()
    places = np.arange(study.design.points).reshape(shape)
    before = np.zeros(study.design.points, dtype=np.int64)
    seen = np.zeros((0, 0))
    budget = study.stop.budget or 0
    while True:
        after = study.stop.shares(seen, before)
        if np.all(after <= before):
            break
        behind = store.trials().reshape(-1) < after
        todo = [n for n, where in enumerate(blocks) if np.any(behind[places[where]])]
        if todo:
            engine(study.between(before, after), store, todo, _scaled(progress, before, after, len(todo), budget))
        grown = [n for n, where in enumerate(blocks) if np.any((after > before)[places[where]])]
        seen = _counted(study, store, grown, after, seen)
        before = after
    return int(before.sum())


def _scaled(
    progress: Progress, before: np.ndarray, after: np.ndarray, blocks: int, budget: int
) -> Callable[[int, int], None]:
    """Trials taken, from the blocks of a round that are done."""
    first, more = int(before.sum()), int(after.sum() - before.sum())
    return lambda done, _: progress(first + more * min(done, blocks) // blocks, budget)


def _counted(study: AnyStudy, store: Store, blocks: list[int], trials: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(k, points) how often each probability was seen that is looked at, anew in these blocks."""
    where = study.blocks()
    places = np.arange(study.design.points).reshape(study.design.shape)
    for number in blocks:
        points = places[where[number]].ravel()
        end, time = (store.block(name, where[number]).reshape(len(points), -1) for name in ("end", "end_time"))
        found = successes(study, end, time, trials[points])
        if not seen.size:
            seen = np.zeros((len(found), study.design.points), dtype=np.int64)
        seen[:, points] = found
    return seen
