"""`otwarp bench`: what accuracy costs on this machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.bench.result import ForcesBench
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Sphere

_FILE = click.Path(path_type=Path)


@click.group()
def bench() -> None:
    """Measure what accuracy costs on this machine."""


@bench.command()
@click.option("--radius", type=float, default=1.0, show_default=True, help="Radius of the bead [µm].")
@click.option("--index", type=float, default=1.59, show_default=True, help="Its refractive index.")
@click.option("--medium-index", type=float, default=1.33, show_default=True, help="Refractive index of the medium.")
@click.option("--wavelength", type=float, default=1.064, show_default=True, help="Vacuum wavelength [µm].")
@click.option("--na", type=float, default=1.2, show_default=True, help="Numerical aperture.")
@click.option("--beam", default="gaussian", show_default=True, help="gaussian, sine or aplanatic.")
@click.option("--polarization", default="circular", show_default=True, help="x, y, 45, circular or left.")
@click.option("--filling", type=float, default=1.0, show_default=True, help="1/e² radius over the aperture's radius.")
@click.option("--charge", type=int, default=0, show_default=True, help="Azimuthal charge of a vortex beam.")
@click.option("--depth", type=float, default=0.0, show_default=True, help="Depth below the cover glass [µm].")
@click.option("--glass-index", type=float, help="Index of glass and oil, for the aberration at that depth.")
@click.option("--power", type=float, default=20.0, show_default=True, help="Power in the medium [mW].")
@click.option(
    "--model", "models", multiple=True, metavar="NAME", help="Measure this model; may be repeated. Default: all."
)
@click.option("--worlds", type=int, help="Beads; default: 4096 on a CPU, 1048576 on a GPU.")
@click.option("--rounds", type=int, default=7, show_default=True, help="Repeats of each figure.")
@click.option("--time-step", type=float, metavar="SECONDS", help="The same for all models; default: k·dt/γ = 0.02.")
@click.option("--fast-math", is_flag=True, help="Approximate instructions on CUDA.")
@device_option
@click.option("--json", "json_file", type=_FILE, metavar="FILE", help="Write all numbers to FILE.")
@click.option("--plot", type=_FILE, metavar="PNG", help="Draw error against time per step.")
@click.option(
    "--with", "others", type=_FILE, multiple=True, metavar="JSON", help="Draw that run as well; may be repeated."
)
def forces(
    radius: float,
    index: float,
    medium_index: float,
    wavelength: float,
    na: float,
    beam: str,
    polarization: str,
    filling: float,
    charge: int,
    depth: float,
    glass_index: float | None,
    power: float,
    models: tuple[str, ...],
    worlds: int | None,
    rounds: int,
    time_step: float | None,
    fast_math: bool,
    device: str | None,
    json_file: Path | None,
    plot: Path | None,
    others: tuple[Path, ...],
) -> None:
    """Error against run time of every force model, for one bead in one trap.

    Each model runs in the same step that otwarp run takes, with Brownian noise, in many worlds; its error is that of
    the force which the running simulation feels, against exact forces. Tables come from the cache, or are built: those
    of small tolerance take minutes.
    """
    from otwarp.bench.forces import bench_forces
    from otwarp.bench.result import ForcesBench
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Sphere

    _check_files(json_file, plot, others)
    earlier = [ForcesBench.read(file) for file in others]
    light = Beam(
        kind=beam,
        numerical_aperture=na,
        medium_index=medium_index,
        wavelength=wavelength,
        polarization=polarization,
        power=power,
        filling=filling,
        charge=charge,
        depth=depth,
        glass_index=glass_index,
    )
    sphere = Sphere(radius=radius, index=index)
    _check_same(light, sphere, others, earlier)
    found = bench_forces(
        light,
        sphere,
        models=models,
        device=device,
        worlds=worlds,
        rounds=rounds,
        time_step=time_step,
        fast_math=fast_math,
        note=_note,
    )
    if json_file is not None:
        found.save(json_file)
    if plot is not None:
        from otwarp.bench.figure import draw_runs

        draw_runs([found, *earlier], plot)
    _print(found)
    for file in (json_file, plot):
        if file is not None:
            click.echo(f"wrote {file}")


def _check_files(json_file: Path | None, plot: Path | None, others: tuple[Path, ...]) -> None:
    """Refuse before minutes of measurement what could not be written after them."""
    for option, file in (("--json", json_file), ("--plot", plot)):
        if file is not None and not file.parent.is_dir():
            raise InputError(f"{option} {file} cannot be written: no folder {file.parent}")
        if file is not None and file.is_dir():
            raise InputError(f"{option} {file} cannot be written: it is a folder")
    if others and plot is None:
        raise InputError(f"--with {others[0]} comes without --plot; allowed: both")


def _check_same(beam: Beam, sphere: Sphere, others: tuple[Path, ...], earlier: list[ForcesBench]) -> None:
    """Refuse runs of another bead, whose errors do not belong into the same picture."""
    from otwarp.bench.result import beam_fields, sphere_fields

    for file, run in zip(others, earlier, strict=True):
        if (run.beam, run.sphere) != (beam_fields(beam), sphere_fields(sphere)):
            raise InputError(f"--with {file} holds another bead or trap ({run.bead()}); allowed: the one measured now")


def _note(text: str) -> None:
    """Say on a terminal what is being done; heed SIGTERM."""
    stop.check()
    if sys.stderr.isatty():
        click.echo(f"\r\x1b[K{text}", nl=False, err=True)


def _print(found: ForcesBench) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from otwarp.bench.table import HEAD, caption, table_rows

    if sys.stderr.isatty():
        click.echo("\r\x1b[K", nl=False, err=True)
    # plain text: rich would take units in brackets for markup
    table = Table(title=f"Force models on {found.hardware}", title_justify="left", caption=caption(found))
    table.caption_justify = "left"
    for n, head in enumerate(HEAD):
        table.add_column(Text(head), justify="left" if n == 0 else "right")
    for row in table_rows(found):
        table.add_row(*row)
    # cells break to fit a terminal; a pipe or a file gets them whole
    Console(width=None if sys.stdout.isatty() else 200).print(table)
