"""`otwarp scenes list`: names of what is shipped, and what it shows."""

from __future__ import annotations

import click

from otwarp import shipped
from otwarp.cli.options import json_option
from otwarp.cli.output import json_text

USES = {
    "scenes": "otwarp run NAME",
    "studies": "otwarp study run NAME",
    "vision": "otwarp vision dataset NAME",
}
"""What each kind is for, as it is typed."""


@click.command()
@json_option
def list(as_json: bool) -> None:
    """Name the shipped scenes, studies and data sets, with what they show and where they are."""
    found = {
        kind: {name: (shipped.about(kind, name), shipped.shipped(kind, name)) for name in shipped.names(kind)}
        for kind in shipped.ENDINGS
    }
    if as_json:
        said = {k: {n: {"about": a, "file": str(f)} for n, (a, f) in rows.items()} for k, rows in found.items()}
        click.echo(json_text(said))
        return
    width = max(len(name) for rows in found.values() for name in rows)
    for kind, rows in found.items():
        click.echo(f"{kind}: {USES[kind]}")
        for name, (text, _) in rows.items():
            click.echo(f"  {name:<{width}}  {text}")
