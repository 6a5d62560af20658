"""`otwarp study status`: how far a study is."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text
from otwarp.cli.types import FILE


@click.command()
@click.argument("folder", type=FILE)
@json_option
def status(folder: Path, as_json: bool) -> None:
    """Say how far the study in FOLDER is."""
    from otwarp.studies.results import progress
    from otwarp.studies.store import open_store

    found = progress(open_store(folder))
    if as_json:
        click.echo(json_text(found))
        return
    click.echo(f"blocks    {found['blocks_done']:,} of {found['blocks']:,} are done")
    click.echo(f"points    {found['points_done']:,} of {found['points']:,}")
    budget = f" of a budget of {found['budget']:,}" if "budget" in found else ""
    click.echo(f"trials    {found['trials']:,}{budget}, {found['faults']:,} of them with a fault")
