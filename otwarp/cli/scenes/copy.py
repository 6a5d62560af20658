"""`otwarp scenes copy`: a shipped file, to change it."""

from __future__ import annotations

import re
from pathlib import Path

import click

from otwarp import shipped
from otwarp.cli.options import force_option, out_option
from otwarp.cli.output import check_new
from otwarp.errors import InputError, nearest
from otwarp.files import written

SCENE = re.compile(r'^scene = "\.\./scenes/(.+?)"', re.MULTILINE)
"""Line of a study or a data set that names its scene."""


@click.command()
@click.argument("name")
@out_option("FILE", "Where; default: under its own name in this folder.")
@force_option
def copy(name: str, out: Path | None, force: bool) -> None:
    """Copy the shipped scene, study or data set NAME, to change it.

    The scene that a study or a data set names is copied beside it; one that is there already, the same, stays.
    """
    kind, source = _source(name)
    file = out or Path(source.name)
    check_new(file, force=force)
    text = source.read_text(encoding="utf-8")
    if found := SCENE.search(text):
        _copy_scene(shipped.shipped("scenes", found[1]), file.parent, force)
        text = SCENE.sub(r'scene = "\1"', text)
    with written(file) as part:
        part.write_text(text, encoding="utf-8")
    click.echo(f"wrote {file}: {shipped.about(kind, source.stem)}")


def _copy_scene(source: Path, folder: Path, force: bool) -> None:
    """The scene of a study, beside it."""
    file, content = folder / source.name, source.read_bytes()
    if file.is_file() and file.read_bytes() == content:
        return
    check_new(file, force=force)
    with written(file) as part:
        part.write_bytes(content)
    click.echo(f"wrote {file}: {shipped.about('scenes', source.stem)}")


def _source(name: str) -> tuple[str, Path]:
    """Kind and path of what is called `name`; scenes first."""
    for kind in shipped.ENDINGS:
        if file := shipped.named(kind, name):
            return kind, file
    kinds = shipped.kinds_of()
    near = nearest(Path(name).stem, list(kinds))
    every = ", ".join(f"{known} ({', '.join(of)})" for known, of in kinds.items())
    raise InputError(f"NAME is {name}, which is not shipped{near if '?' in near else ';'} allowed: {every}")
