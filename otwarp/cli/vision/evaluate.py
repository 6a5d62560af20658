"""`otwarp vision evaluate`: how good a network is, how sure, and how far from what images hold."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option
from otwarp.cli.types import FILE, Number, OutputPath


@click.command()
@click.argument("run", type=FILE)
@click.argument("datasets", type=FILE, nargs=-1)
@click.option("--report", type=OutputPath(folder=True), metavar="DIR",
              help="Folder of the report: report.md, report.json, figures; default: report in RUN.")  # fmt: skip
@click.option("--poses", type=Number(0, 10_000, whole=True), default=8, show_default=True,
              help="Of which the Cramér–Rao bound is computed, about a second each; 0 for none.")  # fmt: skip
@click.option("--no-baselines", is_flag=True, help="Leave templates and focus measures out.")
@click.option("--any-robot", is_flag=True, help="Go on with data sets of another robot than the network's.")
@device_option
def evaluate(
    run: Path,
    datasets: tuple[Path, ...],
    report: Path | None,
    poses: int,
    no_baselines: bool,
    any_robot: bool,
    device: str | None,
) -> None:
    """Evaluate the network of the training RUN on data sets.

    Of the data set that it was trained on, the test part of its split; of others, all images.
    """
    from otwarp.vision.networks.evaluate import evaluate as evaluated
    from otwarp.vision.networks.metrics import in_words
    from otwarp.vision.networks.report import check_report, write_report

    folder = check_report(report or (run.parent if run.is_file() else run) / "report")
    stop.begin()

    def say(name: str) -> None:
        stop.check()
        click.echo(f"otwarp: {name}", err=True)

    estimator, found = evaluated(run, datasets, poses=poses, baselines=not no_baselines, device=device,
                                 any_robot=any_robot, report=say)  # fmt: skip
    page = write_report(folder, estimator, found)
    for one in found:
        click.echo(f"{one.name}, {one.about}: {in_words(one.scores)}")
    click.echo(f"wrote {page}")
