"""Which trainings the tables of networks look at, and many of them at the same time."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from otwarp.vision.datasets import open_dataset
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import train

SPLITS = ("random", "focus_blocks")
SHARES = (0.25, 0.5, 1.0)

Trainings = dict[Path, Settings]
"""Settings of trainings by their folders."""


def of_split(work: Path, name: str, how: Mapping[str, Any], split: str, seeds: int) -> Trainings:
    """One network on one split, with several seeds."""
    return {work / f"{name}_{split}_{seed}": Settings(**how, split=split, seed=seed) for seed in range(seeds)}


def of_robots(work: Path, name: str, how: Mapping[str, Any], seeds: int) -> dict[str, Trainings]:
    """One network on the data set of many robots, by its splits."""
    return {split: of_split(work, f"{name}_robots", how, split, seeds) for split in ("random", "unseen_robots")}


def of_shares(place: Path, work: Path, name: str, how: Mapping[str, Any]) -> Trainings:
    """One network with parts of the images, for the same number of steps."""
    whole, found = len(open_dataset(place).split("random")["train"]), {}
    for share in SHARES:
        count = int(share * whole)
        settings = Settings(**{**how, "epochs": round(how["epochs"] / share)}, images=count if share < 1.0 else 0)
        found[work / (f"{name}_{count}" if share < 1.0 else f"{name}_random_0")] = settings
    return found


def of_losses(work: Path, runs: Mapping[str, Any]) -> Trainings:
    """The first network, with the right loss of the depth and with the published one."""
    how = {**next(iter(runs.values())), "heads": "paper", "augment": False}
    return {work / f"loss_{loss}": Settings(**how, depth_loss=loss) for loss in ("right", "broadcast")}


def all_trainings(place: Path, work: Path, runs: Mapping[str, Any], best: str, seeds: int) -> Trainings:
    """What the tables look at, the longest first; `best` is the network that is looked at closely."""
    found = of_losses(work, runs) | of_shares(place, work, best, runs[best])
    found |= of_split(work, best, runs[best], "unseen_tilts", seeds)
    for split in SPLITS:
        for name, how in runs.items():
            found |= of_split(work, name, how, split, seeds)
    order = ("vgg16", "resnet50", "resnet18", "small")
    return dict(sorted(found.items(), key=lambda row: (order.index(row[1].net), -row[1].epochs)))


def at_once(trainings: Mapping[Path, Trainings], devices: Sequence[str]) -> None:
    """Train on data sets in a process for each device that is named; what is there already is left."""
    context = multiprocessing.get_context("spawn")
    free = context.Queue()
    for device in devices:
        free.put(device)
    with ProcessPoolExecutor(len(devices), mp_context=context, initializer=take_device, initargs=(free,)) as pool:
        done = [pool.submit(train_one, place, folder, how)
                for place, some in trainings.items() for folder, how in some.items()]  # fmt: skip
        for n, one in enumerate(as_completed(done), 1):
            print(f"training {n} of {len(done)}: {one.result()}", file=sys.stderr, flush=True)


DEVICE = ["cpu"]
"""Where this process trains."""


def take_device(free: Any) -> None:
    """Of a process of `at_once`: the device on which all its trainings run."""
    DEVICE[0] = free.get()


def train_one(place: Path, folder: Path, how: Settings) -> str:
    """A training in a process of `at_once`."""
    found = train(place, folder, how, device=DEVICE[0])
    return f"{folder.name}, {found['training_seconds']:.0f} s on {DEVICE[0]}"
