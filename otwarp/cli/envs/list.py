"""`otwarp envs list`: name the shipped environments."""

from __future__ import annotations

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text


@click.command("list")
@json_option
def list(as_json: bool) -> None:
    """Name the shipped environments, and say what is to be done in each."""
    from otwarp.envs.registration import TASKS, about

    rows = {name: about(name) for name in TASKS}
    if as_json:
        click.echo(json_text(rows))
        return
    wide = max(map(len, rows))
    for name, description in rows.items():
        click.echo(f"{name.ljust(wide)}  {description}")
