"""How fast networks train: the shipped training beside a bare loop of torch, in turns."""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.torch_training import BareLoop
from otwarp.bench.report import NOTHING, Table
from otwarp.device import pick_device
from otwarp.vision.datasets import open_dataset
from otwarp.vision.networks.library import repeatable, threads_of, torch_device
from otwarp.vision.networks.prepare import prepare
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import one_epoch, steps_of

NETS = ("vgg16", "resnet18", "resnet50", "small")

ON_GPU: dict[str, Any] = {"size": 224, "batches": (32, 128), "steps": 40}
ON_CORE: dict[str, Any] = {"size": 64, "batches": (16,), "steps": 4}
"""Side of the images [pixels], images a step, steps a round."""


def training_speed(place: Path, device: str, rounds: int, data: dict[str, Any], *, nets: Sequence[str] = NETS) -> Table:
    """Images a second of both, medians of rounds in turns after one that is not counted.

    Args:
        place: A data set, of whatever size: its images are resized, and repeated until there are enough.
        device: cpu, where one thread works, or cuda:0.
        rounds: That count.
        data: Gets the numbers of every round.
        nets: Which.
    """
    on_gpu = not pick_device(device).is_cpu
    how, rows = ON_GPU if on_gpu else ON_CORE, []
    for net in nets:
        for batch in how["batches"]:
            settings = Settings(net=net, heads="paper", schedule="step", epochs=rounds + 1, batch=batch,
                                size=how["size"], augment=False)  # fmt: skip
            ours, bare = in_turns(place, settings, how["steps"], device)
            shares = ours / bare
            spread = f"{shares.min():.2f} to {shares.max():.2f}" if rounds > 1 else NOTHING
            speeds = (f"{np.median(ours):.3g}", f"{np.median(bare):.3g}")
            rows.append((net, str(batch), *speeds, f"{np.median(shares):.2f}", spread))
            data[f"training {net} {batch}"] = {"shipped": ours.tolist(), "bare": bare.tolist()}
    head = ("network", "batch", "shipped training", "bare loop", "shipped / bare", "in every round")
    kind = "bf16, one GPU" if on_gpu else "float32, one thread and its processor time"
    rest = f"medians of {rounds} rounds" if rounds > 1 else "one round"
    note = (
        f"{how['size']} × {how['size']} pixels, paper's heads, {kind}, channels last; the bare loop has the loss of "
        f"the tilts alone. In turns of {how['steps']} steps, {rest}."
    )
    return Table(title="Training [images/s]", head=head, rows=rows, note=note)


def in_turns(place: Path, settings: Settings, steps: int, device: str) -> tuple[np.ndarray, np.ndarray]:
    """Images a second of the shipped training and of the bare loop, one of each a round.

    Args:
        place: The data set.
        settings: An epoch for each round, and one before.
        steps: A round.
        device: Where.
    """
    found, speeds = open_dataset(place), []
    parts = {name: np.asarray(index) for name, index in found.split(settings.split).items()}
    parts["train"] = np.resize(parts["train"], steps * settings.batch)
    parts["validation"] = parts["validation"][:1]  # an epoch ends with it
    with ExitStack() as stack:
        if device == "cpu":
            stack.enter_context(threads_of(1))
        with repeatable(settings.seed):
            work = prepare(found, parts, place, settings, torch_device(device))
            bare = BareLoop(copy.deepcopy(work.network), work.train.images, work.train.tilt_class, batch=settings.batch)
            take = steps_of(work)
        for epoch in range(settings.epochs):
            with repeatable(settings.seed):
                begun = time.process_time()
                ours = one_epoch(work, epoch, take)["images_per_second"]
                spent = time.process_time() - begun
            if device == "cpu":  # others may use this machine, too
                ours = len(parts["train"]) / spent
            speeds.append((ours, bare.images_per_second(steps)))
    ours, others = np.array(speeds[1:]).T
    return ours, others
