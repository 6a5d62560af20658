"""How long the small network has to learn until it is as good as ResNet18: both, trained for more and more epochs."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.report import Section, command
from benchmarks.vision_networks import FULL, SPECS
from benchmarks.vision_tables import ERRORS, cells
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.vision.datasets import labels_of, load_spec, make_dataset, open_dataset
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import train

EPOCHS = {"small, pose": (20, 40, 80, 160), "resnet18, pose": (20, 40, 80)}
"""Of the networks of `vision_networks.FULL`; those in one row of the table differ in nothing else."""


def measure(
    device: str = "cuda:0",
    *,
    rounds: int = 1,
    spec: Path = SPECS / "paper.toml",
    epochs: Mapping[str, Sequence[int]] = EPOCHS,
    split: str = "random",
) -> Section:
    """The table.

    Args:
        device: cpu or cuda:0; on a CPU the paper's layout takes days.
        rounds: Seeds of every training.
        spec: Of the data set.
        epochs: By network, how many.
        split: Of the data set.
    """
    place, rows, data = pick_device(device), [], dict[str, Any]()
    with tempfile.TemporaryDirectory() as apart:
        images = Path(apart) / "data"
        make_dataset(labels_of(load_spec(spec)), images, processes=1, device=device)
        for name, several in epochs.items():
            for count in several:
                some = []
                for seed in range(rounds):
                    how = Settings(**{**FULL[name], "epochs": count}, split=split, seed=seed)
                    some.append(train(images, Path(apart) / f"{name}_{count}_{seed}", how, device=device))
                data[f"{name}, {count}"] = some
                seconds = min(one["training_seconds"] for one in some)
                rows.append((name, str(count), *cells([one["test"] for one in some]), f"{seconds:.0f}"))
                print(" | ".join(rows[-1]), flush=True)
        found = open_dataset(images)
    size = f"{found.count} images of {found.shape[1]} × {found.shape[0]} pixels, {len(found.classes)} tilts"
    note = f"{size}; {split} split; errors of the test part, by the network that was best on the validation part."
    table = Table(title="Longer trainings", head=("network", "epochs", *ERRORS, "training [s]"), rows=rows, note=note)
    kind = "cpu" if place.is_cpu else "cuda"
    asked = f"--split {split}" if split != "random" else ""
    return Section(
        name="vision_longer", kind=kind, machine=Machine.look(place), tables=[table], data=data, asked=asked
    )  # fmt: skip


if __name__ == "__main__":
    command(
        measure,
        "Errors of the small network and of ResNet18 over the epochs of their training.",
        rounds=1,
        split={"default": "random", "help": "split of the data set (default: random)"},
    )
