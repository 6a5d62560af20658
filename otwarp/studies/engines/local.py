"""Who computes the blocks of a study: this process on all its devices, or a share of them in one of several."""

from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.studies.any_study import AnyStudy, Read
from otwarp.studies.design import box_of
from otwarp.studies.store import Store

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
"""Trials that a GPU computes together, at most."""
FEWEST = 2**16
"""Of long trials as many as fill it."""
WORLD_STEPS = 2**36
"""Steps of all trials of a task that is no smaller than that: what is lost, at most, when something ends it."""


ROUND = 2**14
"""Trials of a round that a CPU computes together, at most."""


def tasks(study: AnyStudy, todo: Sequence[int], *, gpu: bool, workers: int = 1) -> list[list[int]]:
    """Blocks in groups that fill a device without leaving other workers idle.

    On a CPU each is one, but in rounds of spending a budget, where a block may have few new trials; and on all devices
    where blocks are not computed side by side, so that each is kept as soon as it is known.
    """
    most = min(TOGETHER, max(FEWEST, WORLD_STEPS // study.runner.steps)) if gpu else ROUND
    several = study.side_by_side and (gpu or study.round is not None)
    size = -(-len(todo) // max(workers, 1)) if several else 1
    found: list[list[int]] = []
    full = 0
    for n, new in zip(todo, _new_trials(study, todo), strict=True):
        if not found or len(found[-1]) >= size or full + new > most:
            found.append([])
            full = 0
        found[-1].append(n)
        full += new
    return found


def batch_of(study: AnyStudy, *, gpu: bool) -> int:
    """Trials of the largest task, at most."""
    every = range(len(study.blocks()))
    return max(len(task) for task in tasks(study, every, gpu=gpu)) * study.stop.at_most * study.points_of_a_block


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


def _read_and_keep(study: AnyStudy, store: Store, numbers: Sequence[int], read: Read) -> None:
    """Wait for blocks that a device was given, and write them."""
    keep(study, store, numbers, read())


def _joined(found: Sequence[Found], places: Sequence[tuple[slice, ...]], box: tuple[slice, ...]) -> Found:
    """Arrays of blocks as those of the box that they fill."""
    shape, dims = tuple(s.stop - s.start for s in box), len(box)
    out = {name: np.empty((*shape, *of.shape[dims:]), of.dtype) for name, of in found[0].items()}
    for arrays, place in zip(found, places, strict=True):
        at = tuple(slice(s.start - b.start, s.stop - b.start) for s, b in zip(place, box, strict=True))
        for name, values in arrays.items():
            out[name][at] = values
    return out


def on_this_host(devices: Sequence[str]) -> Engine:
    """The engine of this process: every device computes blocks in a thread of its own."""

    def run(study: AnyStudy, store: Store, todo: Sequence[int], progress: Progress) -> None:
        """Compute blocks; a block is kept as soon as it is whole."""
        waiting = iter(tasks(study, todo, gpu=devices[0].startswith("cuda"), workers=len(devices)))
        count = len(study.blocks())
        done = len(store.finished())
        alone = len(devices) == 1 and devices[0] == "cpu"  # interrupts are answered where they arrive
        compute = _one_by_one(study, store, waiting) if alone else _side_by_side(study, store, waiting, devices)
        with contextlib.closing(compute):  # an interrupt may come in `progress`, and threads be at work
            for numbers in compute:
                done += len(numbers)
                progress(done, count)

    return run


def _one_by_one(study: AnyStudy, store: Store, waiting: Iterator[list[int]]) -> Generator[list[int], None, None]:
    for numbers in waiting:
        compute_and_keep(study, store, numbers, "cpu")
        yield numbers


@contextlib.contextmanager
def _set_at_the_end() -> Iterator[threading.Event]:
    """What says to other threads that this one has ended."""
    ended = threading.Event()
    try:
        yield ended
    finally:
        ended.set()


def _side_by_side(
    study: AnyStudy, store: Store, waiting: Iterator[list[int]], devices: Sequence[str]
) -> Generator[list[int], None, None]:
    """A thread per device starts tasks, one more waits for each and writes it.

    So disks do not keep devices waiting, and a GPU is given the next task while it is still at the end of the last.
    Whatever ends it, tasks that devices were given whole are kept, and the threads have gone.
    """
    free = list(devices)
    starting: dict[Future[Any], tuple[str, list[int]]] = {}
    writing: dict[Future[Any], list[int]] = {}
    # Warp makes a device the default one while it copies from there to the host
    with (
        wp.ScopedDevice(wp.get_device()),
        ThreadPoolExecutor(len(devices), "study-device") as pool,
        ThreadPoolExecutor(1, "study-writer") as writer,
        _set_at_the_end() as unwanted,
    ):
        while True:
            for numbers in itertools.islice(waiting, len(free)):
                device = free.pop()
                starting[pool.submit(study.start, numbers, device=device, unwanted=unwanted)] = device, numbers
            if not starting and not writing:
                return
            # what is started waits for the writer in memory: not more than a task per device
            pending = {*starting, *writing} if len(writing) <= len(devices) else {*writing}
            for task in wait(pending, return_when=FIRST_COMPLETED).done:
                if task in starting:
                    device, numbers = starting.pop(task)
                    free.append(device)
                    writing[writer.submit(_read_and_keep, study, store, numbers, task.result())] = numbers
                else:
                    task.result()
                    yield writing.pop(task)
