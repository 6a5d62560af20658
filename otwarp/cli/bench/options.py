"""What the benchmarks of one bead in one trap are asked: the bead, its beam, and where results go."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli import stop
from otwarp.cli.options import FILE
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.bench.findings import BeadFindings
    from otwarp.bench.report import Table as ResultTable
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Particle


def _shown(name: str, text: str, default: Any) -> Callable[..., Any]:
    return click.option(name, type=type(default), default=default, show_default=True, help=text)


BEAD = (
    _shown("--radius", "Radius of the bead [µm].", 1.0),
    _shown("--index", "Its refractive index.", 1.59),
    _shown("--medium-index", "Refractive index of the medium.", 1.33),
    _shown("--wavelength", "Vacuum wavelength [µm].", 1.064),
    _shown("--na", "Numerical aperture.", 1.2),
    _shown("--beam", "gaussian, sine or aplanatic.", "gaussian"),
    _shown("--polarization", "x, y, 45, circular or left.", "circular"),
    _shown("--filling", "1/e² radius over the aperture's radius.", 1.0),
    _shown("--charge", "Azimuthal charge of a vortex beam.", 0),
    _shown("--depth", "Depth below the cover glass [µm].", 0.0),
    click.option("--glass-index", type=float, help="Index of glass and oil, for the aberration at that depth."),
)
"""Options of the bead and its beam."""

OUTPUT = (
    click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write all numbers to FILE."),
    click.option("--plot", type=FILE, metavar="PNG", help="Draw error against time."),
    click.option(
        "--with", "others", type=FILE, multiple=True, metavar="JSON", help="Draw that run as well; may be repeated."
    ),
)
"""Options of where results go."""


@dataclass(frozen=True, kw_only=True)
class Bead:
    """The bead and its beam, as typed."""

    radius: float
    index: float
    medium_index: float
    wavelength: float
    na: float
    beam: str
    polarization: str
    filling: float
    charge: int
    depth: float
    glass_index: float | None

    def optics(self, power: float) -> tuple[Beam, Particle]:
        """Beam and sphere at a power [mW].

        Raises:
            InputError: What they refuse.
        """
        from otwarp.optics.beam import Beam
        from otwarp.optics.mie import Particle

        beam = Beam(
            kind=self.beam,
            numerical_aperture=self.na,
            medium_index=self.medium_index,
            wavelength=self.wavelength,
            polarization=self.polarization,
            power=power,
            filling=self.filling,
            charge=self.charge,
            depth=self.depth,
            glass_index=self.glass_index,
        )
        return beam, Particle(radius=self.radius, index=self.index)


@dataclass(frozen=True, kw_only=True)
class Output:
    """Where results go, as typed; refused at once if nothing could be written there minutes later."""

    json_file: Path | None
    plot: Path | None
    others: tuple[Path, ...]

    def __post_init__(self) -> None:
        for option, file in (("--json", self.json_file), ("--plot", self.plot)):
            if file is not None and not file.parent.is_dir():
                raise InputError(f"{option} {file} cannot be written: no folder {file.parent}")
            if file is not None and file.is_dir():
                raise InputError(f"{option} {file} cannot be written: it is a folder")
        if self.others and self.plot is None:
            raise InputError(f"--with {self.others[0]} comes without --plot; allowed: both")

    def report(self) -> None:
        """Say what was written."""
        for file in (self.json_file, self.plot):
            if file is not None:
                click.echo(f"wrote {file}")


def taken(group: type, typed: dict[str, Any]) -> Any:
    """A `Bead` or an `Output` out of what was typed, whose options are removed from `typed`."""
    return group(**{field.name: typed.pop(field.name) for field in fields(group)})


def with_options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a command with options, in this order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def check_same(beam: Beam, sphere: Particle, files: tuple[Path, ...], runs: Sequence[BeadFindings]) -> None:
    """Refuse runs of another bead, whose errors do not belong into the same picture."""
    from otwarp.bench.findings import bead_fields

    for file, run in zip(files, runs, strict=True):
        if {"beam": run.beam, "sphere": run.sphere} != bead_fields(beam, sphere):
            raise InputError(f"--with {file} holds another bead or trap ({run.bead()}); allowed: the one measured now")


def note(text: str) -> None:
    """Say on a terminal what is being done; heed SIGTERM."""
    stop.check()
    if sys.stderr.isatty():
        click.echo(f"\r\x1b[K{text}", nl=False, err=True)


def print_table(what: ResultTable) -> None:
    """A table on the terminal, its first column text and the others numbers."""
    from rich.console import Console
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
    Console(width=None if sys.stdout.isatty() else 200).print(table)
