"""Who computes the blocks of a study: this process on all its devices, or a share of them in one of several."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

from otwarp.errors import InputError
from otwarp.studies.store import Store
from otwarp.studies.study import Study

Progress = Callable[[int, int], None]
"""(blocks done, blocks in all), called when one is."""


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


def blocks_of(study: Study, store: Store, shard: tuple[int, int] | None) -> list[int]:
    """The blocks of a shard, or all, that are not done."""
    count = len(study.blocks())
    mine = range(count) if shard is None else range(shard[0] - 1, count, shard[1])
    return [n for n in mine if not store.done(n)]


TOGETHER = {True: 2**20, False: 1}
"""Trials that are computed together on a GPU, or a CPU: at least those of one block."""


def tasks(study: Study, todo: Sequence[int], *, gpu: bool) -> list[list[int]]:
    """Blocks in groups that fill a device."""
    size = max(1, TOGETHER[gpu] // (study.stop.at_most * study.points_of_a_block))
    return [list(todo[n : n + size]) for n in range(0, len(todo), size)]


def compute_and_keep(study: Study, store: Store, numbers: Sequence[int], device: str) -> None:
    """Compute blocks, and write each of them."""
    where = study.blocks()
    for number, arrays in zip(numbers, study.compute(numbers, device=device), strict=True):
        store.write(number, where[number], arrays)


def run_locally(study: Study, store: Store, todo: Sequence[int], devices: list[str], progress: Progress) -> None:
    """Compute blocks on the devices of this host; a block is kept as soon as it is whole."""
    waiting = iter(tasks(study, todo, gpu=devices[0].startswith("cuda")))
    count = len(study.blocks())
    if len(devices) == 1:  # interrupts are answered where they arrive
        for numbers in waiting:
            compute_and_keep(study, store, numbers, devices[0])
            progress(len(store.finished()), count)
        return

    def work(device: str, numbers: list[int]) -> str:
        compute_and_keep(study, store, numbers, device)
        return device

    with ThreadPoolExecutor(len(devices)) as pool:
        running = {
            pool.submit(work, d, n) for d, n in zip(devices, itertools.islice(waiting, len(devices)), strict=False)
        }
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for task in done:
                device = task.result()
                progress(len(store.finished()), count)
                numbers = next(waiting, None)
                if numbers is not None:
                    running.add(pool.submit(work, device, numbers))
