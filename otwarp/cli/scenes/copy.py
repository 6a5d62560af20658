"""`otwarp scenes copy`: a shipped file, to change it."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp import shipped
from otwarp.cli.options import force_option, out_option
from otwarp.cli.output import check_new
from otwarp.errors import InputError
from otwarp.files import written


@click.command()
@click.argument("name")
@out_option("FILE", "Where; default: under its own name in this folder.")
@force_option
def copy(name: str, out: Path | None, force: bool) -> None:
    """Copy the shipped scene, study or data set NAME, to change it.

    A copied study or data set names its scene as shipped, until its line `scene = …` says otherwise.
    """
    kind, source = _source(name)
    file = out or Path(source.name)
    if file.is_dir():
        file = file / source.name
    check_new(file, force=force)
    text = source.read_text(encoding="utf-8").replace('scene = "../scenes/', 'scene = "scenes/')
    with written(file) as part:
        part.write_text(text, encoding="utf-8")
    click.echo(f"wrote {file}: {shipped.about(kind, source.stem)}")


def _source(name: str) -> tuple[str, Path]:
    """Kind and path of what is called `name`; scenes first."""
    for kind in shipped.ENDINGS:
        if file := shipped.named(kind, name):
            return kind, file
    every = ", ".join(n for kind in shipped.ENDINGS for n in shipped.names(kind))
    raise InputError(f"NAME is {name}, which is not shipped; allowed: {every}")
