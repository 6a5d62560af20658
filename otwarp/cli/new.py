"""`otwarp new`: a scene or study to begin with."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

import click

from otwarp import shipped
from otwarp.cli.options import force_option
from otwarp.cli.output import check_new
from otwarp.cli.types import FILE
from otwarp.errors import InputError
from otwarp.files import written

NEXT = {".usda": ("run", "preview"), ".toml": ("study plan", "study run")}
"""What to do with a file, by its ending."""


@click.command()
@click.argument("kind", type=click.Choice(list(shipped.TEMPLATES)))
@click.argument("file", type=FILE)
@force_option
def new(kind: str, file: Path, force: bool) -> None:
    """Write a KIND of scene, or a study, into FILE: a short text with comments that runs as it is.

    channel: a flow, a pillar, cells and a trapped bead. robot: three spheres on rods, carried by two traps. chamber: a
    closed mesh with a bead and a cell in it. study: what becomes of a bead beside a trap, by power and place.
    """
    ending = Path(shipped.TEMPLATES[kind]).suffix
    if file.suffix != ending:
        raise InputError(f"FILE is {file}; allowed: a name that ends in {ending}")
    check_new(file, force=force)
    with written(file) as part:
        part.write_text(shipped.template(kind), encoding="utf-8")
    click.echo(f"wrote {file}")
    for command in NEXT[ending]:
        click.echo(f"next   otwarp {command} {quote(str(file))}")
