"""How long the small network has to learn until it is as good as ResNet18: both, trained for more and more epochs.

On a CPU the small network alone, on 1,200 images."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.report import Section, command
from benchmarks.vision_networks import FULL, SMALL, SPECS
from benchmarks.vision_tables import ERRORS, cells
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.vision.datasets import labels_of, load_spec, make_dataset, open_dataset
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import train

EPOCHS = {"small, pose": (20, 40, 80, 160), "resnet18, pose": (20, 40, 80)}
"""Of the networks of `vision_networks.FULL`; those in one row of the table differ in nothing else."""
ON_A_CPU = {"small": (20, 60)}
"""Of those of `vision_networks.SMALL`."""


def sweeps(folder: Path) -> Path:
    """The robot of `smoke.toml` at ten tilts and 120 depths: 1,200 images of 64 × 64 pixels."""
    text = (SPECS / "smoke.toml").read_text(encoding="utf-8")
    for was, now in (("count = 5 }", "count = 10 }"), ("count = 40", "count = 120"), ("[26, 7, 7]", "[90, 15, 15]")):
        text = text.replace(was, now)
    (folder / "sweeps.toml").write_text(text, encoding="utf-8")
    return folder / "sweeps.toml"


def measure(
    device: str = "cuda:0",
    *,
    rounds: int = 1,
    spec: Path | None = None,
    epochs: Mapping[str, Sequence[int]] | None = None,
    split: str = "random",
) -> Section:
    """The table.

    Args:
        device: cpu or cuda:0.
        rounds: Seeds of every training.
        spec: Of the data set; None: the paper's layout on a GPU, on which a CPU would take days.
        epochs: By network, how many; None: those of the device.
        split: Of the data set.
    """
    place, rows, data = pick_device(device), [], dict[str, Any]()
    with tempfile.TemporaryDirectory() as apart:
        images = Path(apart) / "data"
        asked = spec or (sweeps(Path(apart)) if place.is_cpu else SPECS / "paper.toml")
        make_dataset(labels_of(load_spec(asked)), images, processes=1, device=device)
        for name, several in (epochs or (ON_A_CPU if place.is_cpu else EPOCHS)).items():
            for count in several:
                some = []
                for seed in range(rounds):
                    how = Settings(**{**(FULL | SMALL)[name], "epochs": count}, split=split, seed=seed)
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
    words = f"--split {split}" if split != "random" else ""
    return Section(
        name="vision_longer", kind=kind, machine=Machine.look(place), tables=[table], data=data, asked=words
    )  # fmt: skip


if __name__ == "__main__":
    command(
        measure,
        "Errors of the small network and of ResNet18 over the epochs of their training.",
        rounds=1,
        split={"default": "random", "help": "split of the data set (default: random)"},
    )
