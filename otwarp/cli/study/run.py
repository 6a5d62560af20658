"""`otwarp study run`: compute a study, or go on with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option
from otwarp.cli.output import with_room
from otwarp.cli.progress import parts
from otwarp.cli.types import STUDY, OutputPath


@click.command()
@click.argument("file", type=STUDY)
@click.option(
    "-o", "--out", type=OutputPath(folder=True), metavar="DIR", help="Folder of the study; default: out/FILE."
)
@click.option("--shard", metavar="N/OF", help="Compute this share of the blocks, as 3/16; several may run at once.")
@click.option(
    "--engine",
    type=click.Choice(["local", "ray"]),
    default="local",
    show_default=True,
    help="Who computes: all GPUs of this host, or its CPU; or Ray, on this host or several.",
)
@click.option(
    "--address", metavar="HOST:PORT", help="Head of a Ray cluster, or auto; default: RAY_ADDRESS, or this host alone."
)
@click.option("--allow-version", is_flag=True, help="Go on with what another version of otwarp, Warp or NumPy began.")
@device_option
def run(file: Path, out: Path | None, shard: str | None, engine: str, address: str | None, **how: Any) -> None:
    """Compute the study in FILE. The same line goes on after whatever ended it.

    Results do not depend on devices of one kind, shards, interruptions or the order of the work. With --engine ray the
    folder is one that all hosts share.
    """
    from otwarp.studies.engines.local import parse_shard
    from otwarp.studies.engines.run import run_study
    from otwarp.studies.file import load_study

    share = None if shard is None else parse_shard(shard)
    where = _engine(engine, address, how["device"], shard)
    study = load_study(file)
    folder = out or Path("out") / file.stem
    stop.begin()
    what = "block" if study.stop.budget is None else "trial"
    kept = ", where the same line goes on: finished blocks are kept"
    try:
        with parts(what, f"{what}s") as progress, with_room(folder, kept):
            store = run_study(
                study, folder, shard=share, progress=progress, allow_version=how["allow_version"], **where
            )
    except KeyboardInterrupt:
        if (folder / "study.json").exists():
            click.echo(f"otwarp: finished blocks are kept in {folder}: the same line goes on", err=True)
        raise
    done, blocks = len(store.finished()), store.asked()["blocks"]
    if share is not None and share[0] > blocks:
        click.echo(f"shard {shard} has none of the {blocks} block{'s' if blocks > 1 else ''}: nothing to compute")
    click.echo(f"{done} of {blocks} blocks are done")
    if done == blocks:
        click.echo(f"look at   otwarp study show {folder} --plot {folder}.png")
        click.echo(f"export    otwarp study export {folder} -o {folder}.nc")


def _engine(engine: str, address: str | None, device: str | None, shard: str | None) -> dict[str, Any]:
    """Arguments of `run_study` that say who computes; wrong ones are refused before anything slow."""
    from otwarp.errors import InputError

    if engine == "ray":
        from otwarp.studies.engines.on_ray import ray_engine

        if shard is not None:
            raise InputError(f"--shard is {shard}; allowed with --engine ray: none, Ray shares the blocks out")
        return {"engine": ray_engine(address, device=device)}
    if address is not None:
        raise InputError(f"--address is {address}; allowed with --engine ray alone")
    from otwarp.device import pick_device

    return {"devices": None if device is None else [str(pick_device(device))]}
