"""`otwarp vision train`: train a network on a data set, or go on with it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, seed_option
from otwarp.cli.types import COUNT, FILE, Number, OutputPath


@click.command()
@click.argument("dataset", type=FILE)
@click.option("-o", "--out", type=OutputPath(folder=True), metavar="DIR",
              help="Folder of the training; default: DATASET_NET, beside DATASET.")  # fmt: skip
@click.option("--net", type=click.Choice(["resnet18", "resnet50", "vgg16", "small"]), default="resnet18",
              show_default=True, help="Which network; small takes a tenth of the arithmetic of resnet18.")  # fmt: skip
@click.option("--heads", type=click.Choice(["both", "paper", "pose"]), default="both", show_default=True,
              help="Classes of tilt and normalised depth, a pose with its covariance, or both.")  # fmt: skip
@click.option("--split", metavar="NAME", default="random", show_default=True, help="Of the data set.")
@click.option("--epochs", type=Number(1, 100_000, whole=True), default=20, show_default=True, help="Passes.")
@click.option("--batch", type=Number(2, 65536, whole=True), default=32, show_default=True, help="Images a step.")
@click.option("--size", type=Number(32, 1024, whole=True, unit="pixels"), metavar="PIXELS",
              help="Side to which images are resized; default: the data set's own.")  # fmt: skip
@click.option("--lr", type=Number(0.0, 1.0, above=True), metavar="RATE",
              help="Largest learning rate; default: 1e-3, for vgg16 from random weights 1e-4.")  # fmt: skip
@click.option("--schedule", type=click.Choice(["cosine", "step"]), default="cosine", show_default=True,
              help="Of the learning rate: a cosine after a warm-up; step: a tenth every ten epochs.")  # fmt: skip
@click.option("--weights", default="none", show_default=True, metavar="NAME",
              help="none, imagenet (torchvision's file, which must be there), or a file of weights.")  # fmt: skip
@click.option("--images", type=COUNT, metavar="N", help="Of the training part, drawn at random; default: all.")
@click.option("--no-augment", is_flag=True, help="Leave brightness, contrast, noise and place of images alone.")
@click.option("--precision", type=click.Choice(["auto", "bf16", "float32"]), default="auto", show_default=True,
              help="Of the arithmetic; auto is bf16 on GPUs.")  # fmt: skip
@click.option("--depth-loss", type=click.Choice(["right", "broadcast"]), default="right", show_default=True,
              help="broadcast compares every depth with every label: a published error, as an ablation.")  # fmt: skip
@seed_option
@device_option
def train(
    dataset: Path,
    out: Path | None,
    size: int | None,
    lr: float | None,
    images: int | None,
    no_augment: bool,
    device: str | None,
    **chosen: Any,
) -> None:
    """Train a network on the data set DATASET. The same line goes on after whatever ended it, to the same bits."""
    from otwarp.vision.networks.settings import Settings
    from otwarp.vision.networks.train import train as run

    settings = Settings(size=size or 0, lr=lr or 0.0, images=images or 0, augment=not no_augment, **chosen)
    there = dataset if dataset.name not in ("", "..") else dataset.resolve()  # . and .. are no names
    folder = out or there.parent / f"{there.name}_{settings.net}"
    stop.begin()
    with _progress(settings.epochs) as say:
        metrics = run(dataset, folder, settings, device=device, report=say)
    click.echo(summary(metrics))
    click.echo(f"wrote {folder}: network.pt, curves.png, metrics.json")


def summary(metrics: Mapping[str, Any]) -> str:
    """What a training reached, in a line."""
    from otwarp.vision.networks.metrics import in_words

    test, weights = metrics["test"], metrics["weights"]["source"]
    begun = "random weights" if weights == "none" else weights
    begun = f"{metrics['net']} from {begun}, epoch {metrics['best_epoch']}, {test['images']} test images"
    return f"{begun}: {in_words(test)}"


def _line(row: Mapping[str, Any]) -> str:
    """What an epoch gave."""
    words = f"loss {row['training_loss']:.4g}, validation {row['validation_loss']:.4g}"
    words += f", accuracy {row['accuracy']:.3f}" if "accuracy" in row else ""
    words += f", depth {row['depth_rmse_um']:.3g} µm" if "depth_rmse_um" in row else ""
    return f"{words}, {row['images_per_second']:.0f} images/s"


@contextmanager
def _progress(epochs: int) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """A bar on standard error, if that is a terminal, else a line for each epoch."""
    if not sys.stderr.isatty():

        def say(row: Mapping[str, Any]) -> None:
            """Write a line."""
            stop.check()
            click.echo(f"otwarp: epoch {row['epoch']} of {epochs}: {_line(row)}", err=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True, highlight=False)) as progress:
        task = progress.add_task("first epoch", total=epochs)

        def move(row: Mapping[str, Any]) -> None:
            """Move the bar."""
            stop.check()
            progress.update(task, completed=row["epoch"], description=_line(row))

        yield move
