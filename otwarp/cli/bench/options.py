"""What benchmarks are asked, the bead in its trap and where results go, and how they print what they find."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli import stop
from otwarp.cli.options import json_option, out_option
from otwarp.cli.options.bead import beam_options, sphere_options
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import FILE, OutputPath
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.bench.findings import BeadFindings, Findings
    from otwarp.bench.report import Table as ResultTable
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Particle


def bead() -> list[click.Option]:
    """Options of the bead and its beam, for the command to own."""
    return [*sphere_options(radius=1.0, index=1.59), *beam_options(na=1.2)]


OUTPUT = (
    out_option("FILE", "Write all numbers to FILE, JSON."),
    json_option,
    click.option("--plot", type=OutputPath(), metavar="PNG", help="Draw error against time."),
    click.option(
        "--with", "others", type=FILE, multiple=True, metavar="JSON", help="Draw that run as well; may be repeated."
    ),
)
"""Options of where results go."""


@dataclass(frozen=True, kw_only=True)
class Output:
    """Where results go, as typed."""

    out: Path | None
    as_json: bool
    plot: Path | None = None
    others: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        if self.others and self.plot is None:
            raise InputError(f"--with {self.others[0]} comes without --plot; allowed: both")

    def report(self, found: Findings, show: Callable[[], None], draw: Callable[[Path], None] | None = None) -> None:
        """Write what was found and draw it as asked, then print it: as JSON and nothing else, or by `show`."""
        if self.out is not None:
            found.save(self.out)
        if self.plot is not None and draw is not None:
            draw(self.plot)
        if self.as_json:
            click.echo(json_text(found.json()))
            return
        show()
        for file in (self.out, self.plot):
            if file is not None:
                click.echo(f"wrote {file}")


def check_same(beam: Beam, sphere: Particle, files: tuple[Path, ...], runs: Sequence[BeadFindings]) -> None:
    """Refuse runs of another bead, whose errors do not belong into the same picture."""
    from otwarp.bench.findings import bead_fields

    for file, run in zip(files, runs, strict=True):
        if {"beam": run.beam, "sphere": run.sphere} != bead_fields(beam, sphere):
            raise InputError(f"--with {file} holds another bead or trap ({run.bead()}); allowed: the one measured now")


def note(text: str) -> None:
    """Say on a terminal what is being done; end on SIGTERM."""
    stop.check()
    if sys.stderr.isatty():
        click.echo(f"\r\x1b[K{text}", nl=False, err=True)


def print_table(what: ResultTable) -> None:
    """A table on the terminal, its first column text and the others numbers."""
    from rich.table import Table
    from rich.text import Text

    if sys.stderr.isatty():
        click.echo("\r\x1b[K", nl=False, err=True)
    # plain text: rich would take units in brackets for markup
    table = Table(title=what.title, title_justify="left", caption=what.note or None)
    table.caption_justify = "left"
    for n, column in enumerate(what.head):
        table.add_column(Text(column), justify="left" if n == 0 else "right")
    for row in what.rows:
        table.add_row(*row)
    # cells break to fit a terminal; a pipe or a file gets them whole
    tables_console(200).print(table)


def print_tables(tables: Sequence[ResultTable]) -> None:
    """Several, one below the other."""
    for table in tables:
        print_table(table)
