"""Who computes the blocks of a study: this process on all its devices, or a share of them in one of several."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.design import box_of
from otwarp.studies.engines.memory import has_plenty
from otwarp.studies.store import Store
from otwarp.studies.turns import Turns

Progress = Callable[[int, int], None]
"""(blocks done, blocks in all), called when one is."""

Engine = Callable[[AnyStudy, Store, Sequence[int], Progress], None]
"""Computes blocks by their numbers, and keeps each in the store as soon as it is whole."""


@runtime_checkable
class Connecting(Protocol):
    """An engine that takes long to reach: who calls it several times keeps it reached."""

    def connected(self) -> AbstractContextManager[Any]:
        """Reached, until the context ends."""
        ...


def parse_shard(text: str) -> tuple[int, int]:
    """`3/16`: the third of sixteen, counted from 1.

    Raises:
        InputError: No such shard.
    """
    try:
        which, of = (int(part) for part in text.split("/"))
    except ValueError:
        which, of = 0, 0
    if not 1 <= which <= of:
        raise InputError(f"--shard is {text}; allowed: which one of how many, such as 3/16")
    return which, of


def blocks_of(study: AnyStudy, store: Store, shard: tuple[int, int] | None) -> list[int]:
    """The blocks of a shard, or all, that are not done."""
    count = len(study.blocks())
    mine = range(count) if shard is None else range(shard[0] - 1, count, shard[1])
    done = set(store.finished())
    return [n for n in mine if n not in done]


TOGETHER = 2**20
"""Trials that a GPU has at once, at most."""
FEWEST = 2**16
"""Of long trials as many as fill it."""
WORLD_STEPS = 2**36
"""Steps of all trials of a task that is no smaller than that: what is lost, at most, when something ends it."""


ROUND = 2**14
"""Trials of a round that a CPU computes together, at most."""


def tasks(study: AnyStudy, todo: Sequence[int], *, gpu: bool, workers: int = 1, at_once: int = 1) -> list[list[int]]:
    """Blocks in groups that fill a device without leaving other workers idle, if need be some `at_once`.

    On a CPU each is one, but in rounds of spending a budget, where a block may have few new trials.
    """
    most = min(TOGETHER // at_once, max(FEWEST, WORLD_STEPS // study.runner.steps)) if gpu else ROUND
    size = -(-len(todo) // max(workers, 1)) if gpu or study.round is not None else 1
    found: list[list[int]] = []
    full = 0
    for n, new in zip(todo, _new_trials(study, todo), strict=True):
        if not found or len(found[-1]) >= size or full + new > most:
            found.append([])
            full = 0
        found[-1].append(n)
        full += new
    return found


def tasks_at_once(study: AnyStudy, device: str) -> int:
    """Tasks that a device has at once: on a GPU one may take its steps while the host sets up another, or reads it."""
    return 2 if device.startswith("cuda") and study.overlapping and has_plenty(study, device, 2) else 1


def trials_at_once(study: AnyStudy, device: str) -> int:
    """Trials of the tasks that a device has at once, at most."""
    at_once = tasks_at_once(study, device)
    found = tasks(study, range(len(study.blocks())), gpu=device.startswith("cuda"), at_once=at_once)
    blocks = min(at_once, len(found)) * max(len(task) for task in found)
    return blocks * study.stop.at_most * study.points_of_a_block


def _new_trials(study: AnyStudy, todo: Sequence[int]) -> list[int]:
    """Trials of blocks that are to be computed, at most."""
    if study.round is None:
        return [study.stop.at_most * study.points_of_a_block] * len(todo)
    before, after = study.round
    more, blocks = np.maximum(after - before, 0).reshape(study.design.shape), study.blocks()
    return [int(more[blocks[n]].sum()) for n in todo]


Found = dict[str, np.ndarray]
"""Arrays of a block, by their names in the store."""


def compute_and_keep(
    study: AnyStudy, store: Store, numbers: Sequence[int], device: str, threads: int | None = None
) -> None:
    """Compute blocks, and write each of them."""
    keep(study, store, numbers, study.compute(numbers, device=device, threads=threads))


def keep(study: AnyStudy, store: Store, numbers: Sequence[int], found: Sequence[Found]) -> None:
    """Write computed blocks into the store; of a study with a budget, the new trials of each."""
    where = study.blocks()
    if study.round is None:
        box = box_of([where[n] for n in numbers])
        if box is not None:  # a call costs a chunk's time, however many chunks it writes
            store.write(numbers, box, _joined(found, [where[n] for n in numbers], box))
            return
    for number, arrays in zip(numbers, found, strict=True):
        if study.round is None:
            store.write([number], where[number], arrays)
        else:
            before = study.round[0].reshape(study.design.shape)[where[number]]
            store.add(where[number], arrays, before)


def _joined(found: Sequence[Found], places: Sequence[tuple[slice, ...]], box: tuple[slice, ...]) -> Found:
    """Arrays of blocks as those of the box that they fill."""
    shape, dims = tuple(s.stop - s.start for s in box), len(box)
    out = {name: np.empty((*shape, *of.shape[dims:]), of.dtype) for name, of in found[0].items()}
    for arrays, place in zip(found, places, strict=True):
        at = tuple(slice(s.start - b.start, s.stop - b.start) for s, b in zip(place, box, strict=True))
        for name, values in arrays.items():
            out[name][at] = values
    return out


def on_this_host(devices: Sequence[str], begin: Callable[[], object] | None = None) -> Engine:
    """The engine of this process: every device computes blocks in a thread of its own, a GPU perhaps in two.

    Args:
        devices: Which.
        begin: Makes the store, before anything is kept; GPUs take their first steps meanwhile.
    """

    def run(study: AnyStudy, store: Store, todo: Sequence[int], progress: Progress) -> None:
        """Compute blocks; a block is kept as soon as it is whole."""
        at_once = tasks_at_once(study, devices[0])
        waiting = tasks(study, todo, gpu=devices[0].startswith("cuda"), workers=len(devices), at_once=at_once)
        count = len(study.blocks())
        done = len(store.finished())
        alone = len(devices) == 1 and devices[0] == "cpu"  # interrupts are answered where they arrive
        lanes = [(device, Turns()) for device in devices] * at_once
        if alone:
            compute = _one_by_one(study, store, waiting, begin)
        else:
            compute = side_by_side(study, store, waiting, lanes, begin)
        for numbers in compute:
            done += len(numbers)
            progress(done, count)

    return run


def _one_by_one(
    study: AnyStudy, store: Store, waiting: Sequence[list[int]], begin: Callable[[], object] | None
) -> Iterator[list[int]]:
    if begin is not None:
        begin()
        yield []
    for numbers in waiting:
        compute_and_keep(study, store, numbers, "cpu")
        yield numbers


Lane = tuple[str, Turns]
"""Where a task is computed: a device, and with whom it shares that."""


def side_by_side(
    study: AnyStudy,
    store: Store,
    given: Sequence[list[int]],
    lanes: Sequence[Lane],
    begin: Callable[[], object] | None = None,
) -> Iterator[list[int]]:
    """A thread per lane computes, one more writes: disks do not keep devices waiting.

    Args:
        study: What is computed.
        store: Gets the blocks.
        given: Tasks, each the numbers of its blocks.
        lanes: Who computes them.
        begin: Called before anything is written, in a turn of those who are set up.

    Yields:
        The tasks whose blocks are kept, and one of none when `begin` is over.
    """

    waiting, free = iter(given), list(reversed(lanes))
    computing: dict[Future[Any], tuple[Lane, list[int]]] = {}
    writing: dict[Future[Any], list[int]] = {}

    def begun(begin: Callable[[], object]) -> None:
        """Not beside a set-up: both are work of Python's, which threads do in turn anyway."""
        with lanes[0][1].setup():
            begin()

    with contextlib.ExitStack() as end:
        # Warp makes a device the default one while it copies from there to the host
        end.enter_context(wp.ScopedDevice(wp.get_device()))
        pool, writer = (end.enter_context(ThreadPoolExecutor(n)) for n in (len(lanes), 1))
        for _, turns in lanes:
            end.callback(turns.end)  # before the threads are waited for

        def give_out() -> None:
            for numbers in itertools.islice(waiting, len(free)):
                device, turns = lane = free.pop()
                computing[pool.submit(study.compute, numbers, device=device, turns=turns)] = lane, numbers

        give_out()
        if begin is not None:
            writing[writer.submit(begun, begin)] = []
        while computing or writing:
            # what is computed waits for the writer in memory: not more than a task per lane
            pending = {*computing, *writing} if len(writing) <= len(lanes) else {*writing}
            for task in wait(pending, return_when=FIRST_COMPLETED).done:
                if task in computing:
                    lane, numbers = computing.pop(task)
                    free.append(lane)
                    writing[writer.submit(keep, study, store, numbers, task.result())] = numbers
                else:
                    task.result()
                    yield writing.pop(task)
            give_out()
